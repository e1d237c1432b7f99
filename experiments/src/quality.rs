//! The quality of networks as columns of a table. Its metrics are the fields of [`Quality`].

use model::Quality;
use report::{Format, Tabulated};

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

/// Adds the columns of the quality to a table.
pub fn columns<'a, R>(
    table: Tabulated<'a, R>,
    quality: impl Fn(&'a R) -> &'a Quality,
) -> Tabulated<'a, R> {
    let add = |table: Tabulated<'a, R>, (name, format, value): (_, _, fn(&Quality) -> f64)| {
        table.number::<f64>(name, format, |row| value(quality(row)))
    };
    COLUMNS.into_iter().fold(table, add)
}
