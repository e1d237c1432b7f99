//! Tangents as sums of diagonal operators, and the builder of the primal and tangent programs.
//!
//! A tangent is kept unevaluated as `Σⱼ kⱼ · pⱼ ⊙ ṫⱼ` with numbers `kⱼ`, tensors `pⱼ` of the primal
//! program and tensors `ṫⱼ` of the tangent program. Elementwise operations only change `kⱼ` and
//! `pⱼ`, that is, the primal program, which runs once per point; terms with the same `ṫⱼ` merge.
//! Only operations that are not elementwise (sums, convolutions, shifts) evaluate their argument.
//! So all of the pointwise second derivative `W″(u) ⊙ u̇` of a local energy is one product.

use std::collections::HashMap;

use burn::backend::ir::{
    BaseOperationIr as Base, BinaryOpIr, CreationOpIr, CustomOpIr, NumericOperationIr as Num,
    OperationIr, ShapeOpIr, TensorId, TensorIr,
};
use burn::tensor::{DType, Shape};

use crate::Error;
use crate::emit::Emitter;
use crate::ir::{EXPRESSION_IDS, TANGENT_IDS, like, output, read_only, rename, tensor};

/// `factor · coefficient ⊙ atom`
#[derive(Clone, Debug)]
struct Term {
    factor: f64,
    coefficient: Option<TensorIr>,
    atom: TensorIr,
}

impl Term {
    fn plain(factor: f64, atom: TensorIr) -> Self {
        Self {
            factor,
            coefficient: None,
            atom,
        }
    }

    /// Whether multiplying by the coefficient costs a pass over data that the sum need not make.
    fn is_plain(&self) -> bool {
        self.coefficient
            .as_ref()
            .is_none_or(|p| p.shape.num_elements() == 1)
    }
}

/// Sum of terms, at least one, whose atoms have the same shape and type.
#[derive(Clone, Debug)]
pub(crate) struct Expression {
    terms: Vec<Term>,
}

impl Expression {
    pub(crate) fn atom(atom: TensorIr) -> Self {
        Self::multiple(1.0, atom)
    }

    /// `factor` must not be zero: the zero tangent is `None`.
    fn multiple(factor: f64, atom: TensorIr) -> Self {
        Self {
            terms: vec![Term::plain(factor, atom)],
        }
    }

    /// Of the shape and the type of the sum.
    fn first(&self) -> &TensorIr {
        &self.terms[0].atom
    }

    /// Whether several uses had better share one evaluation than carry the terms on. Carrying on
    /// is free for one term, and products of two terms often merge with others later; but sums of
    /// products would grow like the square of their length.
    pub(crate) fn is_long(&self) -> bool {
        let plain = self.terms.iter().all(Term::is_plain);
        self.terms.len() >= if plain { 2 } else { 3 }
    }
}

/// Zero, or an expression.
pub(crate) type Tangent = Option<Expression>;

/// Builds the primal and the tangent program; rules of custom operations work through it.
pub struct Builder {
    pub(crate) primal: Emitter,
    pub(crate) tangent: Emitter,
    expressions: HashMap<TensorId, Expression>,
}

impl Builder {
    pub(crate) fn new() -> Self {
        Self {
            primal: Emitter::new(0),
            tangent: Emitter::new(TANGENT_IDS),
            expressions: HashMap::new(),
        }
    }

    /// `factor · e`
    pub(crate) fn scaled(e: Tangent, factor: f64) -> Tangent {
        let mut e = e.filter(|_| factor != 0.0)?;
        for term in &mut e.terms {
            term.factor *= factor;
        }
        Some(e)
    }

    /// `p ⊙ e`, broadcast to `shape`.
    pub(crate) fn times(&mut self, p: &TensorIr, e: Expression, shape: &Shape) -> Tangent {
        if let Some(value) = self.primal.constant(p) {
            let e = self.spread(e, shape);
            return Self::scaled(Some(e), value);
        }
        let p = self.primal.compact(p);
        let mut e = self.spread(e, shape);
        if p.shape.num_elements() > 1 && e.terms.iter().filter(|t| t.is_plain()).count() > 1 {
            // One product with the sum of the plain terms instead of one with each.
            let (plain, mut rest): (Vec<Term>, Vec<Term>) =
                e.terms.into_iter().partition(Term::is_plain);
            let (factor, atom) = self.evaluate(Expression { terms: plain });
            rest.push(Term::plain(factor, atom));
            e.terms = rest;
        }
        for term in &mut e.terms {
            term.coefficient = Some(match &term.coefficient {
                None => p.clone(),
                Some(c) => self.primal.mul(c, &p),
            });
        }
        Some(e)
    }

