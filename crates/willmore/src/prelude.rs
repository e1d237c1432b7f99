//! All that a program of one's own needs, with one `use`.

pub use crate::Error as FlowError;
pub use crate::{Kept, Willmore};
pub use direct::{Direct, DirectParams};
pub use engine::{
    Attempts, Case, Checkpoints, Controller, Current, Discretization, EqualSteps, ErrorControl,
    Event, Formulation, Measure, Method, Observer, Operator, Order, Own, Progress, Record, Run,
    Samples, Scales, StepControl, StepRule, Stop, StopRule, StopWhen, Storage, Store, TimeSteps,
    Trajectory, Verdict,
};
pub use fem::FiniteElementStep;
pub use geometry::exact;
pub use geometry::measure::{l2_distance, perimeter, zero_set_volume};
pub use geometry::shapes::*;
pub use geometry::{
    Field, Grid, NodeSet, Nodes, PhaseField, SignedDistance, SignedDistanceExt, Stored, ZeroSet,
    distance_from_phase_field, optimal_profile, phase_field,
};
pub use jobs::Error as JobError;
pub use jobs::values::{Amount, Ansatz, Label, SizeTarget};
pub use jobs::{
    CommonOptions, FairOptions, FieldKind, FlowOptions, InpaintOptions, Input, InputOptions,
    Inside, Job, LabelSurface, Made, McfOptions, MeshReport, Note, OperatorOptions, Outcome,
    Results, RunOptions, SampleOptions, Shape, SharedLabels, Silent, Summary, Warning, Watcher,
    WillmoreOptions, fair, flow, inpaint, mcf, repair, run_in_folder, run_in_memory, sample,
    shared_labels, surfaces_of_labels,
};
pub use mean_curvature::{
    Calibration, Factors, Identity, MeanCurvatureStep, PhaseInverses, StepFailure, StepScales,
};
pub use model::training::SphereData;
pub use model::{MeanCurvatureOperator, Network, Networks, Ratios, Shipped};
pub use operators::{ComputeDevice, circular_convolution};
pub use runs::{Interrupt, RunDirectory};
pub use serde_json::json;
pub use solver::{
    Candidate, DeviceField, Domain, EnergyTerm, Euler, FlowParams, Held, Helfrich,
    MeanCurvatureFlow, Memory, Minimizations, Movement, NewtonParams, Precision, Pressure, Problem,
    Scheme, SecondOrder, SpontaneousCurvature, State, StepEstimates, StepRecord, StepSize, Stepper,
    Target, Tension, TermCheck, widths_between,
};
pub use solver::{DomainScales, Error as StepError};
pub use surfaces::{ClosedMesh, TriangleMesh};
pub use volumes::Volume;
