//! Networks on disk: safetensors with metadata.

use std::collections::HashMap;
use std::path::Path;

use files::write_atomically;
use files::{Sha256, hexadecimal};
use mean_curvature::Calibration;
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};
use serde::{Deserialize, Serialize};

use crate::mlp::{layout, parameter_count};
use crate::network::Provenance;
use crate::{Error, Mlp, Network, Ratios};

/// Version of the file format, bumped when a reader of the old one would misread the new one.
const FORMAT: &str = "1";

/// Longest header of a file, in bytes; that of a shipped network has two thousand. Parsing takes many times its length.
const LONGEST_HEADER: usize = 1 << 16;

/// Refuses headers that are too long. They come first in a file, after their length; what else can be wrong is found later.
fn check_header(data: &[u8]) -> Result<(), String> {
    let length = data.first_chunk().map(|length| u64::from_le_bytes(*length));
    match length {
        Some(length) if length > LONGEST_HEADER as u64 => Err(format!(
            "its header has {length} bytes, and may have {LONGEST_HEADER}"
        )),
        _ => Ok(()),
    }
}

/// SHA-256 over everything that a network consists of, so that a flipped bit anywhere is noticed.
fn checksum(network: &Network) -> serde_json::Result<String> {
    let mut hash = Sha256::default();
    let about = (
        network.ratios(),
        &network.provenance,
        network.activation().layers(),
    );
    hash.update(serde_json::to_vec(&about)?);
    // Files from before there was a calibration have none, and keep their checksum.
    if let Some(calibration) = &network.calibration {
        hash.update(serde_json::to_vec(calibration)?);
    }
    hash.update(bytes(network.kernel()));
    hash.update(bytes(network.activation().parameters()));
    Ok(hexadecimal(hash.finish()))
}

/// Name of the metadata entry. There is only one: safetensors writes several in random order, and the same network should
/// give the same bytes.
const ENTRY: &str = "network";

#[derive(Serialize, Deserialize)]
struct Metadata {
    format: String,
    ratios: Ratios,
    provenance: Provenance,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    calibration: Option<Calibration>,
    checksum: String,
}

impl Network {
    /// The network as a safetensors file: `kernel` with `D` axes, `activation.N.weight`, `activation.N.bias`, all `F64`,
    /// and one metadata entry `network`: JSON with `format`, `ratios`, `provenance`, the `calibration` if there is one, and a SHA-256
    /// `checksum` of all of it.
    ///
    /// # Errors
    /// [`Error::Weights`] if the metadata cannot be encoded, have losses or a calibration that are not finite, or are longer than a
    /// reader accepts.
    pub fn to_bytes(&self) -> Result<Vec<u8>, Error> {
        let failed = |reason: String| Error::Weights {
            path: "network".into(),
            reason,
        };
        let unencodable = |e: serde_json::Error| failed(e.to_string());
        let of = &self.provenance;
        let losses = [of.training_loss, of.held_out_loss, of.flipped_loss];
        if !losses.iter().all(|loss| loss.is_finite()) {
            return Err(failed(format!("its losses {losses:?} are not finite")));
        }
        if let Some(calibration) = self.calibration.filter(|found| !found.is_finite()) {
            return Err(failed(format!("its {calibration:?} is not finite")));
        }
        let metadata = Metadata {
            format: FORMAT.to_owned(),
            ratios: self.ratios(),
            provenance: self.provenance.clone(),
            calibration: self.calibration,
            checksum: checksum(self).map_err(unencodable)?,
        };
        let metadata = serde_json::to_string(&metadata).map_err(unencodable)?;
        let metadata = HashMap::from([(ENTRY.to_owned(), metadata)]);
        let ratios = self.ratios();
        let parameters = self.activation().parameters();
        let mut arrays = vec![(
            "kernel".to_owned(),
            vec![ratios.width; ratios.dimension],
            bytes(self.kernel()),
        )];
        for (l, layer) in layout(self.activation().layers()).iter().enumerate() {
            arrays.push((
                format!("activation.{l}.weight"),
                vec![layer.inputs, layer.outputs],
                bytes(&parameters[layer.weights..layer.biases]),
            ));
            arrays.push((
                format!("activation.{l}.bias"),
                vec![layer.outputs],
                bytes(&parameters[layer.biases..layer.biases + layer.outputs]),
            ));
        }
        let views = arrays
            .iter()
            .map(|(name, shape, data)| {
                TensorView::new(Dtype::F64, shape.clone(), data)
                    .map(|view| (name.clone(), view))
                    .map_err(|e| failed(e.to_string()))
            })
            .collect::<Result<Vec<_>, _>>()?;
        let data =
            safetensors::serialize(views, Some(metadata)).map_err(|e| failed(e.to_string()))?;
        check_header(&data).map_err(failed)?;
        Ok(data)
    }

