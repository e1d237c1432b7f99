//! Gathered elementwise operations on the host: one pass over memory, on all cores.
//!
//! Entries are worked on in blocks that stay in the fastest cache, instruction by instruction.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions that were detected"
)]

use std::borrow::Cow;
use std::mem::MaybeUninit;

use burn_backend::{DType, Shape, TensorData};
use linearize::{Arithmetic, CustomOpIr, Elementwise, Instruction, Output, Right};
use pulp::Arch;
use rayon::prelude::*;

use crate::fft::{Real, is_f64};
use crate::fresh::{PARALLEL_FROM, room, zeroed};
use crate::slices::Sum;

/// Bytes of a block of entries: a dozen of intermediate results fit into the first-level cache.
const BLOCK: usize = 1 << 11;
/// Entries whose sum is taken by itself.
const SUMMED: usize = 1 << 10;
/// Entries per task; sums are taken in this order whatever the number of threads.
const CHUNK: usize = 1 << 14;

/// Values in either precision.
#[derive(Debug, PartialEq)]
pub(crate) enum Values {
    Double(Vec<f64>),
    Single(Vec<f32>),
}

/// The part of an output that belongs to a task: of memory that was an input's, or new.
enum Piece<'a> {
    Double(Part<'a, f64>),
    Single(Part<'a, f32>),
}

enum Part<'a, T> {
    Reused(&'a mut [T]),
    New(&'a mut [MaybeUninit<T>]),
}

impl<'a, T: Real> Part<'a, T> {
    fn all(values: &'a mut Vec<T>, len: usize) -> Vec<Self> {
        if values.is_empty() {
            let pieces = room(values, len).chunks_mut(CHUNK);
            pieces.map(Self::New).collect()
        } else {
            values.chunks_mut(CHUNK).map(Self::Reused).collect()
        }
    }

    /// The entries of a block. New ones are zeros, written right before the block is, while it comes to the cache anyway.
    #[inline(always)]
    fn block(&mut self, start: usize, size: usize) -> &mut [T] {
        match self {
            Self::Reused(entries) => &mut entries[start..][..size],
            Self::New(piece) => zeroed(&mut piece[start..][..size]),
        }
    }
}

impl Values {
    /// Without any, for the values of an output.
    fn none(dtype: DType) -> Self {
        match dtype {
            DType::F32 => Self::Single(Vec::new()),
            _ => Self::Double(Vec::new()),
        }
    }

    fn of<T: Real>(values: Vec<T>) -> Self {
        if is_f64::<T>() {
            Self::Double(bytemuck::allocation::cast_vec(values))
        } else {
            Self::Single(bytemuck::allocation::cast_vec(values))
        }
    }

    pub(crate) fn into_data(self, shape: Shape) -> TensorData {
        match self {
            Self::Double(values) => TensorData::new(values, shape),
            Self::Single(values) => TensorData::new(values, shape),
        }
    }

    /// The pieces of this many entries: those that are here, or room for them.
    fn pieces(&mut self, len: usize) -> Vec<Piece<'_>> {
        match self {
            Self::Double(x) => Part::all(x, len).into_iter().map(Piece::Double).collect(),
            Self::Single(x) => Part::all(x, len).into_iter().map(Piece::Single).collect(),
        }
    }

    /// Takes what was written to the room for its entries.
    ///
    /// # Safety
    /// All [pieces](Self::pieces) of so many entries were written.
    #[allow(unsafe_code, reason = "the standard library has no safe way")]
    unsafe fn take_room(&mut self, len: usize) {
        // SAFETY: the caller's.
        unsafe {
            match self {
                Self::Double(x) => x.set_len(len),
                Self::Single(x) => x.set_len(len),
            }
        }
    }
}

impl Piece<'_> {
    /// The entries of a block, which have the type of the program.
    #[inline(always)]
    fn entries<T: Real>(&mut self, start: usize, size: usize) -> &mut [T] {
        match self {
            Self::Double(x) => bytemuck::cast_slice_mut(x.block(start, size)),
            Self::Single(x) => bytemuck::cast_slice_mut(x.block(start, size)),
        }
    }

    /// Reads a block of what was an input's.
    #[inline(always)]
    fn read<T: Real>(&mut self, start: usize, block: &mut [T]) {
        match self {
            Self::Double(x) => convert(x.block(start, block.len()), block),
            Self::Single(x) => convert(x.block(start, block.len()), block),
        }
    }

    #[inline(always)]
    fn write<T: Real>(&mut self, start: usize, block: &[T]) {
        match self {
            Self::Double(x) => convert(block, x.block(start, block.len())),
            Self::Single(x) => convert(block, x.block(start, block.len())),
        }
    }
}

