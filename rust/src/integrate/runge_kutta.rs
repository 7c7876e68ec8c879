//! The stepping loop, and steps of a given length.
//!
//! Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, sec. II.6; *II*, sec. IV.7 (linearly implicit).
//! A method with an error estimate steps adaptively (`adaptive`) and answers between steps by dense output; one without takes
//! equal steps, at most `step` long, that end on every output and every break.

use super::System;
use super::implicit::{DRIFT_EVALUATIONS, Implicit};
use super::options::{Options, Statistics};
use super::tableau::Tableau;
use crate::error::{Error, Result};
use crate::real::Real;
use std::sync::Arc;

/// An integration under way: state, last step, counts. Nothing is allocated after `new`.
#[derive(Clone, Debug)]
pub struct Integrator<T> {
    pub(super) options: Options,
    pub(super) tableau: &'static Tableau,
    /// Start and end of the last step.
    pub(super) t_before: f64,
    pub(super) t: f64,
    pub(super) x_before: Vec<T>,
    pub(super) x: Vec<T>,
    pub(super) stage: Vec<T>,
    pub(super) k: Vec<Vec<T>>,
    /// Whether f(t, x) is known already, and for a linearly implicit method its derivatives: a step is begun again.
    pub(super) fresh: bool,
    /// Whether the last stage is f(t, x): it moves to `k[0]` when the next step begins, since dense output needs both.
    pub(super) carry: bool,
    /// Length that the next step of an adaptive method should have; 0 before the first.
    pub(super) h: f64,
    pub(super) last_error: f64,
    pub(super) statistics: Statistics,
    pub(super) output: Vec<T>,
    /// Of a linearly implicit method.
    pub(super) implicit: Option<Implicit<T>>,
    pub(super) sequence: Sequence,
    /// Evaluations times states at the last question whether to stop.
    asked: u64,
    /// For how many further steps of a given length a Jacobian is kept, and the one there is still; when the run began.
    keeps: u32,
    kept: u32,
    t_first: f64,
}

/// Where the ends of an adaptive method's steps come from.
#[derive(Clone, Debug, Default)]
pub(super) enum Sequence {
    /// From the estimated error.
    #[default]
    Own,
    /// Likewise, and they are noted.
    Noted(Vec<f64>),
    /// From another run, of which so many are done.
    Given(Arc<Vec<f64>>, usize),
}

/// How long a Jacobian is kept, s, and for how many steps at least and at the most. Methods of this kind are of their order
/// whatever stands for it; what a kept one changes is 0 to 20 % of the error of a step (docs/decisions/0024).
const KEPT_TIME: f64 = 0.02;
const KEPT_STEPS: (f64, f64) = (4.0, 8.0);
/// Time from the start on until none is kept, s.
const KEPT_AFTER: f64 = 0.1;
/// Evaluations times states between two questions whether to stop: some milliseconds.
const POLL: u64 = 100_000;

impl<T: Real> Integrator<T> {
    /// Ready at (`t`, `x`).
    pub fn new(options: Options, t: f64, x: &[T]) -> Self {
        let tableau = options.method.tableau();
        let zero = vec![T::zero(); x.len()];
        Self {
            options,
            tableau,
            t_before: t,
            t,
            x_before: x.to_vec(),
            x: x.to_vec(),
            stage: zero.clone(),
            k: vec![zero.clone(); tableau.c.len()],
            fresh: false,
            carry: false,
            h: 0.0,
            last_error: 1.0,
            statistics: Statistics::default(),
            output: zero,
            implicit: (tableau.gamma > 0.0).then(|| Implicit::new(x.len())),
            sequence: Sequence::Own,
            asked: 0,
            keeps: 0,
            kept: 0,
            t_first: t,
        }
    }

    /// Notes where steps end, for [`Integrator::following`].
    pub fn noting(self) -> Self {
        Self { sequence: Sequence::Noted(Vec::new()), ..self }
    }

    /// An adaptive method takes the steps that another run took, which then do not follow from its own error.
    pub fn following(self, ends: Arc<Vec<f64>>) -> Self {
        Self { sequence: Sequence::Given(ends, 0), ..self }
    }

