//! Elementwise operations that run as one: a single pass over memory instead of one each.
//!
//! Burn's CPU backends run every elementwise operation as a pass of its own, on one core. Where a backend's
//! [registry](crate::CustomOpRegistry) has a handler for [`ELEMENTWISE`], programs are loaded with their elementwise
//! operations gathered into few custom operations, each an [`Elementwise`] program of arithmetic on the entries of its inputs,
//! with sums and conversions of results where those follow.

use std::collections::{HashMap, HashSet};

use burn::backend::ir::{
    BaseOperationIr as Base, CustomOpIr, NumericOperationIr as Num, OperationIr, ScalarIr,
    ScalarOpIr, TensorId, TensorIr,
};
use burn::tensor::DType;

/// Identifier of fused elementwise operations.
pub const ELEMENTWISE: &str = "burn_linearize::elementwise";

/// An operation on entries, `left + right` and so on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "names say it")]
pub enum Arithmetic {
    Add,
    Sub,
    Mul,
    Div,
}

/// The right one of two operands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Right {
    /// The operand of this number.
    Operand(usize),
    /// The same value for all entries.
    Number(f64),
}

/// One operation with its operands. These are numbered: the inputs, then the results of earlier instructions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instruction {
    /// The operation.
    pub arithmetic: Arithmetic,
    /// The number of the left operand.
    pub left: usize,
    /// The right operand.
    pub right: Right,
}

/// What becomes of an operand in the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// All entries, in the float type of the output.
    Values(usize),
    /// The sum of the entries, an output of one element.
    Sum(usize),
}

/// A straight-line program on the entries of tensors of one shape; inputs of one element stand for all entries.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Elementwise {
    /// Operations in order.
    pub instructions: Vec<Instruction>,
    /// In the order of the outputs of the operation.
    pub outputs: Vec<Output>,
}

impl Elementwise {
    fn encode(&self) -> Vec<ScalarIr> {
        let place = |operand: usize| ScalarIr::UInt(operand as u64);
        let mut scalars = vec![place(self.instructions.len())];
        for instruction in &self.instructions {
            let right = match instruction.right {
                Right::Operand(operand) => place(operand),
                Right::Number(number) => ScalarIr::Float(number),
            };
            let arithmetic = place(instruction.arithmetic as usize);
            scalars.extend([arithmetic, place(instruction.left), right]);
        }
        for output in &self.outputs {
            let (sum, operand) = match *output {
                Output::Values(operand) => (false, operand),
                Output::Sum(operand) => (true, operand),
            };
            scalars.extend([ScalarIr::Bool(sum), place(operand)]);
        }
        scalars
    }

    /// The program of an operation called [`ELEMENTWISE`].
    pub fn of(operation: &CustomOpIr) -> Self {
        let place = |scalar: &ScalarIr| scalar.elem::<u64>() as usize;
        let (count, rest) = (place(&operation.scalars[0]), &operation.scalars[1..]);
        let (instructions, outputs) = rest.split_at(3 * count);
        let instruction = |code: &[ScalarIr]| {
            use Arithmetic::{Add, Div, Mul, Sub};
            let right = match code[2] {
                ScalarIr::Float(number) => Right::Number(number),
                ref operand => Right::Operand(place(operand)),
            };
            Instruction {
                arithmetic: [Add, Sub, Mul, Div][place(&code[0])],
                left: place(&code[1]),
                right,
            }
        };
        let output = |code: &[ScalarIr]| match code[0] {
            ScalarIr::Bool(true) => Output::Sum(place(&code[1])),
            _ => Output::Values(place(&code[1])),
        };
        Self {
            instructions: instructions.chunks(3).map(instruction).collect(),
            outputs: outputs.chunks(2).map(output).collect(),
        }
    }
}

/// An operation on the entries of its operands.
struct Entrywise<'a> {
    action: Action,
    operands: Vec<&'a TensorIr>,
    result: &'a TensorIr,
}

#[derive(Clone, Copy)]
enum Action {
    /// With a number in place of the right operand, if there is one.
    Compute(Arithmetic, Option<f64>),
    /// The result is no operand of the same loop.
    End(fn(usize) -> Output),
}

