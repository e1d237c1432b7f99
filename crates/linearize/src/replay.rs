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
    run: Box<Run>,
    evaluated: bool,
}

/// Runs a block on its inputs, and takes its outputs: Burn's interpreter on whichever backend.
type Run = dyn FnMut(&Block, &[Named]) -> Result<Vec<Value>, Error> + Send;

/// An input, and what it is called in messages.
type Named<'a> = (&'static str, usize, &'a Value);

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
        let point = self.point(variables, parameters)?;
        let mut outputs = (self.run)(&self.program.value, &point)?;
        outputs.pop().ok_or(Error::NoOutputs)
    }

    /// Evaluate the function at a point, which the following calls of [`apply`](Self::apply) refer
    /// to. The previous point is forgotten.
    ///
    /// # Errors
    /// If the inputs do not have the number, shapes and element types they were traced with, or
    /// live on another backend.
    pub fn at(&mut self, variables: &[Value], parameters: &[Value]) -> Result<Evaluation, Error> {
        let point = self.point(variables, parameters)?;
        self.forget();
        let mut outputs = (self.run)(&self.program.primal, &point)?.into_iter();
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
        let directions = checked("direction", &self.program.directions, directions)?;
        (self.run)(&self.program.tangent, &directions)
    }

    /// Free what [`at`](Self::at) keeps for [`apply`](Self::apply).
    pub fn forget(&mut self) {
        if !self.evaluated {
            return;
        }
        self.evaluated = false;
        let saved = self.program.saved.iter().cloned();
        let freeing = Block {
            inputs: Vec::new(),
            operations: saved.map(OperationIr::Drop).collect(),
            outputs: Vec::new(),
        };
        (self.run)(&freeing, &[]).expect("it has no inputs");
    }

    fn point<'a>(
        &self,
        variables: &'a [Value],
        parameters: &'a [Value],
    ) -> Result<Vec<Named<'a>>, Error> {
        let sources = &self.program.sources;
        let mut inputs = checked("variable", &sources.variables, variables)?;
        inputs.extend(checked("parameter", &sources.parameters, parameters)?);
        Ok(inputs)
    }
}

/// The values with their names, if they have the expected number, shapes and element types.
fn checked<'a>(
    role: &'static str,
    expected: &[TensorIr],
    found: &'a [Value],
) -> Result<Vec<Named<'a>>, Error> {
    if expected.len() != found.len() {
        return Err(Error::Input {
            input: format!("{role}s"),
            expected: expected.len().to_string(),
            found: found.len().to_string(),
        });
    }
    let indexed = expected.iter().zip(found).enumerate();
    indexed
        .map(|(index, (expected, value))| {
            let (shape, dtype) = (value.0.shape(), value.dtype());
            if (&expected.shape, expected.dtype) == (&shape, dtype) {
                return Ok((role, index, value));
            }
            Err(Error::Input {
                input: format!("{role} {index}"),
                expected: format!("{:?} of {:?}", expected.shape.to_vec(), expected.dtype),
                found: format!("{:?} of {dtype:?}", shape.to_vec()),
            })
        })
        .collect()
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
    let mut program = if registry.known.contains(ELEMENTWISE) {
        program.fused()
    } else {
        program.clone()
    };
    let mut it = TensorInterpreter::with_custom_ops(device.clone(), registry.handlers.clone());
    // Constants can be as large as fields: they are kept once.
    for (t, data) in std::mem::take(&mut program.sources.constants) {
        it.register_tensor_data_id(t.id, data);
    }
    for operation in &program.constant {
        it.register_op(operation.clone());
    }
    Ok(Linearization {
        program,
        run: Box::new(move |block, inputs| run(&mut it, block, inputs)),
        evaluated: false,
    })
}

fn run<B: BackendIr>(
    it: &mut TensorInterpreter<B>,
    block: &Block,
    inputs: &[Named],
) -> Result<Vec<Value>, Error>
where
    DispatchTensor: DispatchKindConversion<B>,
{
    for (id, (role, index, value)) in block.inputs.iter().zip(inputs) {
        let Some(id) = id else { continue };
        let primitive: BackendTensor<B> = DispatchTensor::try_into_backend(value.0.clone())
            .map_err(|_| Error::Input {
                input: format!("{role} {index}"),
                expected: "the program's backend".to_owned(),
                found: format!("{:?}", value.0.device()),
            })?;
        it.register_tensor_to_device(*id, HandleKind::Float(primitive.float()));
    }
    for operation in &block.operations {
        it.register_op(operation.clone());
    }
    let output = |out| {
        let HandleKind::Float(tensor) = it.get_tensor(out) else {
            unreachable!("outputs of traced functions are float tensors")
        };
        Value(DispatchTensor::from_backend(BackendTensor::<B>::Float(
            tensor,
        )))
    };
    Ok(block.outputs.iter().map(output).collect())
}
