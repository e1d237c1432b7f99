//! Parts of a case that are one's own, not the library's.

use std::sync::Arc;

use serde_json::{Map, Value, json};
use solver::{EnergyTerm, EnergyTerms, Identity, Scheme};

use crate::{Case, Controller, Error, StopRule};

/// Makes a scheme, which keeps what it prepares from step to step: every run has one of its own.
pub type MakeScheme<const D: usize> = Arc<dyn Fn() -> Box<dyn Scheme<D>> + Send + Sync>;

/// Makes the controller of a run of a case.
pub type MakeController<const D: usize> =
    Arc<dyn Fn(&Case<D>) -> Result<Box<dyn Controller<D>>, Error> + Send + Sync>;

/// Parts of a case that are one's own; none by default. A run with them has all that the loop offers. It is resumed by a program that has them, too.
#[derive(Clone, Default)]
pub struct Own<const D: usize> {
    /// Terms of the energy of Willmore flow, beside those of the case.
    pub terms: EnergyTerms<D>,
    /// In place of the scheme that [`TimeSteps::order`](crate::TimeSteps::order) names.
    pub scheme: Option<MakeScheme<D>>,
    /// In place of the [`StepControl`](crate::StepControl) of the case's time steps.
    pub controller: Option<MakeController<D>>,
    /// Beside the stop rules of the case.
    pub stops: Vec<Arc<dyn StopRule<D>>>,
}

impl<const D: usize> Own<D> {
    /// Adds a term of the energy.
    #[must_use]
    pub fn with_term(mut self, term: impl EnergyTerm<D> + 'static) -> Self {
        self.terms.push(Arc::new(term));
        self
    }

    /// Takes a scheme.
    #[must_use]
    pub fn with_scheme<S: Scheme<D> + 'static>(
        mut self,
        make: impl Fn() -> S + Send + Sync + 'static,
    ) -> Self {
        self.scheme = Some(Arc::new(move || Box::new(make())));
        self
    }

    /// Takes a controller.
    #[must_use]
    pub fn with_controller<C: Controller<D> + 'static>(
        mut self,
        make: impl Fn(&Case<D>) -> Result<C, Error> + Send + Sync + 'static,
    ) -> Self {
        self.controller = Some(Arc::new(move |case| Ok(Box::new(make(case)?))));
        self
    }

    /// Adds a stop rule.
    #[must_use]
    pub fn with_stop(mut self, rule: impl StopRule<D> + 'static) -> Self {
        self.stops.push(Arc::new(rule));
        self
    }

    /// The names of these parts, for the identity of a case.
    pub(crate) fn identity(&self, case: &Case<D>) -> Map<String, Value> {
        let mut identity = Map::new();
        if !self.terms.is_empty() {
            let terms: Vec<Identity> = self.terms.iter().map(|term| term.identity()).collect();
            identity.insert("own_terms".to_owned(), json!(terms));
            identity.insert("response".to_owned(), json!(case.operator.response));
        }
        if let Some(make) = &self.scheme {
            identity.insert("own_scheme".to_owned(), json!(make().name()));
        }
        if let Some(make) = &self.controller {
            let of_controller = make(case).map_or(Value::Null, |made| made.identity());
            identity.insert("own_controller".to_owned(), of_controller);
        }
        if !self.stops.is_empty() {
            let names: Vec<String> = self.stops.iter().map(|rule| rule.name()).collect();
            identity.insert("own_stops".to_owned(), json!(names));
        }
        identity
    }
}

impl<const D: usize> std::fmt::Debug for Own<D> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let stops: Vec<String> = self.stops.iter().map(|rule| rule.name()).collect();
        let terms: Vec<Identity> = self.terms.iter().map(|term| term.identity()).collect();
        f.debug_struct("Own")
            .field("terms", &terms)
            .field(
                "scheme",
                &self.scheme.as_ref().map(|make| make().name().to_owned()),
            )
            .field("controller", &self.controller.is_some())
            .field("stops", &stops)
            .finish()
    }
}
