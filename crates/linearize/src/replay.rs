//! Running programs on a backend.

use burn::backend::ir::{BackendIr, HandleKind, OperationIr, TensorIr};
use burn::backend::{
    BackendTensor, BackendTypes, DispatchDevice, DispatchKindConversion, DispatchTensor,
    TensorMetadata,
};
use burn::tensor::Device;
use burn_router::TensorInterpreter;

use crate::extensions::CustomOpRegistry;
use crate::program::Block;
use crate::{Error, Extensions, Program, Value};

/// What the primal program computes at a point.
#[derive(Clone, Debug)]
pub struct Evaluation {
    /// The energy, shape `[1]`, or the first output of a traced function.
    pub value: Value,
    /// The gradient with respect to each variable, or all outputs of a traced function.
    pub gradients: Vec<Value>,
}

/// A program loaded on a device: evaluates a function, its gradient, and its Hessian.
///
/// It can move between threads, and several can run at once.
pub struct Linearization {
    program: Program,
    interpreter: Interpreter,
    evaluated: bool,
}

enum Interpreter {
    #[cfg(feature = "flex")]
    Flex(Box<TensorInterpreter<burn::backend::Flex>>),
    #[cfg(feature = "ndarray")]
    #[allow(
        deprecated,
        reason = "burn deprecates the backend, which we still offer"
    )]
    NdArray(Box<TensorInterpreter<burn::backend::NdArray>>),
    #[cfg(any(feature = "wgpu", feature = "cuda"))]
    Cube(Box<TensorInterpreter<burn::backend::Cube>>),
}

/// Run `$body` with the interpreter of whichever backend.
macro_rules! on_backend {
    ($self:ident, $interpreter:ident => $body:expr) => {
        match &mut $self.interpreter {
            #[cfg(feature = "flex")]
            Interpreter::Flex($interpreter) => $body,
            #[cfg(feature = "ndarray")]
            Interpreter::NdArray($interpreter) => $body,
            #[cfg(any(feature = "wgpu", feature = "cuda"))]
            Interpreter::Cube($interpreter) => $body,
        }
    };
}

impl Program {
    /// Load the programs onto a device.
    ///
    /// # Errors
    /// [`Error::NoHandler`] if a custom operation has no handler on the device's backend,
    /// [`Error::Device`] if that backend is not compiled in.
    pub fn on(&self, device: &Device, extensions: &Extensions) -> Result<Linearization, Error> {
        Linearization::new(self, device, extensions)
    }
}

impl Linearization {
    fn new(program: &Program, device: &Device, extensions: &Extensions) -> Result<Self, Error> {
        let program = &if extensions.fuses_on(device) {
            program.fused()
        } else {
            program.clone()
        };
        #[allow(unreachable_patterns, reason = "depends on the compiled backends")]
        let interpreter = match device.as_dispatch() {
            #[cfg(feature = "flex")]
            DispatchDevice::Flex(device) => {
                Interpreter::Flex(load(program, "flex", device, &extensions.flex)?)
            }
            #[cfg(feature = "ndarray")]
            DispatchDevice::NdArray(device) => {
                Interpreter::NdArray(load(program, "ndarray", device, &extensions.ndarray)?)
            }
            #[cfg(any(feature = "wgpu", feature = "cuda"))]
            DispatchDevice::Cube(device) => {
                Interpreter::Cube(load(program, "cube", device, &extensions.cube)?)
            }
            other => {
                return Err(Error::Device {
                    device: format!("{other:?}"),
                });
            }
        };
        Ok(Self {
            program: program.clone(),
            interpreter,
            evaluated: false,
        })
    }

    /// The program that is loaded, with elementwise operations gathered if the backend has a handler for that.
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// The energy (or first output) alone, without what only the gradient needs. The point of the
    /// last [`at`](Self::at) stays.
    ///
    /// # Errors
    /// If the inputs do not have the number, shapes and element types they were traced with, or
    /// live on another backend.
    pub fn value(&mut self, variables: &[Value], parameters: &[Value]) -> Result<Value, Error> {
        self.check_inputs(variables, parameters)?;
        let block = &self.program.value;
        let inputs = named("variable", variables).chain(named("parameter", parameters));
        let mut outputs = on_backend!(self, it => run(it, block, inputs))?;
        outputs.pop().ok_or(Error::NoOutputs)
    }

    /// Evaluate the function at a point, which the following calls of [`apply`](Self::apply) refer
    /// to. The previous point is forgotten.
    ///
    /// # Errors
    /// If the inputs do not have the number, shapes and element types they were traced with, or
    /// live on another backend.
    pub fn at(&mut self, variables: &[Value], parameters: &[Value]) -> Result<Evaluation, Error> {
        self.check_inputs(variables, parameters)?;
        self.forget();
        let block = &self.program.primal;
        let inputs = named("variable", variables).chain(named("parameter", parameters));
        let mut outputs = on_backend!(self, it => run(it, block, inputs))?.into_iter();
        self.evaluated = true;
        Ok(Evaluation {
            value: outputs.next().ok_or(Error::NoOutputs)?,
            gradients: outputs.collect(),
        })
    }