impl<'a> Entrywise<'a> {
    fn of(operation: &'a OperationIr) -> Option<Self> {
        use Arithmetic::{Add, Div, Mul, Sub};
        let compute = |arithmetic| Action::Compute(arithmetic, None);
        let by_number =
            |arithmetic, op: &ScalarOpIr| Action::Compute(arithmetic, Some(op.rhs.elem()));
        let action = match operation {
            OperationIr::NumericFloat(_, operation) => match operation {
                Num::Add(_) => compute(Add),
                Num::Sub(_) => compute(Sub),
                Num::Mul(_) => compute(Mul),
                Num::Div(_) => compute(Div),
                Num::AddScalar(op) => by_number(Add, op),
                Num::SubScalar(op) => by_number(Sub, op),
                Num::MulScalar(op) => by_number(Mul, op),
                Num::DivScalar(op) => by_number(Div, op),
                Num::Neg(_) => Action::Compute(Mul, Some(-1.0)),
                Num::Sum(_) => Action::End(Output::Sum),
                _ => return None,
            },
            OperationIr::BaseFloat(Base::Cast(_)) => Action::End(Output::Values),
            _ => return None,
        };
        let found = Self {
            action,
            operands: operation.inputs().collect(),
            result: operation.outputs().next()?,
        };
        found.fits().then_some(found)
    }

    /// The operand that has all entries: its shape and type are those of the loop.
    fn main(&self) -> &TensorIr {
        let larger = |a, b| if elements(a) < elements(b) { b } else { a };
        let operands = self.operands.iter().copied();
        operands.reduce(larger).expect("it has an operand")
    }

    /// Whether this is a loop over more than one entry in which every operand has all entries or one.
    fn fits(&self) -> bool {
        let main = self.main();
        let float = |t: &TensorIr| matches!(t.dtype, DType::F64 | DType::F32);
        let of_loop =
            |t: &&TensorIr| t.dtype == main.dtype && (t.shape == main.shape || elements(t) == 1);
        let result = self.is_terminal() || self.result.shape == main.shape;
        let floats = float(main) && float(self.result);
        elements(main) > 1 && floats && result && self.operands.iter().all(of_loop)
    }

    /// Whether both can run in one loop.
    fn same_loop(&self, other: &Self) -> bool {
        let (a, b) = (self.main(), other.main());
        a.shape == b.shape && a.dtype == b.dtype
    }

    fn is_terminal(&self) -> bool {
        matches!(self.action, Action::End(_))
    }
}

fn elements(t: &TensorIr) -> usize {
    t.shape.num_elements()
}

/// Gathers elementwise operations. `needed` are the tensors that are read after the program.
pub(crate) fn fuse(operations: &[OperationIr], needed: &HashSet<TensorId>) -> Vec<OperationIr> {
    let candidates: Vec<Option<Entrywise>> = operations.iter().map(Entrywise::of).collect();
    let producer: HashMap<TensorId, usize> = (operations.iter().enumerate())
        .flat_map(|(i, operation)| operation.outputs().map(move |t| (t.id, i)))
        .collect();
    let joins = |p: usize, i: usize| match (&candidates[p], &candidates[i]) {
        (Some(a), Some(b)) => a.same_loop(b) && !a.is_terminal(),
        _ => false,
    };
    let producers = |i: usize| {
        let inputs = operations[i].inputs();
        inputs.filter_map(|t| producer.get(&t.id).copied())
    };
    // The number of loops and other operations that have to come before. Operations of one loop have the same, and
    // whatever lies between two loops separates them.
    let mut depth = vec![0_usize; operations.len()];
    for i in 0..operations.len() {
        depth[i] = producers(i)
            .map(|p| depth[p] + usize::from(!joins(p, i)))
            .max()
            .unwrap_or(0);
    }
    // What only waits for inputs of the program is computed in the first loop that reads it: until then it would lie in memory.
    for i in (0..operations.len()).rev() {
        let is_result = |t: &TensorIr| (operations[i].outputs()).any(|result| result.id == t.id);
        let reads = |r: &usize| operations[*r].inputs().any(is_result);
        let (joined, others): (Vec<usize>, Vec<usize>) = (i + 1..operations.len())
            .filter(reads)
            .partition(|&r| joins(i, r));
        let first = joined.iter().map(|&r| depth[r]).min();
        let waits = producers(i).next().is_none()
            && !operations[i].outputs().any(|t| needed.contains(&t.id));
        if let Some(first) =
            first.filter(|&first| waits && others.iter().all(|&r| depth[r] > first))
        {
            depth[i] = first;
        }
    }
    let mut loops = Classes::new(operations.len());
    let mut reader: HashMap<(TensorId, usize), usize> = HashMap::new();
    for (i, operation) in operations.iter().enumerate() {
        let Some(candidate) = &candidates[i] else {
            continue;
        };
        for p in producers(i).filter(|&p| joins(p, i) && depth[p] == depth[i]) {
            loops.join(p, i);
        }
        // Loops that read the same are one: it is read once.
        for t in operation.inputs().filter(|t| elements(t) > 1) {
            let first = *reader.entry((t.id, depth[i])).or_insert(i);
            if candidates[first]
                .as_ref()
                .is_some_and(|c| c.same_loop(candidate))
            {
                loops.join(first, i);
            }
        }
    }
    let mut order: Vec<usize> = (0..operations.len()).collect();
    order.sort_by_key(|&i| (depth[i], loops.first(i), i));
    let used_by = |t: TensorId, of: usize| {
        needed.contains(&t)
            || operations.iter().enumerate().any(|(i, operation)| {
                loops.first(i) != of && operation.inputs().any(|input| input.id == t)
            })
    };
    let mut result = Vec::with_capacity(operations.len());
    for members in order.chunk_by(|&a, &b| loops.first(a) == loops.first(b)) {
        let first = loops.first(members[0]);
        let entrywise: Vec<&Entrywise> = (members.iter())
            .filter_map(|&i| candidates[i].as_ref())
            .collect();
        result.push(if entrywise.is_empty() {
            operations[first].clone()
        } else {
            OperationIr::Custom(as_one(&entrywise, |t| used_by(t, first)))
        });
    }
    result
}

