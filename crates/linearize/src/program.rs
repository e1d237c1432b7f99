//! From a graph to straight-line programs.

use std::collections::{BTreeMap, HashMap, HashSet};

use burn::backend::ir::{
    BaseOperationIr as Base, NumericOperationIr as Num, OperationIr, TensorId, TensorIr,
    TensorStatus,
};
use burn::tensor::DType;

use crate::conversion::Conversion;
use crate::emit::Emitter;
use crate::fusion::fuse;
use crate::ir::{detach_outputs, each_tensor, name, read_only, rename, with_status};
use crate::rules::{self, Context};
use crate::tangent::{Builder, Expression};
use crate::trace::Sources;
use crate::{Error, Extensions, Graph, precision};

/// Programs ready to run: constants (once), value, primal (once per point), tangent (once per
/// direction).
#[derive(Clone, Debug)]
pub struct Program {
    pub(crate) sources: Sources,
    /// Operations that depend on no input.
    pub(crate) constant: Vec<OperationIr>,
    pub(crate) value: Block,
    pub(crate) primal: Block,
    pub(crate) tangent: Block,
    /// What the tangent program reads of the primal program, to be freed with the point.
    pub(crate) saved: Vec<TensorIr>,
    /// What the tangent program is applied to.
    pub(crate) directions: Vec<TensorIr>,
}

/// One straight-line program.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    /// Tensors to register before running, `None` where the program does not read the input.
    pub(crate) inputs: Vec<Option<TensorId>>,
    pub(crate) operations: Vec<OperationIr>,
    /// Outputs, with the status under which to take them out of the interpreter.
    pub(crate) outputs: Vec<TensorIr>,
}

/// How many operations of which name each program runs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Run by [`value`](crate::Linearization::value).
    pub value: BTreeMap<String, usize>,
    /// Run by [`at`](crate::Linearization::at).
    pub primal: BTreeMap<String, usize>,
    /// Run by [`apply`](crate::Linearization::apply).
    pub tangent: BTreeMap<String, usize>,
    /// Number of tensors that `at` keeps for `apply`.
    pub saved: usize,
    /// Number of elements of these tensors.
    pub saved_elements: usize,
}

impl Program {
    /// Operation counts.
    pub fn statistics(&self) -> Statistics {
        Statistics {
            value: count(&self.value.operations),
            primal: count(&self.primal.operations),
            tangent: count(&self.tangent.operations),
            saved: self.saved.len(),
            saved_elements: self.saved.iter().map(|t| t.shape.num_elements()).sum(),
        }
    }

    /// The same programs with elementwise operations gathered into [`ELEMENTWISE`](crate::ELEMENTWISE) ones.
    pub(crate) fn fused(&self) -> Self {
        Self {
            value: self.value.fused(&HashSet::new()),
            primal: self.primal.fused(&ids(&self.saved)),
            tangent: self.tangent.fused(&HashSet::new()),
            ..self.clone()
        }
    }

    /// Identifiers of the custom operations in all programs.
    pub(crate) fn custom_operations(&self) -> impl Iterator<Item = &str> {
        [
            &self.constant,
            &self.value.operations,
            &self.primal.operations,
            &self.tangent.operations,
        ]
        .into_iter()
        .flatten()
        .filter_map(|operation| match operation {
            OperationIr::Custom(custom) => Some(custom.id.as_str()),
            _ => None,
        })
    }
}

fn is_drop(operation: &OperationIr) -> bool {
    matches!(operation, OperationIr::Drop(_))
}

fn count(operations: &[OperationIr]) -> BTreeMap<String, usize> {
    let mut counts = BTreeMap::new();
    for operation in operations.iter().filter(|operation| !is_drop(operation)) {
        *counts.entry(name(operation)).or_insert(0) += 1;
    }
    counts
}

