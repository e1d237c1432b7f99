//! What is kept with a run besides its state.

use serde::de::DeserializeOwned;

use crate::prelude::*;

/// What is kept with a run besides its state.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RunNotes {
    /// Where it comes from.
    pub about: About,
    /// How its shape is shown.
    pub(crate) presentation: Value,
    /// The extensions of files with its shape, before the end and there.
    pub extensions: [String; 2],
    /// The steps to which it was extended.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steps: Option<usize>,
    /// Whether it was over before it was extended.
    #[serde(default, skip_serializing_if = "is_false")]
    pub was_over: bool,
}

/// Where a run comes from.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct About {
    /// The name of the job.
    pub command: String,
    /// The name of the shape.
    pub name: String,
    /// The program and its version.
    pub program: String,
    /// The network, if there is one.
    pub network: Option<NetworkNote>,
    /// The device and its precision.
    pub device: String,
}

/// A network by its name and its weights.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct NetworkNote {
    /// Its name.
    pub name: String,
    /// A checksum of its weights.
    pub checksum: String,
}

fn parsed<T: DeserializeOwned>(value: &Value, stored: &StoredRun) -> Result<T> {
    T::deserialize(value).map_err(|reason| {
        let path = stored.path().to_owned();
        Error::OtherNotes { path, reason }
    })
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
fn is_false(value: &bool) -> bool {
    !value
}

impl RunNotes {
    /// Those of a stored run.
    ///
    /// # Errors
    /// A folder of another program.
    pub fn of(stored: &StoredRun) -> Result<Self> {
        parsed(engine::notes(stored), stored)
    }

    /// How its shape is shown.
    pub(crate) fn presentation<P: DeserializeOwned>(&self, stored: &StoredRun) -> Result<P> {
        parsed(&self.presentation, stored)
    }

    pub(crate) fn to_json(&self) -> Value {
        serde_json::to_value(self).unwrap_or_default()
    }
}