/// One operation that does what the members do, one after the other.
fn as_one(members: &[&Entrywise], used: impl Fn(TensorId) -> bool) -> CustomOpIr {
    let inside: HashSet<TensorId> = members.iter().map(|m| m.result.id).collect();
    let mut inputs: Vec<TensorIr> = Vec::new();
    for t in members.iter().flat_map(|m| &m.operands) {
        if !inside.contains(&t.id) && !inputs.iter().any(|known| known.id == t.id) {
            inputs.push((*t).clone());
        }
    }
    let mut place: HashMap<TensorId, usize> =
        inputs.iter().enumerate().map(|(i, t)| (t.id, i)).collect();
    let mut outputs = Vec::new();
    let mut program = Elementwise::default();
    for member in members {
        let (result, operand) = (member.result, |k: usize| place[&member.operands[k].id]);
        let instruction = match member.action {
            Action::Compute(arithmetic, number) => Instruction {
                arithmetic,
                left: operand(0),
                right: number.map_or_else(|| Right::Operand(operand(1)), Right::Number),
            },
            Action::End(make) => {
                program.outputs.push(make(operand(0)));
                outputs.push(result.clone());
                continue;
            }
        };
        let number = inputs.len() + program.instructions.len();
        program.instructions.push(instruction);
        place.insert(result.id, number);
        if used(result.id) {
            program.outputs.push(Output::Values(number));
            outputs.push(result.clone());
        }
    }
    CustomOpIr::with_scalars(ELEMENTWISE, &inputs, &outputs, program.encode())
}

/// Disjoint classes of operations, each known by its first.
struct Classes(Vec<usize>);

impl Classes {
    fn new(count: usize) -> Self {
        Self((0..count).collect())
    }

    fn first(&self, mut i: usize) -> usize {
        while self.0[i] != i {
            i = self.0[i];
        }
        i
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.first(a), self.first(b));
        self.0[a.max(b)] = a.min(b);
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::ir::{name, output, read_only, tensor};
    use burn::backend::ir::{BinaryOpIr, ReduceOpIr, UnaryOpIr};
    use burn::tensor::Shape;

    pub(crate) fn t(id: u64) -> TensorIr {
        tensor(id, Shape::from([4, 4]), DType::F64)
    }

    pub(crate) fn binary(make: fn(BinaryOpIr) -> Num, lhs: u64, rhs: u64, out: u64) -> OperationIr {
        let (lhs, rhs, out) = (read_only(&t(lhs)), read_only(&t(rhs)), t(out));
        OperationIr::NumericFloat(DType::F64, make(BinaryOpIr { lhs, rhs, out }))
    }

    pub(crate) fn abs(input: u64, out: u64) -> OperationIr {
        let input = read_only(&t(input));
        OperationIr::NumericFloat(DType::F64, Num::Abs(UnaryOpIr { input, out: t(out) }))
    }

    fn sum(input: u64, out: u64) -> OperationIr {
        let out = tensor(out, Shape::from([1]), DType::F64);
        let input = read_only(&t(input));
        OperationIr::NumericFloat(DType::F64, Num::Sum(ReduceOpIr { input, out }))
    }

    fn custom(operation: &OperationIr) -> (Elementwise, Vec<u64>, Vec<u64>) {
        let OperationIr::Custom(custom) = operation else {
            panic!("{} was not fused", name(operation));
        };
        let ids = |tensors: &[TensorIr]| tensors.iter().map(|t| t.id.value()).collect();
        (
            Elementwise::of(custom),
            ids(&custom.inputs),
            ids(&custom.outputs),
        )
    }

    fn instruction(arithmetic: Arithmetic, left: usize, right: Right) -> Instruction {
        Instruction {
            arithmetic,
            left,
            right,
        }
    }

