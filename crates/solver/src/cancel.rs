//! An early end of the step that is being made.

use std::sync::Arc;

use crate::Error;

/// Says whether the step that is being made is still wanted; it is unless somebody says otherwise.
///
/// Minimizations ask before every evaluation of their energy, its gradient and a product with its Hessian, direct steps before every convolution. A
/// step that is not wanted any more ends with [`Error::Cancelled`]. Results do not depend on the question.
#[derive(Clone, Default)]
pub struct Cancel(Option<Arc<dyn Fn() -> bool + Send + Sync>>);

impl Cancel {
    /// Ends the step as soon as this is true.
    pub fn when(unwanted: impl Fn() -> bool + Send + Sync + 'static) -> Self {
        Self(Some(Arc::new(unwanted)))
    }

    /// Whether to go on.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if not.
    pub fn check(&self) -> Result<(), Error> {
        match &self.0 {
            Some(unwanted) if unwanted() => Err(Error::Cancelled),
            _ => Ok(()),
        }
    }
}
