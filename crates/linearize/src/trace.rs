//! Recording a function, or a function and its gradient, as a graph.
//!
//! Burn's capture device records operations instead of running them. Burn's `Dispatch` backend
//! refuses `backward` on capture tensors, but the concrete backend `Autodiff<Capture>` below it does
//! not: the traced function works on tensors of that backend, and the backward pass is called on
//! its primitive. That is below Burn's stable surface; `tests/burn_internals.rs` pins it.

use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

use burn::backend::autodiff::Autodiff;
use burn::backend::ir::{CustomOpIr, OperationIr, TensorId, TensorIr};
use burn::backend::ops::FloatTensorOps;
use burn::backend::tensor::FloatTensor;
use burn::backend::{
    Backend, BackendTensor, Capture, DispatchAutodiffContext, DispatchKindConversion,
    DispatchTensor, TensorMetadata,
};
use burn::tensor::{DType, Device, FloatDType, Tensor, TensorData};
use burn_router::{RouterClient, RouterTensor};

use crate::ir::tensor;
use crate::{Error, Value, precision};

type Tracked = Autodiff<Capture>;
type Symbol = FloatTensor<Capture>;
type TrackedSymbol = FloatTensor<Tracked>;

/// Identifier of the operation that makes every input known to the capture device.
const INPUTS: &str = "burn_linearize::inputs";

/// What the traced function receives: symbols that stand for the inputs of the graph.
///
/// They have shapes and element types, but no values: reading data from them (`into_data`,
/// `into_scalar`) panics, and control flow cannot depend on it.
pub struct Inputs {
    variables: Vec<DispatchTensor>,
    parameters: Vec<DispatchTensor>,
    device: Device,
}

impl Inputs {
    /// The `i`-th variable.
    ///
    /// # Panics
    /// If there are not that many variables, or this one does not have `D` axes.
    pub fn variable<const D: usize>(&self, i: usize) -> Tensor<D> {
        symbol("variable", &self.variables, i)
    }

    /// The `i`-th parameter: an input that is held constant by differentiation.
    ///
    /// # Panics
    /// If there are not that many parameters, or this one does not have `D` axes.
    pub fn parameter<const D: usize>(&self, i: usize) -> Tensor<D> {
        symbol("parameter", &self.parameters, i)
    }

    /// The tracing device: create constants here, or move them here with `Tensor::to_device`. Its
    /// default float type is that of the first variable.
    pub fn device(&self) -> Device {
        self.device.clone()
    }
}

fn symbol<const D: usize>(role: &str, symbols: &[DispatchTensor], i: usize) -> Tensor<D> {
    let Some(symbol) = symbols.get(i) else {
        panic!(
            "there is no {role} {i}: the function is traced with {}",
            symbols.len()
        );
    };
    let rank = symbol.shape().num_dims();
    assert_eq!(rank, D, "{role} {i} has {rank} axes, not {D}");
    Tensor::from_dispatch(symbol.clone())
}

/// A recorded function of variables and parameters.
#[derive(Clone, Debug)]
pub struct Graph {
    pub(crate) operations: Vec<OperationIr>,
    pub(crate) sources: Sources,
    pub(crate) value: TensorIr,
    /// What is differentiated: the gradients, or all outputs of a traced function.
    pub(crate) outputs: Vec<TensorIr>,
}

/// What a graph or program reads.
#[derive(Clone, Debug)]
pub(crate) struct Sources {
    pub(crate) variables: Vec<TensorIr>,
    pub(crate) parameters: Vec<TensorIr>,
    pub(crate) constants: Vec<(TensorIr, TensorData)>,
}

