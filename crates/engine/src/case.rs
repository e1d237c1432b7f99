//! A flow and everything that its result depends on.

use std::sync::OnceLock;

use fem::FiniteElementStep;
use files::{Sha256, hexadecimal};
use geometry::{Field, Grid, NodeSet, PhaseField, Stored};
use operators::ComputeDevice;
use serde_json::{Value, json};
use solver::FlowParams;

use crate::storage::{PER_HELD, PER_NODE_OF_ELEMENTS};
use crate::{
    Current, Error, Flow, Held, Helfrich, Measure, Method, Operator, Own, Scales, Stop, Storage,
    TimeSteps,
};

/// A flow with everything that its result depends on, but for the device.
#[derive(Clone, Debug)]
pub struct Case<const D: usize> {
    /// Name of the initial shape with its measures.
    pub shape: String,
    /// The initial phase field, without its pure phases.
    pub initial: Stored<D>,
    /// The nodes whose values may move, if not all.
    pub region: Option<NodeSet>,
    /// How far from that of the initial phase field the interface may go, if there is a bound; mean curvature flow has none.
    pub max_distance: Option<f64>,
    /// Spontaneous curvature, tension and pressure in the energy; mean curvature flow has none.
    pub energy: Helfrich,
    /// The sizes that are held; mean curvature flow holds none.
    pub held: Held,
    /// Mean curvature flow or Willmore flow.
    pub flow: Flow,
    /// The step of mean curvature flow, and the weights of the energy.
    pub operator: Operator<D>,
    /// Interface width, inner time step, and settings of the minimization.
    pub scales: Scales,
    /// Sizes of the time steps. Those of mean curvature flow are the inner step.
    pub steps: TimeSteps,
    /// The flow ends with the first of these rules that holds.
    pub stops: Vec<Stop>,
    /// Functionals of the phase field that are evaluated after every step.
    pub measures: Vec<Measure<D>>,
    /// Parts that are one's own.
    pub own: Own<D>,
}

impl<const D: usize> Case<D> {
    /// Willmore flow everywhere, with nothing held, until so many steps are made; the [size](Measure::size) is measured.
    pub fn willmore(
        shape: &str,
        initial: impl Into<Stored<D>>,
        operator: Operator<D>,
        scales: Scales,
        steps: impl Into<TimeSteps>,
        count: usize,
    ) -> Self {
        Self {
            shape: shape.to_owned(),
            initial: initial.into(),
            region: None,
            max_distance: None,
            energy: Helfrich::default(),
            held: Held::default(),
            flow: Flow::Willmore,
            operator,
            scales,
            steps: steps.into(),
            stops: vec![Stop::Steps(count)],
            measures: Measure::size(scales.eps),
            own: Own::default(),
        }
    }

    /// The grid.
    pub fn grid(&self) -> &Grid<D> {
        self.initial.grid()
    }

    /// A phase field of the flow, given what is stored of it.
    pub(crate) fn current<'a>(
        &'a self,
        stored: &'a Stored<D>,
        whole: &'a OnceLock<Field<D>>,
    ) -> Current<'a, D> {
        Current {
            stored,
            initial: &self.initial,
            region: self.region.as_ref(),
            whole,
        }
    }

    /// Flow, shape and operator, for titles and messages.
    pub fn title(&self) -> String {
        let cells = self.grid().spacing().recip().round();
        let operator = self.operator.label();
        format!(
            "{} of the {} by {operator} at n = {cells}",
            self.flow.title(),
            self.shape
        )
    }

    /// The scales and the weights of the energy, as the solver takes them.
    pub fn params(&self) -> FlowParams {
        FlowParams {
            eps: self.scales.eps,
            mcf_step: self.scales.mcf_step,
            newton: self.scales.newton,
            calibration: self.operator.factors,
        }
    }

    /// About how many bytes the flow takes if so many cells are stored.
    pub fn bytes(&self, stored: usize) -> f64 {
        let nodes = self.grid().len();
        let of_elements = match (self.flow, self.operator.discretization.method) {
            (Flow::MeanCurvature, Method::FeImplicit) => PER_NODE_OF_ELEMENTS,
            _ => 0.0,
        };
        let held = [self.held.perimeter, self.held.volume];
        let held = held.iter().flatten().count() as f64;
        let of_held = held * PER_HELD[usize::from(stored < nodes)];
        Storage::bytes(self.flow, nodes, stored) + (of_elements + of_held) * stored as f64
    }

    /// The finite-element step at the scales of the case: the measure of Willmore energies that the paper reports.
    pub fn implicit_elements(&self) -> Result<FiniteElementStep<D>, Error> {
        let Scales { eps, mcf_step, .. } = self.scales;
        Ok(FiniteElementStep::implicit(self.grid(), eps, mcf_step)?)
    }

    /// What distinguishes this case from others, as stored in checkpoints; fields and networks are stored as checksums, and measures by their names.
    pub fn identity(&self, device: &ComputeDevice) -> Value {
        let grid = self.grid();
        let rows = || (0..grid.len()).step_by(grid.cells());
        let (mut initial, mut row) = (Sha256::default(), vec![0.0; grid.cells()]);
        for start in rows() {
            self.initial.read(start, &mut row);
            let bytes = row.iter().flat_map(|value| value.to_le_bytes());
            initial.update(bytes.collect::<Vec<u8>>());
        }
        let region = self.region.as_ref().map(|nodes| {
            let (mut region, mut marks) = (Sha256::default(), nodes.iter().map(u8::from));
            for _ in rows() {
                let row = marks.by_ref().take(grid.cells());
                region.update(row.collect::<Vec<u8>>());
            }
            hexadecimal(region.finish())
        });
        let names: Vec<&str> = self.measures.iter().flat_map(Measure::names).collect();
        let mut identity = json!({
            "version": env!("CARGO_PKG_VERSION"),
            "device": format!("{} {:?}", device.kind(), device.dtype()).to_lowercase(),
            "grid": { "dimension": D, "cells": grid.cells(), "side": grid.side(), "origin": grid.origin().to_vec() },
            "initial": hexadecimal(initial.finish()),
            "region": region,
            "flow": self.flow,
            "operator": self.operator.identity(),
            "scales": self.scales,
            "steps": self.steps,
            "stops": self.stops,
            "measures": names,
        });
        if !self.energy.is_willmore() {
            identity["energy"] = json!(self.energy);
            identity["response"] = json!(self.operator.response);
        }
        if let Some(distance) = self.max_distance {
            identity["max_distance"] = json!(distance);
        }
        if !self.held.is_empty() {
            identity["held"] = json!(self.held);
        }
        let own = self.own.identity(self);
        let parts = identity.as_object_mut().expect("it is an object");
        parts.extend(own);
        identity
    }
}