impl Sources {
    /// The same under fresh names, which the map then knows.
    fn renamed(&self, emitter: &mut Emitter, map: &mut HashMap<TensorId, TensorIr>) -> Self {
        let mut fresh = |old: &TensorIr| {
            let new = emitter.fresh(old.shape.clone(), old.dtype);
            map.insert(old.id, new.clone());
            new
        };
        Self {
            variables: self.variables.iter().map(&mut fresh).collect(),
            parameters: self.parameters.iter().map(&mut fresh).collect(),
            constants: (self.constants.iter())
                .map(|(old, data)| (fresh(old), data.clone()))
                .collect(),
        }
    }
}

/// A graph after common-subexpression elimination and algebra, in new numbering.
fn simplify(graph: &Graph) -> Graph {
    let mut emitter = Emitter::new(0);
    let mut map: HashMap<TensorId, TensorIr> = HashMap::new();
    let sources = graph.sources.renamed(&mut emitter, &mut map);
    let ends = |graph: &Graph| [&graph.outputs[..], std::slice::from_ref(&graph.value)].concat();
    for operation in live(&graph.operations, &ends(graph)) {
        replay(&mut map, &operation, |operation| {
            precision::simplify(&mut emitter, operation)
        });
    }
    let mut simplified = Graph {
        operations: emitter.into_operations(),
        sources,
        value: map[&graph.value.id].clone(),
        outputs: graph.outputs.iter().map(|t| map[&t.id].clone()).collect(),
    };
    simplified.operations = live(&simplified.operations, &ends(&simplified));
    simplified
}

/// Emit `operation` with its inputs renamed, and note what its outputs are called now: the operation in the new names.
fn replay(
    map: &mut HashMap<TensorId, TensorIr>,
    operation: &OperationIr,
    emit: impl FnOnce(OperationIr) -> Vec<TensorIr>,
) -> OperationIr {
    let old: Vec<TensorId> = operation.outputs().map(|out| out.id).collect();
    let mut operation = operation.clone();
    detach_outputs(&mut operation);
    rename(&mut operation, map);
    let new = emit(operation.clone());
    let detached = operation.outputs().map(|out| out.id);
    let names = detached.zip(new.iter().cloned()).collect();
    rename(&mut operation, &names);
    map.extend(old.into_iter().zip(new));
    operation
}

/// Dead-code elimination: the operations that `outputs` depend on, in order.
fn live<'a>(
    operations: &[OperationIr],
    outputs: impl IntoIterator<Item = &'a TensorIr>,
) -> Vec<OperationIr> {
    let mut needed = ids(outputs);
    let mut kept = Vec::new();
    for operation in operations.iter().rev() {
        if operation.outputs().any(|out| needed.contains(&out.id)) {
            needed.extend(operation.inputs().map(|t| t.id));
            kept.push(operation.clone());
        }
    }
    kept.reverse();
    kept
}

