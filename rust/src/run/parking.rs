//! Lanes that diverge, parked: the one way in which members of a batch and environments of a fleet fail alone.
//!
//! A lane that diverges is put to where it began, there and after every step from then on, so that it costs nothing and can
//! disturb nobody.

use crate::error::Error;
use crate::integrate::{NOT_FINITE, System};
use crate::plant::Plant;
use crate::real::{Real, all_finite, replace};

/// A plant whose diverged lanes are parked.
#[derive(Clone, Debug)]
pub struct Parking<T> {
    /// The plant.
    pub plant: Plant<T>,
    /// Where lanes are put that have diverged.
    pub parked: Vec<T>,
    /// Why each lane has, if so.
    failures: Vec<Option<Error>>,
    /// What to add to the plant's clock for each lane's own.
    clocks: Vec<f64>,
    any: bool,
    /// Whether a run goes on where no lane can.
    goes_on: bool,
    /// 1 in lanes that go on, 0 in others.
    weight: T,
}

impl<T: Real> Parking<T> {
    /// Lanes of `plant` that are put at `parked` where they diverge. `clocks`: of each lane in use, what to add to the
    /// plant's clock for its own; those beyond repeat the last one.
    pub fn new(plant: Plant<T>, parked: Vec<T>, clocks: Vec<f64>) -> Self {
        let failures = vec![None; clocks.len()];
        Self { plant, parked, failures, clocks, any: false, goes_on: false, weight: T::one() }
    }

    /// The same, to go on also where no lane can: steps are never refused.
    pub fn going_on(self) -> Self {
        Self { goes_on: true, ..self }
    }

    /// Why each lane diverged, if it did.
    pub fn failures(&self) -> &[Option<Error>] {
        &self.failures
    }

    /// Why lane `k` did, if it did; else what ended the run of all.
    pub fn failure(&self, k: usize, common: Option<&Error>) -> Option<Error> {
        self.failures[k].clone().or_else(|| Some(common?.clone().on_clock(self.clocks[k])))
    }

    /// Whether a lane diverged.
    pub fn any(&self) -> bool {
        self.any
    }

    /// All lanes may go on again.
    pub fn release(&mut self) {
        self.failures.fill(None);
        (self.any, self.weight) = (false, T::one());
    }

    #[inline(always)]
    fn park(&self, x: &mut [T]) {
        // Lanes beyond the last one in use repeat it.
        let last = self.failures.len() - 1;
        replace(x, &self.parked, |k| self.failures[k.min(last)].is_some());
    }

    /// Finds the lanes that cannot go on.
    #[cold]
    #[inline(never)]
    fn find(&mut self, t0: f64, x: &[T]) {
        for k in 0..self.failures.len() {
            if self.failures[k].is_some() {
                continue;
            }
            let mut only = self.parked.clone();
            replace(&mut only, x, |j| j == k);
            let finite = (0..x.len()).all(|i| x[i].lane(k).is_finite());
            let reason = if finite { self.plant.objection(&only) } else { Some(NOT_FINITE.to_owned()) };
            self.failures[k] = reason.map(|reason| Error::Simulation { time: t0 + self.clocks[k], reason });
        }
        self.weigh();
    }

    /// Notes which lanes have failed.
    fn weigh(&mut self) {
        self.any = true;
        let last = self.failures.len() - 1;
        self.weight = T::from_lanes(|k| if self.failures[k.min(last)].is_some() { 0.0 } else { 1.0 });
    }
}

impl<T: Real> System<T> for Parking<T> {
    #[inline(always)]
    fn begin_step(&mut self, t0: f64, t1: f64, x0: &[T]) {
        self.plant.begin_step(t0, t1, x0);
    }
    #[inline(always)]
    fn derivative(&mut self, t: f64, x: &[T], dx: &mut [T]) {
        self.plant.derivative(t, x, dx);
    }
    #[inline(always)]
    fn end_step(&mut self, t1: f64, x1: &[T]) {
        self.plant.end_step(t1, x1);
    }
    fn next_break(&mut self, t: f64) -> f64 {
        self.plant.next_break(t)
    }
    fn next_bend(&mut self, t: f64) -> f64 {
        self.plant.next_bend(t)
    }
    #[inline(always)]
    fn is_second_order(&self) -> bool {
        true
    }
    #[inline(always)]
    fn weight(&self) -> T {
        self.weight
    }
    #[cold]
    #[inline(never)]
    fn forgo(&mut self, _t: f64, x: &mut [T], error: T, reason: &Error) -> bool {
        for (k, failure) in self.failures.iter_mut().enumerate() {
            if failure.is_none() && error.lane(k) > 1.0 {
                *failure = Some(reason.clone().on_clock(self.clocks[k]));
            }
        }
        self.weigh();
        self.park(x);
        self.failures.iter().any(Option::is_none)
    }
    #[inline(always)]
    fn inspect(&mut self, t0: f64, x1: &mut [T]) -> Option<String> {
        if self.any {
            self.park(x1);
        }
        if all_finite(x1) && self.plant.objection(x1).is_none() {
            return None;
        }
        self.find(t0, x1);
        self.park(x1);
        let refused = !self.goes_on && self.failures.iter().all(Option::is_some);
        refused.then(|| "no lane can go on".to_owned())
    }
}