/// Copies entries, rounded if needed.
#[inline(always)]
fn convert<A: Real, B: Real>(from: &[A], to: &mut [B]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = B::of(from.double());
    }
}

/// Where the entries of an input are while a task runs.
enum Source<'a, T: Clone> {
    Entries(Cow<'a, [T]>),
    /// One value for all entries.
    Single(T),
    /// In the memory of an output.
    Reused(usize),
}

/// Runs the program of an operation on its inputs. The memory of those that it owns is used for results.
pub(crate) fn run_operation<T: Real>(
    operation: &CustomOpIr,
    inputs: Vec<Cow<'_, [T]>>,
) -> Vec<Values> {
    let dtypes: Vec<DType> = operation.outputs.iter().map(|out| out.dtype).collect();
    run(&Elementwise::of(operation), inputs, &dtypes)
}

/// Runs a program; `dtypes` are the float types of its outputs.
fn run<'a, T: Real>(
    program: &Elementwise,
    inputs: Vec<Cow<'a, [T]>>,
    dtypes: &[DType],
) -> Vec<Values> {
    let len = inputs.iter().map(|input| input.len()).max().unwrap_or(0);
    let own = own_type::<T>();
    // Outputs that can take over the memory of an input do.
    let mut results: Vec<Option<Values>> = dtypes.iter().map(|_| None).collect();
    let mut free: Vec<usize> = (program.outputs.iter().zip(dtypes).enumerate())
        .filter(|(_, (output, dtype))| matches!(output, Output::Values(_)) && **dtype == own)
        .map(|(i, _)| i)
        .rev()
        .collect();
    let source = |input: Cow<'a, [T]>| match input {
        single if single.len() == 1 && len > 1 => Source::Single(single[0]),
        Cow::Owned(values) if !free.is_empty() => {
            let output = free.pop().expect("it is not empty");
            results[output] = Some(Values::of(values));
            Source::Reused(output)
        }
        entries => Source::Entries(entries),
    };
    let sources: Vec<Source<T>> = inputs.into_iter().map(source).collect();
    let mut results: Vec<Values> = (results.into_iter().zip(&program.outputs).zip(dtypes))
        .map(|((reused, output), dtype)| match (reused, output) {
            (Some(values), _) => values,
            (None, Output::Values(_)) => Values::none(*dtype),
            (None, Output::Sum(_)) => Values::none(DType::F64),
        })
        .collect();
    // One task per chunk, with its part of every output.
    let count = len.div_ceil(CHUNK);
    let mut tasks: Vec<Vec<Option<Piece>>> = (0..count).map(|_| Vec::new()).collect();
    for (result, output) in results.iter_mut().zip(&program.outputs) {
        let pieces = match output {
            Output::Values(_) => result.pieces(len),
            Output::Sum(_) => Vec::new(),
        };
        let mut pieces = pieces.into_iter();
        for task in &mut tasks {
            task.push(pieces.next());
        }
    }
    let machine = Machine::new(program, sources, dtypes);
    let arch = Arch::new();
    let work = |(chunk, pieces): (usize, Vec<Option<Piece>>)| {
        let (start, mut targets) = (chunk * CHUNK, pieces);
        arch.dispatch(|| machine.run(start..len.min(start + CHUNK), &mut targets))
    };
    let sums: Vec<Vec<f64>> = if len < PARALLEL_FROM {
        tasks.into_iter().enumerate().map(work).collect()
    } else {
        tasks.into_par_iter().enumerate().map(work).collect()
    };
    for (i, (output, dtype)) in program.outputs.iter().zip(dtypes).enumerate() {
        match output {
            Output::Sum(_) => {
                let total: f64 = sums.iter().map(|sums| sums[i]).sum();
                results[i] = match dtype {
                    DType::F32 => Values::Single(vec![total as f32]),
                    _ => Values::Double(vec![total]),
                };
            }
            #[allow(unsafe_code, reason = "as it says")]
            // SAFETY: each task writes all blocks of its pieces.
            Output::Values(_) => unsafe { results[i].take_room(len) },
        }
    }
    results
}

