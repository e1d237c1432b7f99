//! Forward mode for a function written in Burn: a directional derivative, a Hessian-vector product, and the Taylor test of both.

use burn::tensor::{DType, Device, Tensor, TensorData};
use burn_linearize::{Error, Extensions, Graph, Value};

/// The sum of `log(1 + exp(x_i x_(i+1)))`.
fn function(x: Tensor<1>) -> Tensor<1> {
    let n = x.dims()[0];
    let products = x.clone().narrow(0, 0, n - 1) * x.narrow(0, 1, n - 1);
    (products.exp() + 1.0).log().sum()
}

fn main() -> Result<(), Error> {
    let device = Device::default();
    let tensor =
        |data: [f64; 4]| Tensor::<1>::from_data(TensorData::from(data), (&device, DType::F64));
    let (x, direction) = (tensor([0.3, -1.2, 0.7, 2.0]), tensor([1.0, 0.5, -2.0, 0.1]));
    let extensions = Extensions::new();

    // Jacobian-vector product: the derivative of the function itself.
    let graph = Graph::trace(&[(&x).into()], &[], |inputs| {
        vec![function(inputs.variable(0)).into()]
    })?;
    let mut tangent = graph
        .linearize(&extensions, None)?
        .on(&device, &extensions)?;
    tangent.at(&[(&x).into()], &[])?;
    let slope = tangent.apply(&[(&direction).into()])?[0].to_vec()[0];

    // Hessian-vector product: the derivative of its gradient, forward over reverse.
    let graph = Graph::gradient(&[(&x).into()], &[], |inputs| function(inputs.variable(0)))?;
    let mut hessian = graph
        .linearize(&extensions, None)?
        .on(&device, &extensions)?;
    let at = hessian.at(&[(&x).into()], &[])?;
    let product = hessian.apply(&[(&direction).into()])?[0].to_vec();
    let along = Value::from(&direction).to_vec();
    let curvature: f64 = product.iter().zip(along).map(|(a, b)| a * b).sum();
    println!(
        "value {:.6}, slope {slope:.6}, curvature {curvature:.6}",
        at.value.to_vec()[0]
    );

    // What is left of the Taylor expansion falls by 8 when the step is halved.
    let mut before = None;
    for halvings in 2..8 {
        let t = 0.5_f64.powi(halvings);
        let there = x.clone() + direction.clone() * t;
        let value = hessian.value(&[(&there).into()], &[])?.to_vec()[0];
        let left = value - at.value.to_vec()[0] - t * slope - 0.5 * t * t * curvature;
        println!(
            "t = {t:.4}: remainder {left:10.3e}, {:.2} times smaller",
            before.map_or(f64::NAN, |b: f64| b / left)
        );
        before = Some(left);
    }
    Ok(())
}
