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
use crate::{ELEMENTWISE, Error, Extensions, Program, Value};

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
    interpreter: Box<dyn Interpreter>,
    evaluated: bool,
}

impl Program {
    /// Load the programs onto a device.
    ///
    /// # Errors
    /// [`Error::NoHandler`] if a custom operation has no handler on the device's backend,
    /// [`Error::Device`] if that backend is not compiled in.
    pub fn on(&self, device: &Device, extensions: &Extensions) -> Result<Linearization, Error> {
        #[allow(unreachable_patterns, reason = "depends on the compiled backends")]
        match device.as_dispatch() {
            #[cfg(feature = "flex")]
            DispatchDevice::Flex(device) => load(self, "flex", device, &extensions.flex),
            #[cfg(feature = "ndarray")]
            DispatchDevice::NdArray(device) => load(self, "ndarray", device, &extensions.ndarray),
            #[cfg(any(feature = "wgpu", feature = "cuda"))]
            DispatchDevice::Cube(device) => load(self, "cube", device, &extensions.cube),
            other => Err(Error::Device {
                device: format!("{other:?}"),
            }),
        }
    }
}

impl Linearization {
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
        let mut inputs = named("variable", variables).chain(named("parameter", parameters));
        let mut outputs = self.interpreter.run(&self.program.value, &mut inputs)?;
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
        let mut inputs = named("variable", variables).chain(named("parameter", parameters));
        let outputs = self.interpreter.run(&self.program.primal, &mut inputs)?;
        let mut outputs = outputs.into_iter();
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
        check("direction", &self.program.directions, directions)?;
        let mut inputs = named("direction", directions);
        self.interpreter.run(&self.program.tangent, &mut inputs)
    }

    /// Free what [`at`](Self::at) keeps for [`apply`](Self::apply).
    pub fn forget(&mut self) {
        if !self.evaluated {
            return;
        }
        self.evaluated = false;
        self.interpreter.free(&self.program.saved);
    }

    fn check_inputs(&self, variables: &[Value], parameters: &[Value]) -> Result<(), Error> {
        let sources = &self.program.sources;
        check("variable", &sources.variables, variables)?;
        check("parameter", &sources.parameters, parameters)
    }
}

/// What an input is called in messages.
type Named<'a> = (&'static str, usize, &'a Value);

fn named<'a>(role: &'static str, values: &'a [Value]) -> impl Iterator<Item = Named<'a>> {
    let indexed = values.iter().enumerate();
    indexed.map(move |(index, value)| (role, index, value))
}

fn check(role: &'static str, expected: &[TensorIr], found: &[Value]) -> Result<(), Error> {
    if expected.len() != found.len() {
        return Err(Error::Input {
            input: format!("{role}s"),
            expected: expected.len().to_string(),
            found: found.len().to_string(),
        });
    }
    for (expected, (role, index, found)) in expected.iter().zip(named(role, found)) {
        let (shape, dtype) = (found.0.shape(), found.dtype());
        if (&expected.shape, expected.dtype) != (&shape, dtype) {
            return Err(Error::Input {
                input: format!("{role} {index}"),
                expected: format!("{:?} of {:?}", expected.shape.to_vec(), expected.dtype),
                found: format!("{:?} of {dtype:?}", shape.to_vec()),
            });
        }
    }
    Ok(())
}

/// A program on a backend, with its constants in place.
fn load<B: BackendIr + 'static>(
    program: &Program,
    backend: &'static str,
    device: &<B as BackendTypes>::Device,
    registry: &CustomOpRegistry<B>,
) -> Result<Linearization, Error>
where
    DispatchTensor: DispatchKindConversion<B>,
{
    if let Some(missing) = program
        .custom_operations()
        .find(|id| !registry.known.contains(*id))
    {
        return Err(Error::NoHandler {
            operation: missing.to_owned(),
            backend,
        });
    }
    let program = if registry.known.contains(ELEMENTWISE) {
        program.fused()
    } else {
        program.clone()
    };
    let mut it = TensorInterpreter::with_custom_ops(device.clone(), registry.handlers.clone());
    for (t, data) in &program.sources.constants {
        it.register_tensor_data_id(t.id, data.clone());
    }
    for operation in &program.constant {
        it.register_op(operation.clone());
    }
    Ok(Linearization {
        program,
        interpreter: Box::new(it),
        evaluated: false,
    })
}

/// Burn's interpreter on whichever backend.
trait Interpreter: Send {
    /// Runs a block on its inputs, and takes its outputs.
    fn run(
        &mut self,
        block: &Block,
        inputs: &mut dyn Iterator<Item = Named<'_>>,
    ) -> Result<Vec<Value>, Error>;

    /// Frees tensors.
    fn free(&mut self, tensors: &[TensorIr]);
}

impl<B: BackendIr> Interpreter for TensorInterpreter<B>
where
    DispatchTensor: DispatchKindConversion<B>,
{
    fn run(
        &mut self,
        block: &Block,
        inputs: &mut dyn Iterator<Item = Named<'_>>,
    ) -> Result<Vec<Value>, Error> {
        for (id, (role, index, value)) in block.inputs.iter().zip(inputs) {
            let Some(id) = id else { continue };
            let primitive =
                <DispatchTensor as DispatchKindConversion<B>>::try_into_backend(value.0.clone())
                    .map_err(|_| Error::Input {
                        input: format!("{role} {index}"),
                        expected: "the program's backend".to_owned(),
                        found: format!("{:?}", value.0.device()),
                    })?;
            self.register_tensor_to_device(*id, HandleKind::Float(primitive.float()));
        }
        for operation in &block.operations {
            self.register_op(operation.clone());
        }
        let output = |out| {
            let HandleKind::Float(tensor) = self.get_tensor(out) else {
                unreachable!("outputs of traced functions are float tensors")
            };
            let tensor = BackendTensor::Float(tensor);
            Value(<DispatchTensor as DispatchKindConversion<B>>::from_backend(
                tensor,
            ))
        };
        Ok(block.outputs.iter().map(output).collect())
    }

    fn free(&mut self, tensors: &[TensorIr]) {
        for t in tensors {
            self.register_op(OperationIr::Drop(t.clone()));
        }
    }
}
