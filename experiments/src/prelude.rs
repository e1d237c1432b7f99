//! What nearly every program needs.

pub mod libraries;

pub use self::libraries::*;
pub use crate::experiment::{Experiment, Figures, ResultFolder};
pub use crate::metrics::{METHOD, MetricTable};
pub use crate::networks::{
    ACCURATE, Chosen, ELEMENTS, EPS, NetworkOptions, PAPERS, STEP, convergence_network, operator,
    planar_flow, takes_networks, time,
};
pub use crate::options::{FigureOptions, RunOptions, distinct};
pub use crate::session::{Session, Stage};
pub use crate::study::{self, Planned, Study, StudyOptions, Variant};
pub use crate::{harness, step_table};