    pub(crate) fn plus(&mut self, a: Tangent, b: Tangent) -> Tangent {
        let (mut a, b) = match (a, b) {
            (Some(a), Some(b)) => (a, b),
            (a, b) => return a.or(b),
        };
        for term in b.terms {
            let Some(i) = a.terms.iter().position(|t| t.atom.id == term.atom.id) else {
                a.terms.push(term);
                continue;
            };
            match self.merge(&a.terms[i], &term) {
                Some((factor, coefficient)) => {
                    a.terms[i].factor = factor;
                    a.terms[i].coefficient = coefficient;
                }
                None => {
                    a.terms.remove(i);
                }
            }
        }
        (!a.terms.is_empty()).then_some(a)
    }

    /// Factor and coefficient of the sum of two terms with the same atom.
    fn merge(&mut self, a: &Term, b: &Term) -> Option<(f64, Option<TensorIr>)> {
        let same = match (&a.coefficient, &b.coefficient) {
            (None, None) => true,
            (Some(p), Some(q)) => p.id == q.id,
            _ => false,
        };
        if same {
            let factor = a.factor + b.factor;
            return (factor != 0.0).then(|| (factor, a.coefficient.clone()));
        }
        let primal = &mut self.primal;
        let (factor, sum) = match (&a.coefficient, &b.coefficient) {
            (Some(p), Some(q)) if a.factor.to_bits() == b.factor.to_bits() => {
                (a.factor, primal.add(p, q))
            }
            (Some(p), Some(q)) if a.factor.to_bits() == (-b.factor).to_bits() => {
                (a.factor, primal.sub(p, q))
            }
            (Some(p), Some(q)) => {
                let (p, q) = (primal.scale(p, a.factor), primal.scale(q, b.factor));
                (1.0, primal.add(&p, &q))
            }
            (Some(p), None) => {
                let p = primal.scale(p, a.factor);
                (1.0, primal.shift(&p, b.factor))
            }
            (None, Some(q)) => {
                let q = primal.scale(q, b.factor);
                (1.0, primal.shift(&q, a.factor))
            }
            (None, None) => unreachable!("equal coefficients were merged above"),
        };
        match primal.constant(&sum) {
            Some(0.0) => None,
            Some(value) => Some((factor * value, None)),
            None => Some((factor, Some(sum))),
        }
    }

    /// Broadcast `e` to `shape`.
    pub(crate) fn spread(&mut self, e: Expression, shape: &Shape) -> Expression {
        if e.first().shape == *shape {
            return e;
        }
        let (factor, atom) = self.evaluate(e);
        let out = output(shape.clone(), atom.dtype);
        let input = read_only(&atom);
        let expand = OperationIr::BaseFloat(Base::Expand(ShapeOpIr { input, out }));
        Expression::multiple(factor, self.tangent.emit_one(expand))
    }

    /// Evaluate up to a factor: `e = factor · tensor`. Cheaper than [`exactly`](Self::exactly).
    pub(crate) fn evaluate(&mut self, mut e: Expression) -> (f64, TensorIr) {
        // A plain term cannot hide its factor in a primal coefficient: take it out of the sum.
        let plain = e.terms.iter().find(|t| t.coefficient.is_none());
        let unit = plain.unwrap_or(&e.terms[0]).factor;
        for term in &mut e.terms {
            term.factor /= unit;
        }
        (unit, self.exactly(e))
    }

    /// Evaluate now, so that several uses share the sum.
    pub(crate) fn shared(&mut self, e: Expression) -> Expression {
        let (factor, atom) = self.evaluate(e);
        Expression::multiple(factor, atom)
    }

