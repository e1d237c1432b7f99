//! What parts of a flow are called.

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// The name of a part of a flow, and the parameters that tell it from others of this name: flows of the same identities are the same flow. A run
/// is resumed only by what has the identities that it began with.
///
/// ```
/// use serde_json::json;
/// use solver::Identity;
///
/// let identity = Identity::new("gravity", json!({ "g": 9.81 }));
/// assert_ne!(identity, Identity::new("gravity", json!({ "g": 1.62 })));
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    /// What it is called in messages and files.
    pub name: String,
    /// All that its results depend on; of large data a checksum.
    pub parameters: Value,
}

impl Identity {
    /// A name with parameters.
    pub fn new(name: impl Into<String>, parameters: Value) -> Self {
        let name = name.into();
        Self { name, parameters }
    }
}
