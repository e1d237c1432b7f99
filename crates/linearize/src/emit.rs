//! Value numbering: every operation enters a program through an [`Emitter`], which shares common
//! subexpressions and applies the algebra that Burn's gradients leave undone: products with ones,
//! sums with zeros, scalars spread over a whole grid.

use std::collections::HashMap;
use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};

use burn::backend::ir::{
    BaseOperationIr as Base, BinaryOpIr, CreationOpIr, FloatOperationIr as Float, FullOpIr,
    NumericOperationIr as Num, OperationIr, ScalarIr, ScalarOpIr, ShapeOpIr, TensorId, TensorIr,
    UnaryOpIr,
};
use burn::tensor::{DType, Shape};

use crate::ir::{detach_outputs, like, output, read_only, rename, tensor};

/// A tensor all of whose elements are `factor` times the one element of `scalar` (one if absent).
#[derive(Clone)]
struct Uniform {
    factor: f64,
    scalar: Option<TensorIr>,
}

/// Builds one program.
#[derive(Default)]
pub(crate) struct Emitter {
    next: u64,
    operations: Vec<OperationIr>,
    /// Operations without output identifiers, and their outputs, by hash.
    seen: HashMap<u64, Vec<(OperationIr, Vec<TensorIr>)>>,
    producer: HashMap<TensorId, usize>,
    uniform: HashMap<TensorId, Uniform>,
}

impl Emitter {
    pub(crate) fn new(first_id: u64) -> Self {
        Self {
            next: first_id,
            ..Self::default()
        }
    }

    pub(crate) fn into_operations(self) -> Vec<OperationIr> {
        self.operations
    }

    pub(crate) fn fresh(&mut self, shape: Shape, dtype: DType) -> TensorIr {
        let id = self.next;
        self.next += 1;
        tensor(id, shape, dtype)
    }

    /// Emit an operation unless it is already there and gives the same numbers again. Output identifiers are chosen here.
    pub(crate) fn emit(&mut self, mut operation: OperationIr) -> Vec<TensorIr> {
        sort_operands(&mut operation);
        detach_outputs(&mut operation);
        let hash = hash(&operation);
        if !is_random(&operation)
            && let Some(outputs) = self.find(hash, &operation)
        {
            return outputs.to_vec();
        }
        let key = operation.clone();
        let outputs: Vec<TensorIr> = (key.outputs())
            .map(|out| self.fresh(out.shape.clone(), out.dtype))
            .collect();
        let detached = key.outputs().map(|out| out.id);
        let fresh = detached.zip(outputs.iter().cloned()).collect();
        rename(&mut operation, &fresh);
        for out in &outputs {
            self.producer.insert(out.id, self.operations.len());
        }
        self.note_uniform(&operation);
        self.operations.push(operation);
        self.seen
            .entry(hash)
            .or_default()
            .push((key, outputs.clone()));
        outputs
    }

    fn find(&self, hash: u64, detached: &OperationIr) -> Option<&[TensorIr]> {
        let candidates = self.seen.get(&hash)?;
        let (_, outputs) = candidates.iter().find(|(seen, _)| seen == detached)?;
        Some(outputs)
    }

    /// `factor * t`, if it has been emitted.
    fn find_multiple(&self, t: &TensorIr, factor: f64) -> Option<TensorIr> {
        let multiple = Num::MulScalar(by_number(t, ScalarIr::Float(factor)));
        let mut operation = OperationIr::NumericFloat(t.dtype, multiple);
        detach_outputs(&mut operation);
        let outputs = self.find(hash(&operation), &operation)?;
        outputs.first().cloned()
    }

    /// [`emit`](Self::emit) for operations with one output.
    pub(crate) fn emit_one(&mut self, operation: OperationIr) -> TensorIr {
        self.emit(operation).swap_remove(0)
    }

