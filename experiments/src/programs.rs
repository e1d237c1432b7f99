//! The programs: a figure of the paper each, or a study of ours, as the help of each says. Those of one form are in
//! [`comparison`](crate::comparison) and [`mesh_flow`](crate::mesh_flow).

pub mod calibration;
pub mod circle_convergence;
pub mod denoising;
pub mod disk_and_cube;
pub mod elastica;
pub mod ellipse_orders;
pub mod inpainting_2d;
pub mod inpainting_3d;
pub mod learned_networks;
pub mod mesh_distance;
pub mod performance;
pub mod spheres;
pub mod timing_tables;
pub mod train_networks;
pub mod unshrinking;
pub mod vesicles;
pub mod work_precision;