struct Machine<'a, T: Clone> {
    program: &'a Elementwise,
    sources: Vec<Source<'a, T>>,
    /// The output into which an instruction computes, if nothing else reads its result.
    direct: Vec<Option<usize>>,
}

impl<'a, T: Real> Machine<'a, T> {
    fn new(program: &'a Elementwise, sources: Vec<Source<'a, T>>, dtypes: &[DType]) -> Self {
        let own = own_type::<T>();
        let reused = |output: usize| {
            let mut sources = sources.iter();
            sources.any(|source| matches!(source, Source::Reused(other) if *other == output))
        };
        let direct = |number: usize| {
            let result = sources.len() + number;
            let instructions = program.instructions.iter();
            let reads = instructions.map(|instruction| {
                let right = matches!(instruction.right, Right::Operand(right) if right == result);
                usize::from(instruction.left == result || right)
            });
            let of = |output: &Output| match *output {
                Output::Values(operand) | Output::Sum(operand) => operand == result,
            };
            let mut outputs = (program.outputs.iter().enumerate()).filter(|(_, output)| of(output));
            let (output, kind) = outputs.next()?;
            let alone = outputs.next().is_none() && reads.sum::<usize>() == 0;
            let is_values = matches!(kind, Output::Values(_)) && dtypes[output] == own;
            (alone && is_values && !reused(output)).then_some(output)
        };
        Self {
            direct: (0..program.instructions.len()).map(direct).collect(),
            program,
            sources,
        }
    }
}

/// The float type of a program.
fn own_type<T: Real>() -> DType {
    if is_f64::<T>() {
        DType::F64
    } else {
        DType::F32
    }
}

impl<T: Real> Machine<'_, T> {
    /// Runs the program on some entries; returns the sums by output, zero for other outputs.
    #[inline(always)]
    fn run(&self, entries: std::ops::Range<usize>, targets: &mut [Option<Piece>]) -> Vec<f64> {
        let inputs = self.sources.len();
        let block = (BLOCK / size_of::<T>()).min(entries.len());
        let mut registers = vec![T::zero(); (inputs + self.program.instructions.len()) * block];
        for (register, source) in registers.chunks_mut(block).zip(&self.sources) {
            if let Source::Single(value) = source {
                register.fill(*value);
            }
        }
        let mut sums = vec![0.0; targets.len()];
        let mut parts = vec![Sum::default(); targets.len()];
        for start in entries.clone().step_by(block) {
            let size = block.min(entries.end - start);
            let within = start - entries.start;
            for (register, source) in registers.chunks_mut(block).zip(&self.sources) {
                if let Source::Reused(output) = source
                    && let Some(target) = &mut targets[*output]
                {
                    target.read(within, &mut register[..size]);
                }
            }
            for (number, instruction) in self.program.instructions.iter().enumerate() {
                let (before, rest) = registers.split_at_mut((inputs + number) * block);
                let operand = |i: usize| self.operand(i, before, block, start, size);
                let direct = self.direct[number].and_then(|output| targets[output].as_mut());
                let result = match direct {
                    Some(target) => target.entries(within, size),
                    None => &mut rest[..size],
                };
                compute(instruction, result, operand);
            }
            let ends = (within + size).is_multiple_of(SUMMED) || start + size == entries.end;
            let results = targets.iter_mut().zip(parts.iter_mut().zip(&mut sums));
            for (output, (target, (part, total))) in self.program.outputs.iter().zip(results) {
                match (output, target) {
                    (Output::Values(i), Some(target)) if !self.is_direct(*i) => {
                        target.write(within, self.operand(*i, &registers, block, start, size));
                    }
                    (Output::Sum(i), _) => {
                        part.add(self.operand(*i, &registers, block, start, size));
                        if ends {
                            *total += std::mem::take(part).total();
                        }
                    }
                    (Output::Values(_), _) => {}
                }
            }
        }
        sums
    }

    /// Whether an operand was computed into its output.
    fn is_direct(&self, operand: usize) -> bool {
        let instruction = operand.checked_sub(self.sources.len());
        instruction.is_some_and(|number| self.direct[number].is_some())
    }

    #[inline(always)]
    fn operand<'b>(
        &'b self,
        i: usize,
        registers: &'b [T],
        block: usize,
        start: usize,
        size: usize,
    ) -> &'b [T] {
        match self.sources.get(i) {
            Some(Source::Entries(values)) => &values[start..start + size],
            _ => &registers[i * block..][..size],
        }
    }
}