impl Graph {
    /// Trace a function; its Jacobian-vector products come from [linearizing](Self::linearize) the
    /// graph. The first output is the [value](crate::Evaluation::value), and all of them are in
    /// [`gradients`](crate::Evaluation::gradients), in order.
    ///
    /// Only shapes and element types of `variables` and `parameters` matter here.
    ///
    /// # Errors
    /// If `f` returns nothing, or tensors that do not live on the [tracing device](Inputs::device).
    pub fn trace(
        variables: &[Value],
        parameters: &[Value],
        f: impl FnOnce(&Inputs) -> Vec<Value>,
    ) -> Result<Self, Error> {
        record(variables, parameters, |_, inputs| {
            let outputs = f(inputs).into_iter().enumerate();
            let outputs = outputs
                .map(|(index, output)| output_on::<Capture>(index, output.0))
                .collect::<Result<Vec<_>, Error>>()?;
            let value = outputs.first().cloned().ok_or(Error::NoOutputs)?;
            Ok((value, outputs))
        })
    }

    /// Trace a scalar function together with its gradient with respect to all variables. The
    /// parameters are inputs of the graph, held constant by differentiation.
    ///
    /// Only shapes and element types of `variables` and `parameters` matter here.
    ///
    /// # Errors
    /// If the result does not have shape `[1]` or does not live on the
    /// [tracing device](Inputs::device).
    pub fn gradient(
        variables: &[Value],
        parameters: &[Value],
        f: impl FnOnce(&Inputs) -> Tensor<1>,
    ) -> Result<Self, Error> {
        record_gradient(variables, parameters, Box::new(f))
    }
}

/// [`Graph::gradient`] of a function behind a pointer, so that this is compiled once and not for every function.
fn record_gradient(
    variables: &[Value],
    parameters: &[Value],
    f: Box<dyn FnOnce(&Inputs) -> Tensor<1> + '_>,
) -> Result<Graph, Error> {
    record(variables, parameters, |variables, inputs| {
        let tracked: Vec<TrackedSymbol> = (variables.iter())
            .map(|symbol| TrackedSymbol::new(symbol.clone()).require_grad())
            .collect();
        inputs.variables = tracked.iter().map(wrapped::<Tracked>).collect();
        let energy = f(inputs).into_dispatch();
        let shape = energy.shape();
        if shape.num_elements() != 1 {
            return Err(Error::NotScalar {
                shape: shape.to_vec(),
            });
        }
        // A constant energy, which no variable reaches, is not tracked.
        let (value, gradients) = if energy.autodiff == DispatchAutodiffContext::Disabled {
            (output_on::<Capture>(0, energy)?, None)
        } else {
            let energy = output_on::<Tracked>(0, energy)?;
            let value = energy.primitive().clone();
            (value, energy.is_tracked().then(|| energy.backward()))
        };
        let gradient = |symbol: &TrackedSymbol| {
            let found = gradients.as_ref().and_then(|all| symbol.grad(all));
            found.unwrap_or_else(|| zeros_like(symbol.primitive()))
        };
        Ok((value, tracked.iter().map(gradient).collect()))
    })
}

fn zeros_like(symbol: &Symbol) -> Symbol {
    Capture::float_zeros(symbol.shape(), &symbol.device(), symbol.dtype().into())
}

fn wrapped<B: Backend>(symbol: &FloatTensor<B>) -> DispatchTensor
where
    DispatchTensor: DispatchKindConversion<B>,
{
    DispatchTensor::from_backend(BackendTensor::Float(symbol.clone()))
}

/// The symbol behind an output; detached tensors of the gradient's device count too.
fn output_on<B: Backend>(index: usize, output: DispatchTensor) -> Result<FloatTensor<B>, Error>
where
    DispatchTensor: DispatchKindConversion<B>,
{
    let found = format!("{:?}", output.device());
    match DispatchTensor::try_into_backend(output) {
        Ok(BackendTensor::Float(tensor)) => Ok(tensor),
        _ => Err(Error::OutputDevice { index, found }),
    }
}