    /// Reads a network, checking format, shapes, ratios, the checksum and that every number is finite.
    ///
    /// Memory: at most six times the length of the data and 8 MiB. Nothing runs on a device.
    ///
    /// # Errors
    /// [`Error::Weights`] naming `path` and what is wrong.
    pub fn from_bytes(data: &[u8], path: &Path) -> Result<Self, Error> {
        let failed = |reason: String| Error::Weights {
            path: path.to_owned(),
            reason: files::shortened(&reason, 240),
        };
        check_header(data).map_err(failed)?;
        let file = SafeTensors::deserialize(data)
            .map_err(|e| failed(format!("not a safetensors file ({e})")))?;
        let (_, header) = SafeTensors::read_metadata(data)
            .map_err(|e| failed(format!("damaged header ({e})")))?;
        let metadata = header
            .metadata()
            .as_ref()
            .and_then(|metadata| metadata.get(ENTRY))
            .ok_or_else(|| failed(format!("it has no metadata '{ENTRY}'")))?;
        let Metadata {
            format,
            ratios,
            provenance,
            calibration,
            checksum: expected,
        } = serde_json::from_str(metadata)
            .map_err(|e| failed(format!("its metadata are unreadable ({e})")))?;
        if format != FORMAT {
            return Err(failed(format!(
                "its format is '{format}', this program reads '{FORMAT}'"
            )));
        }
        ratios.validate().map_err(|e| failed(e.to_string()))?;
        let array = |name: &str, shape: Option<&[usize]>| {
            let view = file
                .tensor(name)
                .map_err(|_| failed(format!("it lacks '{name}'")))?;
            if view.dtype() != Dtype::F64 {
                return Err(failed(format!("'{name}' is {:?}, not F64", view.dtype())));
            }
            if shape.is_some_and(|shape| view.shape() != shape) {
                return Err(failed(format!(
                    "'{name}' has shape {:?}, expected {shape:?}",
                    view.shape()
                )));
            }
            let values: Vec<f64> = view
                .data()
                .chunks_exact(8)
                .map(|b| f64::from_le_bytes(std::array::from_fn(|i| b[i])))
                .collect();
            if let Some(i) = values.iter().position(|v| !v.is_finite()) {
                return Err(failed(format!("'{name}' is not finite at entry {i}")));
            }
            Ok((view.shape().to_vec(), values))
        };
        let (_, kernel) = array("kernel", Some(&vec![ratios.width; ratios.dimension]))?;
        let mut layers = vec![1];
        let mut parameters = Vec::new();
        for l in 0.. {
            if file.tensor(&format!("activation.{l}.weight")).is_err() {
                break;
            }
            let (shape, weights) = array(&format!("activation.{l}.weight"), None)?;
            let [inputs, outputs] = shape[..] else {
                return Err(failed(format!("'activation.{l}.weight' is not a matrix")));
            };
            if layers.last() != Some(&inputs) {
                return Err(failed(format!(
                    "'activation.{l}.weight' takes {inputs} inputs, expected {:?}",
                    layers.last()
                )));
            }
            layers.push(outputs);
            parameters.extend(weights);
            parameters.extend(array(&format!("activation.{l}.bias"), Some(&[outputs]))?.1);
        }
        debug_assert_eq!(parameters.len(), parameter_count(&layers));
        let activation = Mlp::new(layers, parameters).map_err(|e| failed(e.to_string()))?;
        let mut network =
            Self::new(ratios, kernel, activation, provenance).map_err(|e| failed(e.to_string()))?;
        network.calibration = calibration;
        if checksum(&network).ok() != Some(expected) {
            return Err(failed(
                "its checksum is wrong: the file was damaged or edited".to_owned(),
            ));
        }
        Ok(network)
    }

    /// Writes the file under a temporary name and renames it.
    ///
    /// # Errors
    /// [`Error::File`]; as [`Self::to_bytes`].
    pub fn save(&self, path: &Path) -> Result<(), Error> {
        let data = self.to_bytes()?;
        Ok(write_atomically(path, |out| out.write_all(&data))?)
    }

    /// Reads a file.
    ///
    /// # Errors
    /// [`Error::File`] if it cannot be read, [`Error::Weights`] if it is not a network.
    pub fn load(path: &Path) -> Result<Self, Error> {
        let data = files::read(path)?;
        Self::from_bytes(&data, path)
    }
}

fn bytes(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}