impl Graph {
    /// Transform the graph into a primal and a tangent program.
    ///
    /// With `products` in another float type than that of the graph, values and gradients keep the type they were traced with; what
    /// [`at`](crate::Linearization::at) keeps is converted once per point, and [`apply`](crate::Linearization::apply) takes and returns
    /// tensors of the other type. Products in single precision cost half as much, and inexact Newton methods do not need more.
    ///
    /// # Errors
    /// [`Error::NoRule`] if a tangent reaches an operation that cannot be differentiated.
    pub fn linearize(
        &self,
        extensions: &Extensions,
        products: Option<DType>,
    ) -> Result<Program, Error> {
        let simplified = simplify(self);
        let mut cx = Context {
            build: Builder::new(),
            extensions,
            tangents: HashMap::new(),
        };
        let mut map: HashMap<TensorId, TensorIr> = HashMap::new();
        let sources = (simplified.sources).renamed(&mut cx.build.primal, &mut map);
        let mut directions = Vec::new();
        for variable in &sources.variables {
            let seed = (cx.build.tangent).fresh(variable.shape.clone(), variable.dtype);
            directions.push(seed.clone());
            cx.tangents.insert(variable.id, Expression::atom(seed));
        }

        // Only what the outputs depend on needs a tangent; the value alone does not.
        let mut differentiated: HashSet<TensorId> = HashSet::new();
        let mut uses: HashMap<TensorId, usize> = HashMap::new();
        let active = live(&simplified.operations, &simplified.outputs);
        differentiated.extend(outputs_of(&active));
        let read = active.iter().flat_map(OperationIr::inputs);
        for t in read.chain(&simplified.outputs) {
            *uses.entry(t.id).or_insert(0) += 1;
        }
        for operation in &simplified.operations {
            let emitted = replay(&mut map, operation, |new| cx.build.primal.emit(new));
            if !operation
                .outputs()
                .any(|out| differentiated.contains(&out.id))
            {
                continue;
            }
            let tangents = rules::jvp(&mut cx, &emitted)?;
            for ((old, new), tangent) in operation.outputs().zip(emitted.outputs()).zip(tangents) {
                let Some(mut tangent) = tangent else { continue };
                if uses.get(&old.id).copied().unwrap_or(0) > 1 && tangent.is_long() {
                    tangent = cx.build.shared(tangent);
                }
                cx.tangents.insert(new.id, tangent);
            }
        }

        let outputs: Vec<TensorIr> = (simplified.outputs.iter())
            .map(|t| map[&t.id].clone())
            .collect();
        let tangents = (outputs.iter())
            .map(|out| {
                let tangent = cx.tangents.get(&out.id).cloned();
                cx.build.or_zeros(tangent, &out.shape, out.dtype)
            })
            .collect();
        let primal = Graph {
            operations: cx.build.primal.into_operations(),
            sources,
            value: map[&simplified.value.id].clone(),
            outputs,
        };
        let tangent = cx.build.tangent.into_operations();
        Ok(assemble(primal, &tangent, directions, tangents, products))
    }
}

fn outputs_of(operations: &[OperationIr]) -> impl Iterator<Item = TensorId> {
    operations.iter().flat_map(|op| op.outputs().map(|t| t.id))
}

fn ids<'a>(tensors: impl IntoIterator<Item = &'a TensorIr>) -> HashSet<TensorId> {
    tensors.into_iter().map(|t| t.id).collect()
}

/// The programs that compute a graph and, from `directions`, its `tangents`.
fn assemble(
    graph: Graph,
    tangent: &[OperationIr],
    mut directions: Vec<TensorIr>,
    mut tangents: Vec<TensorIr>,
    products: Option<DType>,
) -> Program {
    let mut tangent = live(tangent, &tangents);

    // What depends on inputs, and what does not.
    let inputs = [&graph.sources.variables[..], &graph.sources.parameters].concat();
    let mut varying = ids(&inputs);
    for operation in &graph.operations {
        if operation.inputs().any(|t| varying.contains(&t.id)) {
            varying.extend(operation.outputs().map(|t| t.id));
        }
    }
    let varies = |operation: &OperationIr| operation.outputs().any(|t| varying.contains(&t.id));
    // Filling memory with a number is as cheap as reading it: do that where it is needed. Whatever
    // else is constant is computed once.
    let local: Vec<OperationIr> = (graph.operations.iter())
        .filter(|operation| varies(operation) || is_fill(operation))
        .cloned()
        .collect();
    let mut produced_locally = ids(&inputs);
    produced_locally.extend(outputs_of(&local));

    let mut in_tangent = ids(&directions);
    in_tangent.extend(outputs_of(&tangent));
    let mut saved: Vec<TensorIr> = Vec::new();
    let mut constants_of_tangent: Vec<TensorIr> = Vec::new();
    for t in tangent.iter().flat_map(OperationIr::inputs) {
        let list = if in_tangent.contains(&t.id) {
            continue;
        } else if produced_locally.contains(&t.id) {
            &mut saved
        } else {
            &mut constants_of_tangent
        };
        if !list.iter().any(|known| known.id == t.id) {
            list.push(read_only(t));
        }
    }

    let value = std::slice::from_ref(&graph.value);
    let outputs = [value, &graph.outputs].concat();
    let mut primal = live(&local, outputs.iter().chain(&saved));
    let value_operations = live(&local, value);
    let mut from_constants: Vec<TensorIr> = (primal.iter().chain(&value_operations))
        .flat_map(OperationIr::inputs)
        .chain(&outputs)
        .filter(|t| !produced_locally.contains(&t.id))
        .cloned()
        .collect();
    let needed = from_constants.iter().chain(&constants_of_tangent);
    let mut constant = live(&graph.operations, needed);
    constant.retain(|operation| !varies(operation));
    if let Some(dtype) = products {
        let mut conversion = Conversion::to(dtype);
        primal.extend(conversion.cast(&mut saved));
        constant.extend(conversion.cast(&mut constants_of_tangent));
        for operation in &mut tangent {
            conversion.rewrite(operation);
        }
        for t in directions.iter_mut().chain(&mut tangents) {
            conversion.convert(t);
        }
    }
    from_constants.extend(constants_of_tangent);

    let (nothing, keep, kept_constants) = (HashSet::new(), ids(&saved), ids(&from_constants));
    let block = Block::new(&inputs, value_operations, value, &nothing);
    Program {
        value: separate(block, &kept_constants),
        primal: Block::new(&inputs, primal, &outputs, &keep),
        tangent: Block::new(&directions, tangent, &tangents, &nothing),
        constant: Block::new(&[], constant, &[], &kept_constants).operations,
        saved: saved
            .iter()
            .map(|t| with_status(t, TensorStatus::ReadWrite))
            .collect(),
        sources: graph.sources,
        directions,
    }
}