    /// Emit a captured operation through the simplifying constructors.
    pub(crate) fn simplify(&mut self, operation: OperationIr) -> Vec<TensorIr> {
        let one = match &operation {
            OperationIr::NumericFloat(_, op) => match op {
                Num::Add(b) => self.add(&b.lhs, &b.rhs),
                Num::Sub(b) => self.sub(&b.lhs, &b.rhs),
                Num::Mul(b) => self.mul(&b.lhs, &b.rhs),
                Num::Div(b) => self.div(&b.lhs, &b.rhs),
                Num::Neg(u) => self.neg(&u.input),
                Num::MulScalar(s) => self.scale(&s.lhs, s.rhs.elem()),
                Num::AddScalar(s) => self.shift(&s.lhs, s.rhs.elem()),
                Num::SubScalar(s) => self.shift(&s.lhs, -s.rhs.elem::<f64>()),
                Num::DivScalar(s) if self.constant(&s.lhs).is_some() => {
                    self.scale(&s.lhs, 1.0 / s.rhs.elem::<f64>())
                }
                Num::PowiScalar(s) => self.powi(&s.lhs, s.rhs.elem()),
                Num::Full(f) => self.full(f.out.shape.clone(), f.out.dtype, f.value.elem()),
                Num::SumDim(r) | Num::MeanDim(r) if r.input.shape[r.axis] == 1 => r.input.clone(),
                _ => return self.emit(operation),
            },
            OperationIr::Float(_, Float::PowfScalar(s)) => self.powf(&s.lhs, s.rhs.elem()),
            OperationIr::BaseFloat(Base::Reshape(r)) => self.reshape(&r.input, r.out.shape.clone()),
            OperationIr::BaseFloat(Base::Expand(e)) => self.expand(&e.input, e.out.shape.clone()),
            OperationIr::BaseFloat(Base::Cast(c)) if c.input.dtype == c.out.dtype => {
                c.input.clone()
            }
            _ => return self.emit(operation),
        };
        vec![one]
    }

    fn note_uniform(&mut self, operation: &OperationIr) {
        let constant = |factor: f64| Uniform {
            factor,
            scalar: None,
        };
        let of_input = || {
            let input = operation.inputs().next()?;
            self.uniform.get(&input.id).cloned()
        };
        let noted = match operation {
            OperationIr::BaseFloat(op) => match op {
                Base::Zeros(_) => Some(constant(0.0)),
                Base::Ones(_) => Some(constant(1.0)),
                Base::Expand(s) => self.uniform_or_single(&s.input),
                Base::Reshape(_)
                | Base::Permute(_)
                | Base::SwapDims(_)
                | Base::Flip(_)
                | Base::Slice(_) => of_input(),
                _ => None,
            },
            OperationIr::NumericFloat(_, Num::Full(f)) => Some(constant(f.value.elem())),
            _ => None,
        };
        if let (Some(uniform), Some(out)) = (noted, operation.outputs().next()) {
            self.uniform.insert(out.id, uniform);
        }
    }

    fn uniform_or_single(&self, t: &TensorIr) -> Option<Uniform> {
        self.uniform.get(&t.id).cloned().or_else(|| {
            (t.shape.num_elements() == 1).then(|| Uniform {
                factor: 1.0,
                scalar: Some(t.clone()),
            })
        })
    }

    /// The value of a tensor that is the same known number everywhere.
    pub(crate) fn constant(&self, t: &TensorIr) -> Option<f64> {
        let uniform = self.uniform.get(&t.id)?;
        uniform.scalar.is_none().then_some(uniform.factor)
    }

    /// A tensor with one element that broadcasts to `t`, if `t` is uniform; otherwise `t`.
    pub(crate) fn compact(&mut self, t: &TensorIr) -> TensorIr {
        let rank = t.shape.num_dims();
        match self.uniform.get(&t.id).cloned() {
            Some(uniform) if t.shape.num_elements() > 1 => self.single(&uniform, rank, t.dtype),
            _ => t.clone(),
        }
    }

    fn single(&mut self, uniform: &Uniform, rank: usize, dtype: DType) -> TensorIr {
        let shape = Shape::from(vec![1; rank]);
        match &uniform.scalar {
            None => self.full(shape, dtype, uniform.factor),
            Some(scalar) => {
                let scaled = self.scale(scalar, uniform.factor);
                self.reshape(&scaled, shape)
            }
        }
    }