    /// Apply the linearization at the point of [`at`](Self::at) to a direction, one tensor per
    /// variable: the Hessian-vector product, or the Jacobian-vector product of a traced function.
    ///
    /// # Errors
    /// [`Error::NotEvaluated`] before the first [`at`](Self::at), and as there for the directions.
    pub fn apply(&mut self, directions: &[Value]) -> Result<Vec<Value>, Error> {
        if !self.evaluated {
            return Err(Error::NotEvaluated);
        }
        check(
            ("directions", "direction"),
            &self.program.directions,
            directions,
        )?;
        let block = &self.program.tangent;
        let inputs = named("direction", directions);
        on_backend!(self, it => run(it, block, inputs))
    }

    /// Free what [`at`](Self::at) keeps for [`apply`](Self::apply).
    pub fn forget(&mut self) {
        if !self.evaluated {
            return;
        }
        self.evaluated = false;
        let saved = &self.program.saved;
        on_backend!(self, it => for t in saved {
            it.register_op(OperationIr::Drop(t.clone()));
        });
    }

    fn check_inputs(&self, variables: &[Value], parameters: &[Value]) -> Result<(), Error> {
        let sources = &self.program.sources;
        check(("variables", "variable"), &sources.variables, variables)?;
        check(("parameters", "parameter"), &sources.parameters, parameters)
    }
}

/// What an input is called in messages.
type Named<'a> = (&'static str, usize, &'a Value);

fn named<'a>(role: &'static str, values: &'a [Value]) -> impl Iterator<Item = Named<'a>> {
    let indexed = values.iter().enumerate();
    indexed.map(move |(index, value)| (role, index, value))
}

fn check(
    (plural, role): (&'static str, &'static str),
    expected: &[TensorIr],
    found: &[Value],
) -> Result<(), Error> {
    if expected.len() != found.len() {
        return Err(Error::Count {
            role: plural,
            expected: expected.len(),
            found: found.len(),
        });
    }
    for (index, (expected, found)) in expected.iter().zip(found).enumerate() {
        let shape = found.0.shape();
        if expected.shape != shape {
            return Err(Error::Shape {
                role,
                index,
                expected: expected.shape.to_vec(),
                found: shape.to_vec(),
            });
        }
        if expected.dtype != found.dtype() {
            return Err(Error::DType {
                role,
                index,
                expected: expected.dtype,
                found: found.dtype(),
            });
        }
    }
    Ok(())
}

/// An interpreter with the constants of the program in place.
fn load<B: BackendIr>(
    program: &Program,
    backend: &'static str,
    device: &<B as BackendTypes>::Device,
    registry: &CustomOpRegistry<B>,
) -> Result<Box<TensorInterpreter<B>>, Error> {
    if let Some(missing) = program
        .custom_operations()
        .find(|id| !registry.known.contains(*id))
    {
        return Err(Error::NoHandler {
            operation: missing.to_owned(),
            backend,
        });
    }
    let mut it = TensorInterpreter::with_custom_ops(device.clone(), registry.handlers.clone());
    for (t, data) in &program.sources.constants {
        it.register_tensor_data_id(t.id, data.clone());
    }
    for operation in &program.constant {
        it.register_op(operation.clone());
    }
    Ok(Box::new(it))
}

fn run<'a, B: BackendIr>(
    it: &mut TensorInterpreter<B>,
    block: &Block,
    inputs: impl Iterator<Item = Named<'a>>,
) -> Result<Vec<Value>, Error>
where
    DispatchTensor: DispatchKindConversion<B>,
{
    for (id, (role, index, value)) in block.inputs.iter().zip(inputs) {
        let Some(id) = id else { continue };
        let primitive =
            <DispatchTensor as DispatchKindConversion<B>>::try_into_backend(value.0.clone())
                .map_err(|reason| Error::Backend {
                    role,
                    index,
                    reason,
                })?;
        it.register_tensor_to_device(*id, HandleKind::Float(primitive.float()));
    }
    for operation in &block.operations {
        it.register_op(operation.clone());
    }
    Ok(block
        .outputs
        .iter()
        .map(|out| {
            let HandleKind::Float(tensor) = it.get_tensor(out) else {
                unreachable!("outputs of traced functions are float tensors")
            };
            Value(<DispatchTensor as DispatchKindConversion<B>>::from_backend(
                BackendTensor::Float(tensor),
            ))
        })
        .collect())
}