fn is_fill(operation: &OperationIr) -> bool {
    matches!(
        operation,
        OperationIr::BaseFloat(Base::Zeros(_) | Base::Ones(_) | Base::Empty(_))
            | OperationIr::NumericFloat(_, Num::Full(_))
    )
}

impl Block {
    /// The same program with elementwise operations gathered; `keep` survives it.
    fn fused(&self, keep: &HashSet<TensorId>) -> Self {
        let operations: Vec<OperationIr> = (self.operations.iter())
            .filter(|operation| !is_drop(operation))
            .cloned()
            .collect();
        let mut needed = keep.clone();
        needed.extend(self.outputs.iter().map(|t| t.id));
        let operations = fuse(&operations, &needed);
        Self::marked(self.inputs.clone(), operations, &self.outputs, keep)
    }

    /// A program that is given those `inputs` which it reads, or which `keep` says to keep.
    pub(crate) fn new(
        inputs: &[TensorIr],
        operations: Vec<OperationIr>,
        outputs: &[TensorIr],
        keep: &HashSet<TensorId>,
    ) -> Self {
        let read = (operations.iter()).flat_map(OperationIr::inputs);
        let read = ids(read.chain(outputs));
        let inputs: Vec<Option<TensorId>> = inputs
            .iter()
            .map(|t| (read.contains(&t.id) || keep.contains(&t.id)).then_some(t.id))
            .collect();
        Self::marked(inputs, operations, outputs, keep)
    }

    /// Mark last uses: the interpreter gives such a tensor away, so that the backend can reuse its
    /// memory in place, and nothing is kept longer than needed. `keep` survives the program.
    fn marked(
        inputs: Vec<Option<TensorId>>,
        operations: Vec<OperationIr>,
        outputs: &[TensorIr],
        keep: &HashSet<TensorId>,
    ) -> Self {
        let mut owned: HashSet<TensorId> = inputs.iter().flatten().copied().collect();
        owned.extend(outputs_of(&operations));
        for id in keep {
            owned.remove(id);
        }

        let mut used = ids(outputs);
        let mut reversed: Vec<OperationIr> = Vec::with_capacity(operations.len());
        for mut operation in operations.into_iter().rev() {
            let results: Vec<TensorIr> = operation.outputs().cloned().collect();
            let arguments: Vec<TensorIr> = operation.inputs().cloned().collect();
            let ends = |t: &TensorIr| owned.contains(&t.id) && !used.contains(&t.id);
            let is_single = |t: &TensorIr| arguments.iter().filter(|a| a.id == t.id).count() == 1;
            // Results that nobody reads, and repeated arguments, which cannot be given away by one
            // of their occurrences, are dropped after the operation.
            let mut dropped: Vec<TensorIr> = Vec::new();
            for t in results.iter().chain(&arguments) {
                let known = dropped.iter().any(|drop| drop.id == t.id);
                if ends(t) && !is_single(t) && !known {
                    dropped.push(with_status(t, TensorStatus::ReadWrite));
                }
            }
            each_tensor(&mut operation, |t| {
                t.status = if results.iter().any(|out| out.id == t.id) {
                    TensorStatus::NotInit
                } else if ends(t) && is_single(t) {
                    TensorStatus::ReadWrite
                } else {
                    TensorStatus::ReadOnly
                };
            });
            used.extend(arguments.iter().map(|t| t.id));
            reversed.extend(dropped.into_iter().map(OperationIr::Drop));
            reversed.push(operation);
        }
        reversed.reverse();

        let outputs = (outputs.iter().enumerate())
            .map(|(i, t)| {
                let again = outputs[i + 1..].iter().any(|later| later.id == t.id);
                let status = if owned.contains(&t.id) && !again {
                    TensorStatus::ReadWrite
                } else {
                    TensorStatus::ReadOnly
                };
                with_status(t, status)
            })
            .collect();
        Self {
            inputs,
            operations: reversed,
            outputs,
        }
    }
}