    pub(crate) fn full(&mut self, shape: Shape, dtype: DType, value: f64) -> TensorIr {
        let out = output(shape, dtype);
        self.emit_one(if value == 0.0 {
            OperationIr::BaseFloat(Base::Zeros(CreationOpIr { out }))
        } else if is(value, 1.0) {
            OperationIr::BaseFloat(Base::Ones(CreationOpIr { out }))
        } else {
            let value = ScalarIr::Float(value);
            OperationIr::NumericFloat(dtype, Num::Full(FullOpIr { out, value }))
        })
    }

    pub(crate) fn reshape(&mut self, t: &TensorIr, shape: Shape) -> TensorIr {
        match self.definition(t) {
            Some(OperationIr::BaseFloat(Base::Reshape(inner))) if t.shape != shape => {
                let input = inner.input.clone();
                self.reshape(&input, shape)
            }
            _ => self.shaped(t, shape, Base::Reshape),
        }
    }

    pub(crate) fn expand(&mut self, t: &TensorIr, shape: Shape) -> TensorIr {
        self.shaped(t, shape, Base::Expand)
    }

    fn shaped(&mut self, t: &TensorIr, shape: Shape, variant: fn(ShapeOpIr) -> Base) -> TensorIr {
        if t.shape == shape {
            return t.clone();
        }
        if let Some(value) = self.constant(t) {
            return self.full(shape, t.dtype, value);
        }
        let (input, out) = (read_only(t), output(shape, t.dtype));
        self.emit_one(OperationIr::BaseFloat(variant(ShapeOpIr { input, out })))
    }

    fn definition(&self, t: &TensorIr) -> Option<&OperationIr> {
        self.producer.get(&t.id).map(|i| &self.operations[*i])
    }

    /// The tensor of which `t` is the negative, if it is one.
    fn negated(&self, t: &TensorIr) -> Option<TensorIr> {
        match self.definition(t)? {
            OperationIr::NumericFloat(_, Num::Neg(neg)) => Some(neg.input.clone()),
            _ => None,
        }
    }

    /// If both operands are uniform, `combine` on single elements, spread over `shape`.
    fn on_single_elements(
        &mut self,
        a: &TensorIr,
        b: &TensorIr,
        shape: &Shape,
        combine: fn(&mut Self, &TensorIr, &TensorIr) -> TensorIr,
    ) -> Option<TensorIr> {
        if shape.num_elements() <= 1 {
            return None;
        }
        let uniforms = [self.uniform_or_single(a)?, self.uniform_or_single(b)?];
        let rank = shape.num_dims();
        let [a, b] = uniforms.map(|uniform| self.single(&uniform, rank, a.dtype));
        let single = combine(self, &a, &b);
        Some(self.expand(&single, shape.clone()))
    }

    pub(crate) fn mul(&mut self, a: &TensorIr, b: &TensorIr) -> TensorIr {
        let shape = broadcast(a, b);
        if let Some(uniform) = self.on_single_elements(a, b, &shape, Self::mul) {
            return uniform;
        }
        for (a, b) in [(a, b), (b, a)] {
            if let Some(value) = self.constant(a)
                && b.shape == shape
            {
                return self.scale(b, value);
            }
        }
        self.binary(a, b, shape, Num::Mul)
    }

    pub(crate) fn add(&mut self, a: &TensorIr, b: &TensorIr) -> TensorIr {
        let shape = broadcast(a, b);
        if let Some(uniform) = self.on_single_elements(a, b, &shape, Self::add) {
            return uniform;
        }
        for (a, b) in [(a, b), (b, a)] {
            if let Some(value) = self.constant(a)
                && b.shape == shape
            {
                return self.shift(b, value);
            }
        }
        if a.id == b.id {
            return self.scale(a, 2.0);
        }
        for (a, b) in [(a, b), (b, a)] {
            if let Some(negated) = self.negated(b) {
                return self.sub(a, &negated);
            }
        }
        self.binary(a, b, shape, Num::Add)
    }

