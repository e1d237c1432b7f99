//! Recording a function, or a function and its gradient, as a graph.
//!
//! Burn's capture device records operations instead of running them. Burn's `Dispatch` backend
//! refuses `backward` on capture tensors, but the concrete backend `Autodiff<Capture>` below it does
//! not: the traced function works on tensors of that backend, and the backward pass is called on
//! its primitive. That is below Burn's stable surface; `tests/burn_internals.rs` pins it.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use burn::backend::autodiff::Autodiff;
use burn::backend::ir::{
    BaseOperationIr as Base, CreationOpIr, CustomOpIr, OperationIr, TensorId, TensorIr,
};
use burn::backend::tensor::FloatTensor;
use burn::backend::{
    BackendTensor, Capture, DispatchAutodiffContext, DispatchKindConversion, DispatchTensor,
    TensorMetadata,
};
use burn::tensor::{DType, Device, FloatDType, Shape, Tensor, TensorData};
use burn_router::{RouterClient, RouterTensor};

use crate::ir::{rename, tensor};
use crate::{Error, Value, precision};

type Tracked = Autodiff<Capture>;
type Symbol = FloatTensor<Capture>;
type TrackedSymbol = FloatTensor<Tracked>;

/// Identifier of the operation that makes every input known to the capture device.
const INPUTS: &str = "linearize::inputs";

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
        record(variables, parameters, |session| {
            let outputs = f(&session.inputs()).into_iter().enumerate();
            let outputs = outputs
                .map(|(index, output)| output_on::<Capture>(index, output.0).map(Some))
                .collect::<Result<Vec<_>, Error>>()?;
            let value = outputs.first().cloned().flatten().ok_or(Error::NoOutputs)?;
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
        record(variables, parameters, |session| {
            let tracked: Vec<TrackedSymbol> = session
                .variables
                .iter()
                .map(|symbol| TrackedSymbol::new(symbol.clone()).require_grad())
                .collect();
            let mut inputs = session.inputs();
            inputs.variables = tracked
                .iter()
                .map(|t| DispatchTensor::from_backend(BackendTensor::<Tracked>::Float(t.clone())))
                .collect();
            let energy = f(&inputs).into_dispatch();
            let shape = energy.shape();
            if shape.num_elements() != 1 {
                return Err(Error::NotScalar {
                    shape: shape.to_vec(),
                });
            }
            if energy.autodiff == DispatchAutodiffContext::Disabled {
                // A constant energy: no variable reaches it.
                let energy = output_on::<Capture>(0, energy)?;
                return Ok((energy, vec![None; tracked.len()]));
            }
            let energy = output_on::<Tracked>(0, energy)?;
            let value = energy.primitive().clone();
            if !energy.is_tracked() {
                return Ok((value, vec![None; tracked.len()]));
            }
            let gradients = energy.backward();
            let outputs = tracked.iter().map(|t| t.grad(&gradients)).collect();
            Ok((value, outputs))
        })
    }
}

/// The symbol behind an output; detached tensors of the gradient's device count too.
fn output_on<B>(index: usize, output: DispatchTensor) -> Result<FloatTensor<B>, Error>
where
    B: burn::backend::Backend,
    DispatchTensor: DispatchKindConversion<B>,
{
    let found = format!("{:?}", output.device());
    match <DispatchTensor as DispatchKindConversion<B>>::try_into_backend(output) {
        Ok(BackendTensor::Float(tensor)) => Ok(tensor),
        _ => Err(Error::OutputDevice { index, found }),
    }
}

/// One recording in progress.
struct Session {
    device: Device,
    variables: Vec<Symbol>,
    parameters: Vec<Symbol>,
}

impl Session {
    fn inputs(&self) -> Inputs {
        let wrap = |symbol: &Symbol| {
            DispatchTensor::from_backend(BackendTensor::<Capture>::Float(symbol.clone()))
        };
        let all = |symbols: &[Symbol]| symbols.iter().map(wrap).collect();
        Inputs {
            variables: all(&self.variables),
            parameters: all(&self.parameters),
            device: self.device.clone(),
        }
    }
}

type Outputs = (Symbol, Vec<Option<Symbol>>);

fn record(
    variables: &[Value],
    parameters: &[Value],
    f: impl FnOnce(&Session) -> Result<Outputs, Error>,
) -> Result<Graph, Error> {
    let dtype = variables.first().map_or(DType::F32, Value::dtype);
    let lease = Lease::take(dtype);
    let device = lease.device.clone();
    let mut failure = None;
    let mut found: Option<Ids> = None;
    let captured = device.capture_scope(|scope| {
        let session = open(&device, dtype, variables, parameters);
        // Outputs must outlive the scope's completion: the capture device takes the last use of a
        // tensor for its end.
        let outputs = f(&session).map_err(|error| failure = Some(error)).ok();
        let ids = outputs.as_ref().map(|outputs| Ids::new(&session, outputs));
        let completed = match &ids {
            Some(ids) => scope.complete(ids.inputs(), ids.unique.clone()),
            None => scope.complete([], []),
        };
        found = ids;
        drop(outputs);
        completed
    });
    if let Some(error) = failure {
        return Err(error);
    }
    let captured = captured.map_err(|error| Error::Capture {
        reason: error.to_string(),
    })?;
    let ids = found.ok_or(Error::NoOutputs)?;
    Ok(build(captured.graph.operations, captured.values, &ids))
}

