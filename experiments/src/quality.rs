//! The quality of networks as table and metrics.

use model::Quality;
use report::{Column, Format, Summary, Table};

use crate::Error;

/// An empty quality table; `head` names the first columns, which hold text.
pub fn table(head: &[&str]) -> Table {
    let loss = |name: &str| Column::number(name, Format::Scientific(2));
    Table::new(head.iter().map(|&name| Column::text(name)).chain([
        loss("held-out loss"),
        loss("loss of -u"),
        loss("identity"),
        loss("reference loss"),
        loss("reference, -u"),
        Column::number("transfer min", Format::Fixed(5)),
        Column::number("transfer max", Format::Fixed(5)),
        loss("|F(±1) ∓ 1|"),
        loss("roughness of F''"),
        loss("radial asymmetry"),
    ]))
}

/// Adds a row to [`table`].
///
/// # Errors
/// [`Error::Report`] if a number is not finite or `head` has the wrong length.
pub fn push(table: &mut Table, head: &[&str], quality: &Quality) -> Result<(), Error> {
    let numbers = [
        quality.held_out_loss,
        quality.flipped_loss,
        quality.identity_loss,
        quality.reference_loss,
        quality.reference_flipped_loss,
        quality.transfer_min,
        quality.transfer_max,
        quality.phase_defect,
        quality.activation_roughness,
        quality.radial_asymmetry,
    ];
    let head = head.iter().map(|&text| text.into());
    table.push(head.chain(numbers.map(Into::into)))?;
    Ok(())
}

/// Adds the quality to a summary as `<key>.held_out_loss` and so on.
///
/// # Errors
/// [`Error::Report`] if a number is not finite.
pub fn insert(summary: &mut Summary, key: &str, quality: &Quality) -> Result<(), Error> {
    for (name, value) in [
        ("held_out_loss", quality.held_out_loss),
        ("flipped_loss", quality.flipped_loss),
        ("identity_loss", quality.identity_loss),
        ("reference_loss", quality.reference_loss),
        ("reference_flipped_loss", quality.reference_flipped_loss),
        ("transfer_min", quality.transfer_min),
        ("transfer_max", quality.transfer_max),
        ("transfer_imaginary", quality.transfer_imaginary),
        ("phase_defect", quality.phase_defect),
        ("activation_roughness", quality.activation_roughness),
        ("radial_asymmetry", quality.radial_asymmetry),
    ] {
        summary.insert(&format!("{key}.{name}"), value)?;
    }
    Ok(())
}
