//! Fused elementwise operations.
#![expect(clippy::used_underscore_binding, reason = "the macro does it")]
#![expect(
    clippy::needless_pass_by_value,
    reason = "kernels take what they are compiled for by value"
)]

use burn_backend::TensorMetadata;
use burn_backend::cubecl::dtype_to_storage_type;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;
use linearize::{Arithmetic, Elementwise, Instruction, Output, Right};

use super::launch::{like, threads_for, values};

/// A kernel is compiled once for each of these; the numbers of a program are arguments.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Form {
    /// For every input, whether its one value stands for all entries.
    single: Vec<bool>,
    steps: Vec<Step>,
    /// The operands that are returned.
    outputs: Vec<usize>,
}

/// An instruction with its operands, the right one among the numbers if so said.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Step {
    arithmetic: Arithmetic,
    left: usize,
    right: usize,
    by_number: bool,
}

impl Form {
    /// That of a program, and its numbers.
    fn of(program: &Elementwise, single: Vec<bool>) -> (Self, Vec<f64>) {
        let mut numbers = Vec::new();
        let step = |instruction: &Instruction| {
            let (by_number, right) = match instruction.right {
                Right::Operand(operand) => (false, operand),
                Right::Number(number) => {
                    numbers.push(number);
                    (true, numbers.len() - 1)
                }
            };
            Step {
                arithmetic: instruction.arithmetic,
                left: instruction.left,
                right,
                by_number,
            }
        };
        let steps = program.instructions.iter().map(step).collect();
        let operand = |output: &Output| match *output {
            Output::Values(operand) | Output::Sum(operand) => operand,
        };
        let outputs = program.outputs.iter().map(operand).collect();
        let form = Self {
            single,
            steps,
            outputs,
        };
        (form, numbers)
    }
}

/// The entries of all outputs of a program, also of those that are to be summed, in one launch.
pub(crate) fn elementwise(program: &Elementwise, inputs: Vec<CubeTensor>) -> Vec<CubeTensor> {
    let len = |x: &CubeTensor| x.shape().num_elements();
    let longest = inputs.iter().max_by_key(|x| len(x));
    let longest = longest.expect("a program has inputs").clone();
    let (form, numbers) = Form::of(program, inputs.iter().map(|x| len(x) == 1).collect());
    let (client, dtype) = (&longest.client, longest.dtype);
    let bindings = client.properties().hardware.max_bindings as usize;
    assert!(
        inputs.len() + form.outputs.len() < bindings,
        "the device takes {bindings} buffers"
    );
    let results: Vec<_> = form.outputs.iter().map(|_| like(&longest)).collect();
    let element = dtype_to_storage_type(dtype);
    let (mut from, mut to, mut with) = (SequenceArg::new(), SequenceArg::new(), SequenceArg::new());
    for x in inputs {
        from.push(values(x, dtype));
    }
    for x in &results {
        to.push(values(x.clone(), dtype));
    }
    for number in numbers {
        with.push(InputScalar::new(number, element));
    }
    let (count, threads) = threads_for(client, len(&longest));
    entrywise::launch(
        client,
        count,
        threads,
        from,
        to,
        with,
        len(&longest),
        form,
        element,
    );
    results
}

#[cube(launch)]
fn entrywise<E: Float>(
    inputs: &Sequence<Box<[E]>>,
    results: &mut Sequence<Box<[E]>>,
    numbers: &Sequence<InputScalar>,
    len: usize,
    #[comptime] form: Form,
    #[define(E)] _dtype: ElemType,
) {
    let entry = ABSOLUTE_POS;
    if entry >= len {
        terminate!();
    }
    // The operands so far.
    let mut operands = Sequence::<E>::new();
    #[unroll]
    for i in 0..comptime!(form.single.len()) {
        let input = inputs.index(i);
        if comptime!(form.single[i]) {
            operands.push(input[0]);
        } else {
            operands.push(input[entry]);
        }
    }
    #[unroll]
    for i in 0..comptime!(form.steps.len()) {
        let step = comptime!(form.steps[i]);
        let left = *operands.index(comptime!(step.left));
        let right = if comptime!(step.by_number) {
            numbers.index(comptime!(step.right)).get::<E>()
        } else {
            *operands.index(comptime!(step.right))
        };
        operands.push(computed::<E>(left, right, comptime!(step.arithmetic)));
    }
    #[unroll]
    for i in 0..comptime!(form.outputs.len()) {
        let result = results.index_mut(i);
        result[entry] = *operands.index(comptime!(form.outputs[i]));
    }
}

#[cube]
fn computed<E: Float>(left: E, right: E, #[comptime] arithmetic: Arithmetic) -> E {
    match comptime!(arithmetic) {
        Arithmetic::Add => left + right,
        Arithmetic::Sub => left - right,
        Arithmetic::Mul => left * right,
        Arithmetic::Div => left / right,
    }
}
