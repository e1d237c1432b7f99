//! The experiments: a figure of the paper each, or a study of ours, in the order in which they are shown.

use crate::experiment::Experiment;

pub mod paper_numbers;
pub mod learned_networks;
pub mod circle_convergence;
pub mod mcf_cross;
pub mod rectangle;
pub mod cross;
pub mod work_precision;
pub mod direct_step;
pub mod vesicles;
pub mod elastica;
pub mod ellipse_orders;
pub mod timing_tables;
pub mod disk_and_cube;
pub mod armadillo;
pub mod rocker_arm;
pub mod spheres;
pub mod calibration;
pub mod inpainting_2d;
pub mod inpainting_3d;
pub mod denoising;
pub mod public_meshes;
pub mod unshrinking;
pub mod performance;
pub mod direct_learning;
pub mod train_networks;
pub mod mesh_distance;

/// The experiments that are declared above, in their order.
pub const EXPERIMENTS: &[&Experiment] = &include!(concat!(env!("OUT_DIR"), "/experiments.rs"));