    #[test]
    fn arithmetic_and_its_sum_become_one_operation() {
        // 2 = 0 - 1, 3 = 2 2, 4 = sum 3; of these only 2 and 4 are read.
        let operations = [
            binary(Num::Sub, 0, 1, 2),
            binary(Num::Mul, 2, 2, 3),
            sum(3, 4),
        ];
        let fused = fuse(&operations, &HashSet::from([t(2).id, t(4).id]));
        assert_eq!(fused.len(), 1);
        let (program, inputs, outputs) = custom(&fused[0]);
        assert_eq!((inputs, outputs), (vec![0, 1], vec![2, 4]));
        assert_eq!(
            program.instructions,
            [
                instruction(Arithmetic::Sub, 0, Right::Operand(1)),
                instruction(Arithmetic::Mul, 2, Right::Operand(2))
            ]
        );
        assert_eq!(program.outputs, [Output::Values(2), Output::Sum(3)]);
    }

    #[test]
    fn what_waits_for_inputs_alone_is_computed_where_it_is_read() {
        // 2 = |0|, 3 = 1 1, 4 = 2 3: the square waits for the loop after |0|.
        let operations = [
            abs(0, 2),
            binary(Num::Mul, 1, 1, 3),
            binary(Num::Mul, 2, 3, 4),
        ];
        let fused = fuse(&operations, &HashSet::from([t(4).id]));
        let names: Vec<String> = fused.iter().map(name).collect();
        assert_eq!(names, ["Abs", ELEMENTWISE]);
        let (program, inputs, outputs) = custom(&fused[1]);
        assert_eq!((inputs, outputs), (vec![1, 2], vec![4]));
        assert_eq!(program.instructions.len(), 2);
        // Where it is read before, or after the program, it does not.
        let fused = fuse(&operations, &HashSet::from([t(3).id, t(4).id]));
        assert_eq!(fused.len(), 3);
    }

    #[test]
    fn what_waits_for_another_operation_comes_after_it() {
        // 2 = 0 + 1, 3 = |2|, 4 = 2 3, 5 = 0 0: the product needs |2|, and cannot run with the sum.
        let operations = [
            binary(Num::Add, 0, 1, 2),
            abs(2, 3),
            binary(Num::Mul, 2, 3, 4),
            binary(Num::Mul, 0, 0, 5),
        ];
        let fused = fuse(&operations, &HashSet::from([t(4).id, t(5).id]));
        let names: Vec<String> = fused.iter().map(name).collect();
        assert_eq!(names, [ELEMENTWISE, "Abs", ELEMENTWISE]);
        // The square reads what the sum reads, and is computed with it.
        assert_eq!(custom(&fused[0]).2, [2, 5]);
        assert_eq!(custom(&fused[2]).1, [2, 3]);
    }

    #[test]
    fn other_shapes_are_other_loops_and_single_elements_belong_to_any() {
        let small = tensor(7, Shape::from([1, 1]), DType::F64);
        let scaled = OperationIr::NumericFloat(
            DType::F64,
            Num::Mul(BinaryOpIr {
                lhs: read_only(&small),
                rhs: read_only(&t(0)),
                out: t(1),
            }),
        );
        let row = BinaryOpIr {
            lhs: read_only(&t(0)),
            rhs: read_only(&tensor(8, Shape::from([1, 4]), DType::F64)),
            out: t(2),
        };
        let spread = OperationIr::NumericFloat(DType::F64, Num::Mul(row));
        let fused = fuse(&[scaled, spread], &HashSet::from([t(1).id, t(2).id]));
        assert_eq!(custom(&fused[0]).1, [7, 0]);
        assert_eq!(name(&fused[1]), "Mul");
    }

    #[test]
    fn programs_survive_their_encoding() {
        let program = Elementwise {
            instructions: vec![
                instruction(Arithmetic::Add, 0, Right::Operand(1)),
                instruction(Arithmetic::Sub, 1, Right::Operand(0)),
                instruction(Arithmetic::Mul, 2, Right::Operand(3)),
                instruction(Arithmetic::Div, 3, Right::Operand(2)),
                instruction(Arithmetic::Add, 4, Right::Number(0.1)),
                instruction(Arithmetic::Mul, 5, Right::Number(-3.0)),
                instruction(Arithmetic::Div, 6, Right::Number(1e-300)),
            ],
            outputs: vec![Output::Sum(7), Output::Values(8)],
        };
        let ir = CustomOpIr::with_scalars(
            ELEMENTWISE,
            &[t(0), t(1)],
            &[output(Shape::from([1]), DType::F64), t(2)],
            program.encode(),
        );
        assert_eq!(Elementwise::of(&ir), program);
    }
}
