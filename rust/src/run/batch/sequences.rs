//! Sequences of steps that members share: those that the first of them takes alone.

use super::sharing::can_share;
use super::{Batch, Member};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// The sequences of a batch, each worked out by the first that asks for it.
#[derive(Default)]
pub(super) struct Sequences(Mutex<Vec<Arc<Shared>>>);

/// One sequence and the index of the member whose it is.
struct Shared {
    leader: usize,
    steps: OnceLock<Steps>,
}

/// The ends of steps, on the input's clock of a run from `start`.
#[derive(Clone)]
pub(super) struct Steps {
    start: f64,
    ends: Arc<Vec<f64>>,
}

impl Steps {
    /// The same for a run from `start`: to the last digit where that is the same, as jumps of the input need it.
    pub(super) fn from(&self, start: f64) -> Arc<Vec<f64>> {
        if start == self.start {
            return self.ends.clone();
        }
        Arc::new(self.ends.iter().map(|t| t - self.start + start).collect())
    }
}

impl Sequences {
    /// The steps of `member`, where steps are shared and follow from a tolerance. Which ones these are does not depend on
    /// who asks first.
    pub(super) fn of(&self, batch: &Batch<'_>, member: &Member<'_>, stop: &AtomicBool) -> Option<Steps> {
        if !batch.shared_steps || !batch.options.method.is_adaptive() {
            return None;
        }
        let shared = {
            let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            match known.iter().find(|s| can_share(batch, &batch.members[s.leader], member)) {
                Some(shared) => shared.clone(),
                None => {
                    let leader = batch.members.iter().position(|m| can_share(batch, m, member))?;
                    let shared = Arc::new(Shared { leader, steps: OnceLock::new() });
                    known.push(shared.clone());
                    shared
                }
            }
        };
        Some(shared.steps.get_or_init(|| lead(batch, &batch.members[shared.leader], stop)).clone())
    }
}

/// The steps of a member alone; until its failure if it fails, from which on the others control their own.
fn lead(batch: &Batch<'_>, member: &Member<'_>, stop: &AtomicBool) -> Steps {
    let start = member.start - batch.inputs[member.input].origin();
    let Ok(simulation) = batch.alone(member) else { return Steps { start, ends: Arc::default() } };
    let mut simulation = simulation.noting();
    if let Some(last) = member.times.last() {
        // Its rows come with its block.
        let _ = simulation.advance(std::slice::from_ref(last), &mut || stop.load(Ordering::Relaxed));
    }
    Steps { start, ends: Arc::new(simulation.noted()) }
}