/// Records a function of the symbols of the variables and of the inputs, which gives the value and the outputs.
fn record(
    variables: &[Value],
    parameters: &[Value],
    f: impl FnOnce(&[Symbol], &mut Inputs) -> Result<(Symbol, Vec<Symbol>), Error>,
) -> Result<Graph, Error> {
    let dtype = variables.first().map_or(DType::F32, Value::dtype);
    let lease = Lease::take(dtype);
    let mut recorded = None;
    let captured = lease.device.capture_scope(|scope| {
        let [variables, parameters] = open(&lease.device, dtype, [variables, parameters]);
        let mut inputs = Inputs {
            variables: variables.iter().map(wrapped::<Capture>).collect(),
            parameters: parameters.iter().map(wrapped::<Capture>).collect(),
            device: lease.device.clone(),
        };
        let outputs = f(&variables, &mut inputs);
        let completed = match &outputs {
            Ok((value, outputs)) => {
                // The capture device wants no repetitions.
                let outputs = outputs.iter().chain([value]).map(Symbol::id);
                let inputs = variables.iter().chain(&parameters).map(Symbol::id);
                scope.complete(inputs, outputs.collect::<BTreeSet<TensorId>>())
            }
            Err(_) => scope.complete([], []),
        };
        // Outputs must outlive the scope's completion: the capture device takes the last use of a
        // tensor for its end.
        recorded = Some(outputs.map(|(value, outputs)| Graph {
            operations: Vec::new(),
            sources: Sources {
                variables: variables.iter().map(description).collect(),
                parameters: parameters.iter().map(description).collect(),
                constants: Vec::new(),
            },
            value: description(&value),
            outputs: outputs.iter().map(description).collect(),
        }));
        completed
    });
    let recorded = recorded.transpose()?;
    let captured = captured.map_err(|error| Error::Capture {
        reason: error.to_string(),
    })?;
    let mut graph = recorded.ok_or(Error::NoOutputs)?;
    graph.operations = captured.graph.operations;
    graph.operations.retain(|operation| match operation {
        OperationIr::Init(_) | OperationIr::Drop(_) => false,
        OperationIr::Custom(custom) => custom.id != INPUTS,
        _ => true,
    });
    precision::restore_reciprocals(&mut graph.operations);
    graph.sources.constants = (captured.values.into_iter())
        .map(|(id, data)| (tensor(id.value(), data.shape().clone(), data.dtype()), data))
        .collect();
    Ok(graph)
}

fn description(symbol: &Symbol) -> TensorIr {
    tensor(symbol.id().value(), symbol.shape(), symbol.dtype())
}

/// Symbols for the inputs, without values: a function that reads data fails to trace instead of
/// freezing the data into the graph.
fn open(device: &Device, dtype: DType, inputs: [&[Value]; 2]) -> [Vec<Symbol>; 2] {
    // Tensors that the traced function creates get the precision of its variables. A device can be
    // configured once, within a scope; a device that served before is configured already.
    if dtype.is_float() {
        let _ = device.clone().configure(FloatDType::from(dtype));
    }
    let seed: Symbol = Tensor::<1>::zeros([1], (device, dtype))
        .try_into_primitive::<Capture>()
        .expect("tensors created on a capture device live there");
    let client = seed.client.clone();
    let symbol = |value: &Value| {
        let (id, shape) = (client.create_empty_handle(), value.0.shape());
        RouterTensor::new(id, shape, value.dtype(), client.clone())
    };
    let symbols = inputs.map(|values| values.iter().map(symbol).collect::<Vec<Symbol>>());
    client.register_op(OperationIr::Custom(CustomOpIr {
        id: INPUTS.to_owned(),
        inputs: (symbols.iter().flatten())
            .map(|symbol| symbol.clone().into_ir())
            .collect(),
        outputs: Vec::new(),
        scalars: Vec::new(),
    }));
    symbols
}

/// A capture device for the duration of one recording. Devices allow one recording at a time and
/// are never recycled by Burn, so idle ones are kept.
struct Lease {
    dtype: DType,
    device: Device,
}

static IDLE: Mutex<Vec<(DType, Device)>> = Mutex::new(Vec::new());

impl Lease {
    fn take(dtype: DType) -> Self {
        let mut idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner);
        let device = match idle.iter().position(|(of, _)| *of == dtype) {
            Some(i) => idle.swap_remove(i).1,
            None => Device::capture(),
        };
        Self { dtype, device }
    }
}

impl Drop for Lease {
    fn drop(&mut self) {
        let mut idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner);
        idle.push((self.dtype, self.device.clone()));
    }
}