    pub(crate) fn sub(&mut self, a: &TensorIr, b: &TensorIr) -> TensorIr {
        let shape = broadcast(a, b);
        if let Some(uniform) = self.on_single_elements(a, b, &shape, Self::sub) {
            return uniform;
        }
        if let Some(value) = self.constant(b)
            && a.shape == shape
        {
            return self.shift(a, -value);
        }
        if self.constant(a) == Some(0.0) && b.shape == shape {
            return self.neg(b);
        }
        if a.id == b.id {
            return self.full(shape, a.dtype, 0.0);
        }
        if let Some(negated) = self.negated(b) {
            return self.add(a, &negated);
        }
        self.binary(a, b, shape, Num::Sub)
    }

    pub(crate) fn div(&mut self, a: &TensorIr, b: &TensorIr) -> TensorIr {
        let shape = broadcast(a, b);
        if let Some(uniform) = self.on_single_elements(a, b, &shape, Self::div) {
            return uniform;
        }
        if let (Some(x), Some(y)) = (self.constant(a), self.constant(b)) {
            return self.full(shape, a.dtype, x / y);
        }
        if let Some(value) = self.constant(b)
            && a.shape == shape
        {
            return if is(value, 1.0) {
                a.clone()
            } else {
                self.scalar(a, ScalarIr::Float(value), Num::DivScalar)
            };
        }
        self.binary(a, b, shape, Num::Div)
    }

    pub(crate) fn neg(&mut self, t: &TensorIr) -> TensorIr {
        self.scale(t, -1.0)
    }

    /// `factor * t`
    pub(crate) fn scale(&mut self, t: &TensorIr, factor: f64) -> TensorIr {
        if is(factor, 1.0) {
            return t.clone();
        }
        if let Some(value) = self.constant(t) {
            return self.full(t.shape.clone(), t.dtype, factor * value);
        }
        if t.shape.num_elements() > 1
            && let Some(mut uniform) = self.uniform.get(&t.id).cloned()
        {
            uniform.factor *= factor;
            let single = self.single(&uniform, t.shape.num_dims(), t.dtype);
            return self.expand(&single, t.shape.clone());
        }
        if let Some(negated) = self.negated(t) {
            return self.scale(&negated, -factor);
        }
        match self.definition(t) {
            Some(OperationIr::NumericFloat(_, Num::MulScalar(inner))) if !is(factor, -1.0) => {
                let (input, inner) = (inner.lhs.clone(), inner.rhs.elem::<f64>());
                self.scale(&input, factor * inner)
            }
            // The factor of a spread scalar goes into the scalar.
            Some(OperationIr::NumericFloat(_, Num::Mul(product)))
                if t.shape.num_elements() > 1
                    && !is(factor, -1.0)
                    && has_one_element(product).is_some() =>
            {
                let (single, other) = has_one_element(product).expect("checked by the guard");
                let (single, other) = (single.clone(), other.clone());
                let single = self.scale(&single, factor);
                self.mul(&other, &single)
            }
            _ if is(factor, -1.0) => self.numeric(t, Num::Neg),
            // Negatives of what is there vanish in differences.
            _ => match self.find_multiple(t, -factor) {
                Some(opposite) => self.neg(&opposite),
                None => self.scalar(t, ScalarIr::Float(factor), Num::MulScalar),
            },
        }
    }

    /// `t + value`
    pub(crate) fn shift(&mut self, t: &TensorIr, value: f64) -> TensorIr {
        if value == 0.0 {
            return t.clone();
        }
        if let Some(constant) = self.constant(t) {
            return self.full(t.shape.clone(), t.dtype, constant + value);
        }
        if let Some(OperationIr::NumericFloat(_, Num::AddScalar(inner))) = self.definition(t) {
            let (input, inner) = (inner.lhs.clone(), inner.rhs.elem::<f64>());
            return self.shift(&input, inner + value);
        }
        self.scalar(t, ScalarIr::Float(value), Num::AddScalar)
    }

    /// Integer power; small ones become products.
    pub(crate) fn powi(&mut self, t: &TensorIr, exponent: i64) -> TensorIr {
        match exponent {
            0 => self.full(t.shape.clone(), t.dtype, 1.0),
            1 => t.clone(),
            2 => self.mul(t, t),
            3 | 4 => {
                let square = self.mul(t, t);
                let rest = if exponent == 3 { t } else { &square };
                self.mul(&square, rest)
            }
            -1 => self.unary(t, Float::Recip),
            _ => self.scalar(t, ScalarIr::Int(exponent), Num::PowiScalar),
        }
    }