    /// A linearly implicit method keeps its Jacobian over several steps of a given length, which must then follow each
    /// other without a look at the state between them. Not for steps whose error is estimated: that of the Jacobian would
    /// count.
    pub fn keeping(self) -> Self {
        let steps = (KEPT_TIME / self.options.step).clamp(KEPT_STEPS.0, KEPT_STEPS.1) as u32;
        Self { keeps: if self.tableau.error.is_empty() { steps - 1 } else { 0 }, ..self }
    }

    /// The ends of the steps so far, if they are noted.
    pub fn noted(self) -> Vec<f64> {
        if let Sequence::Noted(ends) = self.sequence { ends } else { Vec::new() }
    }

    /// Counts so far.
    pub fn statistics(&self) -> Statistics {
        self.statistics
    }

    /// End of the last step.
    pub fn time(&self) -> f64 {
        self.t
    }

    /// The earliest time at which [`Integrator::run`] can still give output.
    pub fn earliest(&self) -> f64 {
        if self.tableau.dense.is_empty() { self.t } else { self.t_before }
    }

    /// State at the end of the last step.
    pub fn state(&self) -> &[T] {
        &self.x
    }

    /// The same, to change it: the next step begins there.
    pub fn state_mut(&mut self) -> &mut [T] {
        self.fresh = false;
        self.kept = 0;
        self.carry = false;
        &mut self.x
    }

    /// Calls the present time `t`.
    pub fn set_time(&mut self, t: f64) {
        self.t_before += t - self.t;
        self.t = t;
    }

    /// Runs to the last of `outputs` (ascending) and hands (time, state) at each to `sink`. `stop` is asked now and then.
    ///
    /// # Errors
    /// [`Error::Simulation`] with the time of the last good state; everything handed to `sink` before stays valid.
    /// [`Error::Interrupted`] if `stop` said so.
    #[inline(always)]
    pub fn run<S: System<T>>(
        &mut self,
        system: &mut S,
        outputs: &[f64],
        sink: &mut impl FnMut(f64, &[T]),
        stop: &mut impl FnMut() -> bool,
    ) -> Result<()> {
        for &wanted in outputs {
            while self.t < wanted {
                if self.tableau.error.is_empty() {
                    self.fixed_step(system, wanted)?;
                } else {
                    self.adaptive_step(system)?;
                }
                let taken = self.statistics.steps + self.statistics.rejected_steps;
                if taken >= self.options.max_steps && self.t < wanted {
                    let limit = self.options.max_steps;
                    return Err(self.failure(format!("the limit of {limit} steps is reached; raise max_steps")));
                }
                self.poll(stop)?;
            }
            if wanted >= self.t {
                system.output(wanted, &self.x);
                sink(wanted, &self.x);
            } else {
                self.interpolate(wanted);
                system.output(wanted, &self.output);
                sink(wanted, &self.output);
            }
        }
        Ok(())
    }

    /// Asks now and then whether to stop.
    #[inline(always)]
    fn poll(&mut self, stop: &mut impl FnMut() -> bool) -> Result<()> {
        let work = self.statistics.evaluations * self.x.len() as u64;
        if work < self.asked + POLL {
            return Ok(());
        }
        self.asked = work;
        if stop() { Err(Error::Interrupted) } else { Ok(()) }
    }

    #[cold]
    pub(super) fn failure(&self, reason: String) -> Error {
        Error::Simulation { time: self.t, reason }
    }

