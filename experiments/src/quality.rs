//! The quality of networks as columns of a table; its metrics are all fields of [`Quality`].

use model::{Network, Quality};

use crate::prelude::*;
use crate::training::{NetworkSpec, held_out_radii};

const LOSS: Format = Format::Scientific(2);
const TRANSFER: Format = Format::Fixed(5);

const COLUMNS: [(&str, Format, fn(&Quality) -> f64); 10] = [
    ("held-out loss", LOSS, |q| q.held_out_loss),
    ("loss of -u", LOSS, |q| q.flipped_loss),
    ("identity", LOSS, |q| q.identity_loss),
    ("reference loss", LOSS, |q| q.reference_loss),
    ("reference, -u", LOSS, |q| q.reference_flipped_loss),
    ("transfer min", TRANSFER, |q| q.transfer_min),
    ("transfer max", TRANSFER, |q| q.transfer_max),
    ("|F(±1) ∓ 1|", LOSS, |q| q.phase_defect),
    ("roughness of F''", LOSS, |q| q.activation_roughness),
    ("radial asymmetry", LOSS, |q| q.radial_asymmetry),
];

/// Measures a network on spheres that it was not trained on; adds the metrics.
pub fn measure(session: &mut Session, spec: &NetworkSpec, network: &Network) -> Result<Quality> {
    let (data, radii) = (spec.data(false)?, held_out_radii(session.options.quick));
    let quality = session.phase(format!("quality of {}", spec.name), |stage| {
        Ok(Quality::measure(network, &data, radii, stage.device)?)
    })?;
    session.summary.insert_record(spec.name, &quality)?;
    Ok(quality)
}

pub fn columns<'a, R>(sheet: Sheet<'a, R>, of: impl Fn(&'a R) -> &'a Quality) -> Sheet<'a, R> {
    let add = |sheet: Sheet<'a, R>, (head, format, value): (_, _, fn(&Quality) -> f64)| {
        sheet.column::<f64>(head, format, |row| value(of(row)))
    };
    COLUMNS.into_iter().fold(sheet, add)
}