/// What the inputs and outputs are called on the capture device.
struct Ids {
    variables: Vec<TensorIr>,
    parameters: Vec<TensorIr>,
    value: TensorId,
    outputs: Vec<Option<TensorId>>,
    /// Outputs without repetitions, as the capture device wants them.
    unique: Vec<TensorId>,
}

impl Ids {
    fn new(session: &Session, (value, outputs): &Outputs) -> Self {
        let describe = |symbol: &Symbol| {
            let (shape, dtype) = (symbol.shape(), symbol.dtype());
            tensor(symbol.id().value(), shape, dtype)
        };
        let value = value.id();
        let outputs: Vec<_> = outputs.iter().map(|o| o.as_ref().map(Symbol::id)).collect();
        let mut unique = vec![value];
        for id in outputs.iter().flatten() {
            if !unique.contains(id) {
                unique.push(*id);
            }
        }
        Self {
            variables: session.variables.iter().map(describe).collect(),
            parameters: session.parameters.iter().map(describe).collect(),
            value,
            outputs,
            unique,
        }
    }

    fn inputs(&self) -> Vec<TensorId> {
        let inputs = self.variables.iter().chain(&self.parameters);
        inputs.map(|t| t.id).collect()
    }
}

/// Symbols for the inputs, without values: a function that reads data fails to trace instead of
/// freezing the data into the graph.
fn open(device: &Device, dtype: DType, variables: &[Value], parameters: &[Value]) -> Session {
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
    let session = Session {
        device: device.clone(),
        variables: variables.iter().map(symbol).collect(),
        parameters: parameters.iter().map(symbol).collect(),
    };
    let inputs = session.variables.iter().chain(&session.parameters);
    client.register_op(OperationIr::Custom(CustomOpIr {
        id: INPUTS.to_owned(),
        inputs: inputs.map(|symbol| symbol.clone().into_ir()).collect(),
        outputs: Vec::new(),
        scalars: Vec::new(),
    }));
    session
}

/// Number the tensors of a captured graph from zero: variables, parameters, constants, the rest.
fn build(
    mut operations: Vec<OperationIr>,
    values: impl IntoIterator<Item = (TensorId, TensorData)>,
    ids: &Ids,
) -> Graph {
    operations.retain(|operation| match operation {
        OperationIr::Init(_) | OperationIr::Drop(_) => false,
        OperationIr::Custom(custom) => custom.id != INPUTS,
        _ => true,
    });
    let mut numbers: HashMap<TensorId, TensorIr> = HashMap::new();
    let mut next = 0;
    let mut number = |old: TensorId, shape: &Shape, dtype: DType| {
        let new = tensor(next, shape.clone(), dtype);
        next += 1;
        numbers.insert(old, new.clone());
        new
    };
    let mut renamed = |t: &TensorIr| number(t.id, &t.shape, t.dtype);
    let variables: Vec<TensorIr> = ids.variables.iter().map(&mut renamed).collect();
    let parameters = ids.parameters.iter().map(&mut renamed).collect();
    let constants = values
        .into_iter()
        .map(|(id, data)| (number(id, data.shape(), data.dtype()), data))
        .collect();
    for out in operations.iter().flat_map(OperationIr::outputs) {
        number(out.id, &out.shape, out.dtype);
    }
    let outputs = ids
        .outputs
        .iter()
        .zip(variables.iter().map(Some).chain(std::iter::repeat(None)))
        .map(|(id, variable)| match (id, variable) {
            (Some(id), _) => numbers[id].clone(),
            // A variable that the energy does not depend on.
            (None, variable) => {
                let like = variable.expect("only gradients are absent, one per variable");
                let out = tensor(next, like.shape.clone(), like.dtype);
                next += 1;
                operations.push(OperationIr::BaseFloat(Base::Zeros(CreationOpIr {
                    out: out.clone(),
                })));
                numbers.insert(out.id, out.clone());
                out
            }
        })
        .collect();
    precision::restore_reciprocals(&mut operations);
    for operation in &mut operations {
        rename(operation, &numbers);
    }
    Graph {
        value: numbers[&ids.value].clone(),
        operations,
        sources: Sources {
            variables,
            parameters,
            constants,
        },
        outputs,
    }
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