#[inline(always)]
fn compute<'a, T: Real>(
    instruction: &Instruction,
    result: &mut [T],
    operand: impl Fn(usize) -> &'a [T],
) {
    let Instruction {
        arithmetic,
        left,
        right,
    } = *instruction;
    // Two loops for each operation, so that each is compiled to vector instructions.
    macro_rules! each {
        ($x:ident $op:tt $y:ident) => {
            match right {
                Right::Operand(right) => {
                    let pairs = operand(left).iter().zip(operand(right));
                    for (r, (&$x, &$y)) in result.iter_mut().zip(pairs) {
                        *r = $x $op $y;
                    }
                }
                Right::Number(number) => {
                    let $y = T::of(number);
                    for (r, &$x) in result.iter_mut().zip(operand(left)) {
                        *r = $x $op $y;
                    }
                }
            }
        };
    }
    match arithmetic {
        Arithmetic::Add => each!(x + y),
        Arithmetic::Sub => each!(x - y),
        Arithmetic::Mul => each!(x * y),
        Arithmetic::Div => each!(x / y),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn instruction(arithmetic: Arithmetic, left: usize, right: Right) -> Instruction {
        Instruction {
            arithmetic,
            left,
            right,
        }
    }

    /// `(a + b s) / a` and its sum, and `b` in single precision.
    fn program() -> Elementwise {
        Elementwise {
            instructions: vec![
                instruction(Arithmetic::Mul, 1, Right::Operand(2)),
                instruction(Arithmetic::Add, 0, Right::Operand(3)),
                instruction(Arithmetic::Div, 4, Right::Operand(0)),
                instruction(Arithmetic::Mul, 5, Right::Number(2.0)),
            ],
            outputs: vec![Output::Values(5), Output::Sum(6), Output::Values(1)],
        }
    }

    fn vectors(len: usize) -> (Vec<f64>, Vec<f64>) {
        let wave = |a: f64| move |i: usize| 1.5 + (a * i as f64).sin();
        (
            (0..len).map(wave(0.3)).collect(),
            (0..len).map(wave(1.7)).collect(),
        )
    }

    #[test]
    fn every_length_and_every_owner_gives_the_same() {
        for len in [2, BLOCK / 8 - 1, SUMMED + 3, CHUNK, 3 * CHUNK + 17] {
            let (a, b) = vectors(len);
            let expected: Vec<f64> = a.iter().zip(&b).map(|(a, b)| (a + b * 0.25) / a).collect();
            let total: f64 = expected.iter().map(|x| 2.0 * x).sum();
            let single: Vec<f32> = b.iter().map(|&b| b as f32).collect();
            for given in [false, true] {
                let operand = |x: &'static [f64]| {
                    if given {
                        Cow::Owned(x.to_vec())
                    } else {
                        Cow::Borrowed(x)
                    }
                };
                let leak = |x: &[f64]| -> &'static [f64] { Vec::leak(x.to_vec()) };
                let operands = vec![operand(leak(&a)), operand(leak(&b)), operand(leak(&[0.25]))];
                let dtypes = [DType::F64, DType::F64, DType::F32];
                let results = run(&program(), operands, &dtypes);
                assert_eq!(
                    results[0],
                    Values::Double(expected.clone()),
                    "{len} {given}"
                );
                assert_eq!(results[2], Values::Single(single.clone()), "{len} {given}");
                let Values::Double(sum) = &results[1] else {
                    panic!("the sum has the wrong precision");
                };
                assert!((sum[0] - total).abs() < 1e-12 * total, "{} {total}", sum[0]);
            }
        }
    }

    #[test]
    fn results_do_not_depend_on_the_number_of_threads() {
        let (a, b) = vectors(5 * CHUNK);
        let a: Vec<f32> = a.iter().map(|&a| a as f32).collect();
        let b: Vec<f32> = b.iter().map(|&b| b as f32).collect();
        let results = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let operands = vec![
                Cow::Borrowed(&a[..]),
                Cow::Borrowed(&b[..]),
                Cow::Borrowed(&[0.5]),
            ];
            let types = [DType::F32, DType::F32, DType::F64];
            (pool.build().unwrap()).install(|| run(&program(), operands, &types))
        };
        assert_eq!(results(1), results(3));
    }
}