/// Rename everything that the value program owns, which is all but the constants, so that running it
/// between `at` and `apply` leaves the point alone.
fn separate(mut block: Block, constants: &HashSet<TensorId>) -> Block {
    const OFFSET: u64 = 1 << 24;
    let shift = |id: &mut TensorId| {
        if !constants.contains(id) {
            *id = TensorId::new(id.value() + OFFSET);
        }
    };
    block.inputs.iter_mut().flatten().for_each(shift);
    for operation in &mut block.operations {
        each_tensor(operation, |t| shift(&mut t.id));
    }
    for out in &mut block.outputs {
        shift(&mut out.id);
    }
    block
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fusion::tests::{abs, binary, t};
    use TensorStatus::{ReadOnly, ReadWrite};
    use burn::tensor::{Device, Shape};

    fn mul(lhs: u64, rhs: u64, out: u64) -> OperationIr {
        binary(Num::Mul, lhs, rhs, out)
    }

    #[test]
    fn dead_code_is_eliminated() {
        let operations = [abs(0, 1), abs(1, 2), mul(0, 1, 3), abs(3, 4)];
        assert_eq!(live(&operations, &[t(3)]), [abs(0, 1), mul(0, 1, 3)]);
    }

    #[test]
    fn equal_operations_are_shared_whatever_the_order_of_commutative_operands() {
        let mut emitter = Emitter::new(0);
        let shape = Shape::from([2, 2]);
        let x = emitter.fresh(shape.clone(), DType::F64);
        let y = emitter.fresh(shape, DType::F64);
        let xy = emitter.mul(&x, &y);
        assert_eq!(emitter.mul(&y, &x).id, xy.id);
        let difference = emitter.sub(&x, &y);
        assert_ne!(emitter.sub(&y, &x).id, difference.id);
        assert_eq!(emitter.into_operations().len(), 3);
    }

    #[test]
    fn products_with_ones_and_sums_with_zeros_vanish() {
        let mut emitter = Emitter::new(0);
        let shape = Shape::from([2, 2]);
        let x = emitter.fresh(shape.clone(), DType::F64);
        let ones = emitter.full(shape.clone(), DType::F64, 1.0);
        let zeros = emitter.full(shape, DType::F64, 0.0);
        assert_eq!(emitter.mul(&ones, &x).id, x.id);
        assert_eq!(emitter.add(&x, &zeros).id, x.id);
        let twice = emitter.neg(&x);
        assert_eq!(emitter.neg(&twice).id, x.id);
    }

    #[test]
    fn a_spread_scalar_multiplies_once() {
        // x ⊙ expand(reshape(s)) is x times s with one element per axis: nothing is spread.
        let mut emitter = Emitter::new(0);
        let shape = Shape::from([2, 2]);
        let x = emitter.fresh(shape.clone(), DType::F64);
        let s = emitter.fresh(Shape::from([1]), DType::F64);
        let ones = emitter.full(shape, DType::F64, 1.0);
        let one_by_one = emitter.reshape(&s, Shape::from([1, 1]));
        let spread = emitter.mul(&ones, &one_by_one);
        let product = emitter.mul(&x, &spread);
        let operations = emitter.into_operations();
        let names: Vec<_> = live(&operations, &[product]).iter().map(name).collect();
        assert_eq!(names, ["Reshape", "Mul"]);
    }

    #[test]
    fn last_uses_are_given_away_and_nothing_else() {
        // 1 = |0|, 2 = 1·1, 3 = 2·0, and 2 is kept.
        let operations = vec![abs(0, 1), mul(1, 1, 2), mul(2, 0, 3)];
        let keep = HashSet::from([t(2).id]);
        let block = Block::new(&[t(0)], operations, &[t(3)], &keep);
        let statuses: Vec<Vec<_>> = (block.operations.iter())
            .map(|op| op.inputs().map(|t| (t.id.value(), t.status)).collect())
            .collect();
        assert_eq!(
            statuses,
            [
                vec![(0, ReadOnly)],
                vec![(1, ReadOnly), (1, ReadOnly)],
                vec![(1, ReadWrite)], // a drop: both factors were the same tensor
                vec![(2, ReadOnly), (0, ReadWrite)],
            ]
        );
        assert!(is_drop(&block.operations[2]));
        assert_eq!(block.outputs[0].status, ReadWrite);
    }

    #[test]
    fn inputs_that_are_not_read_are_not_registered() {
        let block = Block::new(&[t(0), t(1)], vec![abs(0, 2)], &[t(2)], &HashSet::new());
        assert_eq!(block.inputs, [Some(t(0).id), None]);
    }

    /// What the interpreter holds after a block, and the most it ever held, in elements.
    fn simulate(block: &Block, held: &mut HashMap<TensorId, usize>) -> usize {
        for id in block.inputs.iter().flatten() {
            held.insert(*id, 0);
        }
        let mut most = 0;
        for operation in &block.operations {
            for t in operation.inputs() {
                assert!(
                    held.contains_key(&t.id),
                    "{} reads what is gone",
                    name(operation)
                );
                if t.status == TensorStatus::ReadWrite {
                    held.remove(&t.id);
                }
            }
            for t in operation.outputs() {
                held.insert(t.id, t.shape.num_elements());
            }
            most = most.max(held.values().sum());
        }
        for out in &block.outputs {
            assert!(held.contains_key(&out.id));
            if out.status == TensorStatus::ReadWrite {
                held.remove(&out.id);
            }
        }
        most
    }

    /// A long chain of intermediate results: the primal program keeps what the tangent program
    /// reads, and a few tensors at a time otherwise; the other programs leave nothing behind.
    #[test]
    fn only_what_the_tangent_program_reads_is_kept() {
        use burn::tensor::Tensor;
        let device = Device::default();
        let u = Tensor::<2>::zeros([8, 8], (&device, DType::F64));
        let graph = Graph::gradient(&[(&u).into()], &[], |i| {
            let mut v = i.variable::<2>(0);
            for _ in 0..10 {
                v = (v.clone() * v).sin();
            }
            v.sum()
        })
        .unwrap();
        let program = graph.linearize(&Extensions::new(), None).unwrap();
        let elements = 64;
        let mut held = HashMap::new();
        simulate(&program.value, &mut held);
        assert!(held.is_empty(), "{held:?}");
        simulate(&program.primal, &mut held);
        let saved: HashSet<TensorId> = program.saved.iter().map(|t| t.id).collect();
        assert_eq!(held.keys().copied().collect::<HashSet<_>>(), saved);
        assert_eq!(saved.len(), 1, "the Hessian is diagonal");
        let most = simulate(&program.tangent, &mut held);
        assert!(most <= 3 * elements);
        for t in &program.saved {
            held.remove(&t.id);
        }
        assert!(held.is_empty(), "{held:?}");
        // Backpropagation through twenty steps needs them all once, but not two of each.
        let most = simulate(&program.primal, &mut held);
        assert!(most < 50 * elements, "{}", most / elements);
    }
}