    /// Evaluate.
    pub(crate) fn exactly(&mut self, e: Expression) -> TensorIr {
        let mut terms = self.grouped(e.terms);
        // Signs go into additions and subtractions; begin with a positive term.
        if let Some(first) = terms.iter().position(|t| t.factor > 0.0) {
            let first = terms.remove(first);
            terms.insert(0, first);
        }
        let mut sum: Option<TensorIr> = None;
        for mut term in terms {
            let subtract = term.factor < 0.0 && sum.is_some();
            if subtract {
                term.factor = -term.factor;
            }
            let value = self.value(&term);
            sum = Some(match sum {
                None => value,
                Some(sum) if subtract => self.tangent.sub(&sum, &value),
                Some(sum) => self.tangent.add(&sum, &value),
            });
        }
        sum.expect("expressions have at least one term")
    }

    /// Evaluate a term.
    fn value(&mut self, term: &Term) -> TensorIr {
        let Some(p) = &term.coefficient else {
            return self.tangent.scale(&term.atom, term.factor);
        };
        let p = self.primal.scale(p, term.factor);
        self.tangent.emit_one(OperationIr::NumericFloat(
            term.atom.dtype,
            Num::Mul(BinaryOpIr {
                lhs: read_only(&term.atom),
                rhs: read_only(&p),
                out: like(&term.atom),
            }),
        ))
    }

    /// `p ⊙ x ± p ⊙ y` becomes `p ⊙ (x ± y)`, and `k x ± k y` becomes `k (x ± y)`.
    fn grouped(&mut self, terms: Vec<Term>) -> Vec<Term> {
        let alike = |a: &Term, b: &Term| match (&a.coefficient, &b.coefficient) {
            (Some(p), Some(q)) => p.id == q.id,
            (None, None) => {
                let factor = a.factor.abs().to_bits();
                factor == b.factor.abs().to_bits() && factor != 1.0_f64.to_bits()
            }
            _ => false,
        };
        let mut groups: Vec<Vec<Term>> = Vec::new();
        for term in terms {
            match groups.iter_mut().find(|group| alike(&group[0], &term)) {
                Some(group) => group.push(term),
                None => groups.push(vec![term]),
            }
        }
        groups
            .into_iter()
            .map(|mut group| {
                if group.len() == 1 {
                    return group.remove(0);
                }
                let coefficient = group[0].coefficient.clone();
                for term in &mut group {
                    term.coefficient = None;
                }
                let (factor, atom) = self.evaluate(Expression { terms: group });
                Term {
                    factor,
                    coefficient,
                    atom,
                }
            })
            .collect()
    }

    /// The tangent as a tensor, zeros if there is none.
    pub(crate) fn or_zeros(&mut self, t: Tangent, shape: &Shape, dtype: DType) -> TensorIr {
        match t {
            Some(e) => self.exactly(e),
            None => self
                .tangent
                .emit_one(OperationIr::BaseFloat(Base::Zeros(CreationOpIr {
                    out: output(shape.clone(), dtype),
                }))),
        }
    }

    /// Apply an operation that is jointly linear in several arguments: `make` puts the tangents into it.
    pub(crate) fn jointly_linear(
        &mut self,
        arguments: Vec<(Tangent, &TensorIr)>,
        make: impl FnOnce(Vec<TensorIr>) -> OperationIr,
    ) -> Tangent {
        if arguments.iter().all(|(tangent, _)| tangent.is_none()) {
            return None;
        }
        // The factor of the first active argument comes out, and may cancel all others.
        let mut unit = None;
        let arguments = arguments
            .into_iter()
            .map(|(tangent, primal)| {
                let Some(e) = tangent else {
                    return read_only(&self.or_zeros(None, &primal.shape, primal.dtype));
                };
                let (factor, atom) = self.evaluate(e);
                let unit = *unit.get_or_insert(factor);
                read_only(&self.tangent.scale(&atom, factor / unit))
            })
            .collect();
        let out = self.tangent.emit_one(make(arguments));
        Some(Expression::multiple(unit.unwrap_or(1.0), out))
    }

    pub(crate) fn handle(&mut self, e: Expression) -> TensorIr {
        let id = EXPRESSION_IDS + self.expressions.len() as u64;
        let handle = tensor(id, e.first().shape.clone(), e.first().dtype);
        self.expressions.insert(handle.id, e);
        handle
    }