    pub(crate) fn powf(&mut self, t: &TensorIr, exponent: f64) -> TensorIr {
        if exponent.fract() == 0.0 && exponent.abs() < 1e6 {
            return self.powi(t, exponent as i64);
        }
        self.emit_one(OperationIr::Float(
            t.dtype,
            Float::PowfScalar(by_number(t, ScalarIr::Float(exponent))),
        ))
    }

    pub(crate) fn unary(&mut self, t: &TensorIr, variant: fn(UnaryOpIr) -> Float) -> TensorIr {
        self.emit_one(OperationIr::Float(t.dtype, variant(of_one(t))))
    }

    pub(crate) fn numeric(&mut self, t: &TensorIr, variant: fn(UnaryOpIr) -> Num) -> TensorIr {
        self.emit_one(OperationIr::NumericFloat(t.dtype, variant(of_one(t))))
    }

    fn scalar(
        &mut self,
        t: &TensorIr,
        number: ScalarIr,
        variant: fn(ScalarOpIr) -> Num,
    ) -> TensorIr {
        let operation = variant(by_number(t, number));
        self.emit_one(OperationIr::NumericFloat(t.dtype, operation))
    }

    /// Uniform operands shrink to one element where the other operand already has the full shape.
    fn binary(
        &mut self,
        a: &TensorIr,
        b: &TensorIr,
        shape: Shape,
        variant: fn(BinaryOpIr) -> Num,
    ) -> TensorIr {
        let (mut lhs, mut rhs) = (read_only(a), read_only(b));
        if b.shape == shape && self.uniform.contains_key(&a.id) {
            lhs = read_only(&self.compact(a));
        } else if a.shape == shape && self.uniform.contains_key(&b.id) {
            rhs = read_only(&self.compact(b));
        }
        let out = output(shape, a.dtype);
        let operation = variant(BinaryOpIr { lhs, rhs, out });
        self.emit_one(OperationIr::NumericFloat(a.dtype, operation))
    }
}

fn is_random(operation: &OperationIr) -> bool {
    matches!(
        operation,
        OperationIr::Float(_, Float::Random(_)) | OperationIr::NumericInt(_, Num::IntRandom(_))
    )
}

fn is(value: f64, number: f64) -> bool {
    value.to_bits() == number.to_bits()
}

fn of_one(t: &TensorIr) -> UnaryOpIr {
    UnaryOpIr {
        input: read_only(t),
        out: like(t),
    }
}

fn by_number(t: &TensorIr, number: ScalarIr) -> ScalarOpIr {
    ScalarOpIr {
        lhs: read_only(t),
        rhs: number,
        out: like(t),
    }
}

/// Shape of an elementwise operation of two tensors of equal rank.
pub(crate) fn broadcast(a: &TensorIr, b: &TensorIr) -> Shape {
    let axes = a.shape.iter().zip(b.shape.iter());
    Shape::from(
        axes.map(|(x, y)| if *x == 1 { *y } else { *x })
            .collect::<Vec<_>>(),
    )
}

fn hash(operation: &OperationIr) -> u64 {
    let mut hasher = DefaultHasher::new();
    operation.hash(&mut hasher);
    hasher.finish()
}

/// The operand with one element, and the other.
fn has_one_element(product: &BinaryOpIr) -> Option<(&TensorIr, &TensorIr)> {
    if product.rhs.shape.num_elements() == 1 {
        Some((&product.rhs, &product.lhs))
    } else if product.lhs.shape.num_elements() == 1 {
        Some((&product.lhs, &product.rhs))
    } else {
        None
    }
}

/// Commutative operands in one order, youngest first: it is the likeliest to be reused in place.
fn sort_operands(operation: &mut OperationIr) {
    if let OperationIr::NumericFloat(_, Num::Add(op) | Num::Mul(op))
    | OperationIr::NumericInt(_, Num::Add(op) | Num::Mul(op)) = operation
        && op.lhs.id < op.rhs.id
    {
        std::mem::swap(&mut op.lhs, &mut op.rhs);
    }
}
