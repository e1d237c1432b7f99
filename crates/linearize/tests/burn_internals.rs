//! Pins what this crate needs of Burn below its stable surface: reverse mode on the capture
//! backend, through the concrete type `Autodiff<Capture>`. When a new version of Burn breaks one of
//! these tests, tracing has to change.

use burn::backend::autodiff::Autodiff;
use burn::backend::capture::CaptureBackend;
use burn::backend::ir::OperationIr;
use burn::backend::tensor::FloatTensor;
use burn::tensor::{DType, Device, FloatDType, Tensor, TensorData};

type Tracked = Autodiff<CaptureBackend>;

fn data() -> TensorData {
    TensorData::from([1.0_f64, 2.0, 3.0])
}

#[test]
fn reverse_mode_runs_on_capture_tensors() {
    let device = Device::capture();
    let captured = device
        .capture_scope(|scope| {
            let symbol = Tensor::<1>::from_data(data(), (&device, DType::F64))
                .try_into_primitive::<CaptureBackend>()
                .unwrap();
            let input = symbol.id();
            let leaf = FloatTensor::<Tracked>::new(symbol).require_grad();
            let x = Tensor::<1>::from_primitive::<Tracked>(leaf.clone());
            let energy = (x.clone() * x)
                .sum()
                .try_into_primitive::<Tracked>()
                .unwrap();
            let gradients = energy.backward();
            let gradient = leaf
                .grad(&gradients)
                .expect("the energy depends on its input");
            let output = gradient.id();
            let completed = scope.complete([input], [output]);
            drop(gradient);
            completed
        })
        .unwrap();
    assert!(captured.graph.operations.len() >= 3);
    assert!(
        captured
            .graph
            .operations
            .iter()
            .all(|op| !matches!(op, OperationIr::Drop(_)))
    );
    let out = captured.graph.outputs[0];
    let dtype = captured
        .graph
        .operations
        .iter()
        .flat_map(OperationIr::outputs)
        .find(|t| t.id == out)
        .map(|t| t.dtype);
    assert_eq!(dtype, Some(DType::F64), "precision is lost on the way");
}

#[test]
fn capture_devices_take_a_float_type_inside_a_scope() {
    let device = Device::capture();
    device
        .capture_scope(|scope| {
            device.clone().configure(FloatDType::F64).unwrap();
            assert_eq!(Tensor::<1>::zeros([2], &device).dtype(), DType::F64);
            scope.complete([], [])
        })
        .unwrap();
}

#[cfg(feature = "flex")]
#[test]
fn captured_operations_replay_on_a_backend() {
    use burn::backend::ir::{HandleKind, TensorIr, TensorStatus};
    use burn::backend::{Flex, FlexDevice};
    use burn_router::TensorInterpreter;

    let device = Device::capture();
    let captured = device
        .capture_scope(|scope| {
            let x = Tensor::<1>::from_data(data(), (&device, DType::F64));
            let y = x.clone() * x.clone();
            let id = |t: &Tensor<1>| {
                t.clone()
                    .try_into_primitive::<CaptureBackend>()
                    .unwrap()
                    .id()
            };
            let (input, output) = (id(&x), id(&y));
            let completed = scope.complete([input], [output]);
            drop(y);
            completed
        })
        .unwrap();
    let mut interpreter = TensorInterpreter::<Flex>::new(FlexDevice);
    for (id, value) in &captured.values {
        interpreter.register_tensor_data_id(*id, value.clone());
    }
    let mut output = None;
    for operation in captured.graph.operations {
        output = operation.outputs().next().cloned();
        interpreter.register_op(operation);
    }
    let output = TensorIr {
        status: TensorStatus::ReadOnly,
        ..output.unwrap()
    };
    let HandleKind::Float(result) = interpreter.get_tensor(&output) else {
        panic!("a float tensor went in")
    };
    let result = Tensor::<1>::from_primitive::<Flex>(result).into_data();
    result.assert_eq(&TensorData::from([1.0_f64, 4.0, 9.0]), true);
}