    /// The expression behind a handle, or the tangent tensor itself.
    pub(crate) fn expression(&self, handle: &TensorIr) -> Expression {
        self.expressions
            .get(&handle.id)
            .cloned()
            .unwrap_or_else(|| Expression::atom(handle.clone()))
    }
}

/// Forgets the identifiers of the outputs: a rule may describe them by those of another operation, which is perhaps an input
/// of this one.
fn released(mut operation: CustomOpIr) -> OperationIr {
    operation.outputs = operation.outputs.iter().map(like).collect();
    OperationIr::Custom(operation)
}

/// For rules of custom operations. Tangents are handles to unevaluated expressions: pass them
/// around freely, they cost nothing until an operation needs their values.
impl Builder {
    /// Add an operation to the primal program, which runs once per point, and return its first
    /// output. The identifiers of its outputs are chosen here; an operation that is already in the
    /// program is shared.
    ///
    /// # Panics
    /// If the operation has no outputs.
    pub fn primal(&mut self, operation: CustomOpIr) -> TensorIr {
        self.primal.emit_one(released(operation))
    }

    /// Add an operation to the tangent program and return its first output. The operation must be
    /// jointly linear in the tangents among its inputs.
    ///
    /// # Panics
    /// If the operation has no outputs.
    pub fn tangent(&mut self, operation: CustomOpIr) -> TensorIr {
        let mut operation = released(operation);
        let mut values = HashMap::new();
        for input in operation.inputs() {
            if let Some(e) = self.expressions.get(&input.id).cloned() {
                values.insert(input.id, self.exactly(e));
            }
        }
        rename(&mut operation, &values);
        self.tangent.emit_one(operation)
    }

    /// Elementwise product of a primal tensor with a tangent of the same rank.
    pub fn mul(&mut self, primal: &TensorIr, tangent: &TensorIr) -> TensorIr {
        let e = self.expression(tangent);
        let shape = crate::emit::broadcast(primal, tangent);
        let dtype = tangent.dtype;
        let product = self.times(primal, e, &shape);
        self.tangent_or_zeros(product, &shape, dtype)
    }

    /// Sum of two tangents of the same shape.
    pub fn add(&mut self, a: &TensorIr, b: &TensorIr) -> TensorIr {
        let (x, y) = (self.expression(a), self.expression(b));
        let sum = self.plus(Some(x), Some(y));
        self.tangent_or_zeros(sum, &a.shape, a.dtype)
    }

    /// Multiple of a tangent.
    pub fn scale(&mut self, tangent: &TensorIr, factor: f64) -> TensorIr {
        let e = Self::scaled(Some(self.expression(tangent)), factor);
        self.tangent_or_zeros(e, &tangent.shape, tangent.dtype)
    }

    fn tangent_or_zeros(&mut self, tangent: Tangent, shape: &Shape, dtype: DType) -> TensorIr {
        match tangent {
            Some(e) => self.handle(e),
            None => self.or_zeros(None, shape, dtype),
        }
    }
}

/// Tangents of the outputs of an operation, in their order; none is zero.
pub type Tangents = Result<Vec<Option<TensorIr>>, Error>;

/// Rule of operations that are linear in each input separately: convolutions, transforms, products.
///
/// The tangent is the sum over the active inputs of the operation with that input replaced by its
/// tangent.
#[expect(clippy::missing_errors_doc, reason = "it is a rule")]
pub fn multilinear(
    operation: &CustomOpIr,
    tangents: &[Option<TensorIr>],
    build: &mut Builder,
) -> Tangents {
    let mut sums: Vec<Tangent> = vec![None; operation.outputs.len()];
    for (i, tangent) in tangents.iter().enumerate() {
        let Some(tangent) = tangent else { continue };
        let e = build.expression(tangent);
        let (factor, atom) = build.evaluate(e);
        let mut replaced = operation.clone();
        replaced.inputs[i] = read_only(&atom);
        let outputs = build.tangent.emit(OperationIr::Custom(replaced));
        for (sum, out) in sums.iter_mut().zip(outputs) {
            *sum = build.plus(sum.take(), Some(Expression::multiple(factor, out)));
        }
    }
    let handles = sums.into_iter().map(|sum| sum.map(|e| build.handle(e)));
    Ok(handles.collect())
}