    /// All stages of a step of length `h` and the new state into `stage`.
    #[inline(always)]
    pub(super) fn stages<S: System<T>>(&mut self, system: &mut S, h: f64) {
        let tableau = self.tableau;
        if let Some(implicit) = &mut self.implicit {
            if !self.fresh {
                system.derivative(self.t, &self.x, &mut implicit.derivative);
                if self.kept == 0 {
                    implicit.differentiate(system, self.t, &self.x);
                    self.statistics.evaluations += implicit.evaluations();
                    // What a run begins with dies away in an arm that is stiff, and its Jacobian changes meanwhile.
                    self.kept = if self.t - self.t_first >= KEPT_AFTER { self.keeps } else { 0 };
                } else {
                    self.kept -= 1;
                }
                implicit.drift(system, self.t, &self.x, h);
                self.statistics.evaluations += 1 + DRIFT_EVALUATIONS;
            }
            implicit.factor(tableau.gamma * h);
            self.k[0].copy_from_slice(&implicit.derivative);
            implicit.add_drift(tableau.drift[0], &mut self.k[0]);
            implicit.solve(&mut self.k[0]);
        } else if !self.fresh {
            system.derivative(self.t, &self.x, &mut self.k[0]);
            self.statistics.evaluations += 1;
        }
        for (i, row) in tableau.a.iter().enumerate() {
            self.combine(row, h);
            system.derivative(self.t + tableau.c[i + 1] * h, &self.stage, &mut self.k[i + 1]);
            if let Some(implicit) = &self.implicit {
                let (before, now) = self.k.split_at_mut(i + 1);
                for (c, k) in tableau.coupling[i].iter().zip(before) {
                    let c = T::from_f64(*c);
                    for (s, d) in now[0].iter_mut().zip(k.iter()) {
                        *s = d.mul_add(c, *s);
                    }
                }
                implicit.add_drift(tableau.drift[i + 1], &mut now[0]);
                implicit.solve(&mut now[0]);
            }
        }
        self.statistics.evaluations += tableau.a.len() as u64;
        if !tableau.first_same_as_last {
            self.combine(tableau.b, h);
        }
    }

    /// `stage = x + h sum_i weights_i k_i`.
    #[inline(always)]
    pub(super) fn combine(&mut self, weights: &[f64], h: f64) {
        let mut begun = false;
        for (w, k) in weights.iter().zip(&self.k) {
            if *w == 0.0 {
                continue;
            }
            let w = T::from_f64(w * h);
            if begun {
                for (s, d) in self.stage.iter_mut().zip(k) {
                    *s = d.mul_add(w, *s);
                }
            } else {
                for ((s, x), d) in self.stage.iter_mut().zip(&self.x).zip(k) {
                    *s = d.mul_add(w, *x);
                }
            }
            begun = true;
        }
        if !begun {
            self.stage.copy_from_slice(&self.x);
        }
    }

    /// Takes over the new state in `stage` unless it cannot be gone on from.
    #[inline(always)]
    pub(super) fn accept<S: System<T>>(&mut self, system: &mut S, t1: f64) -> Result<()> {
        if let Some(reason) = system.inspect(self.t, &mut self.stage) {
            return Err(self.failure(reason));
        }
        system.end_step(t1, &self.stage);
        if let Sequence::Noted(ends) = &mut self.sequence {
            ends.push(t1);
        }
        std::mem::swap(&mut self.x_before, &mut self.x);
        std::mem::swap(&mut self.x, &mut self.stage);
        self.t_before = self.t;
        self.t = t1;
        self.statistics.steps += 1;
        Ok(())
    }

    /// How long a step to `t1` is.
    #[inline(always)]
    pub(super) fn length(&self, t1: f64) -> Result<f64> {
        if t1 > self.t { Ok(t1 - self.t) } else { Err(self.no_room(self.h.max(self.options.step))) }
    }

    #[cold]
    fn no_room(&self, h: f64) -> Error {
        let t = self.t;
        self.failure(format!(
            "a step of {h:.1e} s does not move the time from {t:e} s on, which has no digits for it; is the time in another \
             unit than seconds?"
        ))
    }

    #[inline(always)]
    fn fixed_step<S: System<T>>(&mut self, system: &mut S, wanted: f64) -> Result<()> {
        let target = wanted.min(system.next_break(self.t));
        let left = target - self.t;
        let count = (left / self.options.step - 1e-9).ceil().max(1.0);
        let t1 = if count > 1.0 { self.t + left / count } else { target };
        let h = self.length(t1)?;
        system.begin_step(self.t, t1, &self.x);
        self.fresh = false;
        self.stages(system, h);
        self.accept(system, t1)
    }
}
