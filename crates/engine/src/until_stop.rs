//! The loop over time steps until a stop rule holds, with observers and checkpoints.

use runs::Interrupt;

use solver::Cancel;

use crate::{Error, Event, Observer, Run, Stop, Store};

impl<const D: usize> Run<D> {
    /// Makes all steps until a stop rule holds, which is returned, or `interrupt` is set, and calls the observers after each. The step that is being
    /// made when that happens is dropped. An interrupted run can be resumed. With a store, checkpoints are written, the last one also when a step fails; the store is left open, so that files
    /// can be added to it.
    ///
    /// # Errors
    /// As [`Self::step`], and the errors of observers and of the store.
    pub fn advance(
        &mut self,
        mut store: Option<&mut Store>,
        observers: &mut [&mut dyn Observer<D>],
        interrupt: &Interrupt,
    ) -> Result<Option<Stop>, Error> {
        if self.records().is_empty() {
            self.tell(store.as_deref_mut(), observers)?;
        }
        let unwanted = interrupt.clone();
        self.set_cancel(Cancel::when(move || unwanted.requested()));
        let ended = self.until_stop(store, observers, interrupt);
        self.set_cancel(Cancel::default());
        ended
    }

    fn until_stop(
        &mut self,
        mut store: Option<&mut Store>,
        observers: &mut [&mut dyn Observer<D>],
        interrupt: &Interrupt,
    ) -> Result<Option<Stop>, Error> {
        loop {
            if let Some(stop) = self.ended() {
                return Ok(Some(stop));
            }
            if let Err(error) = self.step() {
                if matches!(error, Error::Cancelled { .. }) {
                    store.map_or(Ok(()), |store| store.commit(self, true))?;
                    return Ok(None);
                }
                if let Some(store) = store {
                    // What the step says is told, and the checkpoints before this one are there.
                    let _ = store.commit(self, true);
                }
                return Err(error);
            }
            self.tell(store.as_deref_mut(), observers)?;
            let interrupted = interrupt.requested();
            if let Some(store) = &mut store {
                store.commit(self, interrupted)?;
            }
            if interrupted && self.ended().is_none() {
                return Ok(None);
            }
        }
    }

    fn tell(
        &self,
        store: Option<&mut Store>,
        observers: &mut [&mut dyn Observer<D>],
    ) -> Result<(), Error> {
        let mut event = Event {
            run: self,
            directory: store.map(Store::directory),
        };
        observers
            .iter_mut()
            .try_for_each(|observer| observer.observe(&mut event))
    }
}
