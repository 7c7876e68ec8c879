//! The stepping loop.
//!
//! Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, sec. II.4 (step size control, starting step), II.6.
//! A method with an error estimate steps adaptively and answers between steps by dense output; one without takes equal
//! steps, at most `step` long, that end on every output and every break.

use super::System;
use super::implicit::Implicit;
use super::tableau::{Method, Tableau};
use crate::error::{Error, Result};
use crate::real::Real;

/// How to step.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// The method.
    pub method: Method,
    /// Longest step of a fixed-step method, s.
    pub step: f64,
    /// Relative tolerance of an adaptive method.
    pub rtol: f64,
    /// Absolute tolerance of an adaptive method (in the state's units: m, m/s).
    pub atol: f64,
    /// Shortest step of an adaptive method, s; a shorter one needed is an error.
    pub min_step: f64,
    /// Longest step of an adaptive method, s.
    pub max_step: f64,
    /// Most steps in all, rejected ones included.
    pub max_steps: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            method: Method::DormandPrince54,
            step: 1e-3,
            rtol: 1e-6,
            atol: 1e-8,
            min_step: 1e-10,
            max_step: f64::INFINITY,
            max_steps: u64::MAX,
        }
    }
}

/// What a run cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Accepted steps.
    pub steps: u64,
    /// Rejected steps.
    pub rejected_steps: u64,
    /// Evaluations of the right-hand side.
    pub evaluations: u64,
}

/// An integration under way: state, last step, counts. Nothing is allocated after `new`.
#[derive(Clone, Debug)]
pub struct Integrator<T> {
    options: Options,
    tableau: &'static Tableau,
    /// Start and end of the last step.
    t_before: f64,
    t: f64,
    x_before: Vec<T>,
    x: Vec<T>,
    stage: Vec<T>,
    k: Vec<Vec<T>>,
    /// Whether `k[0]` already is f(t, x).
    fresh: bool,
    /// Whether the last stage is f(t, x): it moves to `k[0]` when the next step begins, since dense output needs both.
    carry: bool,
    h: f64,
    last_error: f64,
    statistics: Statistics,
    output: Vec<T>,
    /// Of a linearly implicit method.
    implicit: Option<Implicit<T>>,
}

/// Steps between two questions whether to stop.
const POLL: u64 = 512;

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
        }
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
                if taken.is_multiple_of(POLL) && stop() {
                    return Err(Error::Interrupted);
                }
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

    fn failure(&self, reason: String) -> Error {
        Error::Simulation { time: self.t, reason }
    }

    /// All stages from `k[0]` and the new state into `stage`.
    #[inline(always)]
    fn stages<S: System<T>>(&mut self, system: &mut S, h: f64) {
        if !self.fresh {
            system.derivative(self.t, &self.x, &mut self.k[0]);
            self.statistics.evaluations += 1;
        }
        let tableau = self.tableau;
        if let Some(implicit) = &mut self.implicit {
            implicit.factor(system, self.t, &self.x, &self.k[0], tableau.gamma * h);
            implicit.add_drift(tableau.drift[0], &mut self.k[0]);
            implicit.solve(&mut self.k[0]);
            self.statistics.evaluations += self.x.len() as u64 + 1;
        }
        for (i, row) in tableau.a.iter().enumerate() {
            self.combine(row, h);
            system.derivative(self.t + tableau.c[i + 1] * h, &self.stage, &mut self.k[i + 1]);
            if let Some(implicit) = &self.implicit {
                let (before, now) = self.k.split_at_mut(i + 1);
                for (c, k) in tableau.coupling[i].iter().zip(before) {
                    for (s, d) in now[0].iter_mut().zip(k.iter()) {
                        *s += *d * *c;
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
    fn combine(&mut self, weights: &[f64], h: f64) {
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
    fn accept<S: System<T>>(&mut self, system: &mut S, t1: f64) -> Result<()> {
        if let Some(reason) = system.inspect(self.t, &mut self.stage) {
            return Err(self.failure(reason));
        }
        system.end_step(t1, &self.stage);
        std::mem::swap(&mut self.x_before, &mut self.x);
        std::mem::swap(&mut self.x, &mut self.stage);
        self.t_before = self.t;
        self.t = t1;
        self.statistics.steps += 1;
        Ok(())
    }

    #[inline(always)]
    fn fixed_step<S: System<T>>(&mut self, system: &mut S, wanted: f64) -> Result<()> {
        let target = wanted.min(system.next_break(self.t));
        let left = target - self.t;
        let count = (left / self.options.step - 1e-9).ceil().max(1.0);
        let t1 = if count > 1.0 { self.t + left / count } else { target };
        let h = t1 - self.t;
        system.begin_step(self.t, t1, &self.x);
        self.fresh = false;
        self.stages(system, h);
        self.accept(system, t1)
    }

    #[inline(always)]
    fn adaptive_step<S: System<T>>(&mut self, system: &mut S) -> Result<()> {
        let limit = system.next_break(self.t);
        if self.h == 0.0 {
            self.h = self.starting_step(system, limit);
        }
        let exponent = 1.0 / f64::from(self.tableau.order);
        self.fresh = self.carry;
        if self.carry {
            let last = self.k.len() - 1;
            self.k.swap(0, last);
            self.carry = false;
        }
        let mut rejected = false;
        loop {
            let mut h = self.h.min(self.options.max_step);
            // A step that would leave a sliver before the break ends on it.
            let at_break = self.t + 1.01 * h >= limit;
            let t1 = if at_break { limit } else { self.t + h };
            h = t1 - self.t;
            system.begin_step(self.t, t1, &self.x);
            self.stages(system, h);
            let error = self.error_norm(h);
            if error <= 1.0 {
                // PI control (Hairer, II.4.2.): the last error damps the growth.
                let grow = 0.9 * error.max(1e-10).powf(-0.7 * exponent) * self.last_error.powf(0.4 * exponent);
                let next = h * grow.clamp(0.2, if rejected { 1.0 } else { 10.0 });
                self.h = if at_break { next.max(self.h) } else { next };
                self.last_error = error.max(1e-4);
                self.accept(system, t1)?;
                self.carry = self.tableau.first_same_as_last && !at_break;
                return Ok(());
            }
            self.statistics.rejected_steps += 1;
            rejected = true;
            self.fresh = true;
            let shrink = if error.is_finite() { 0.9 * error.powf(-exponent) } else { 0.1 };
            self.h = h * shrink.clamp(0.1, 0.9);
            if self.h < self.options.min_step {
                let (h, min) = (self.h, self.options.min_step);
                return Err(self.failure(format!(
                    "the tolerance needs steps below min_step ({h:.1e} < {min:.1e} s): the motion has become too fast or \
                     is diverging"
                )));
            }
        }
    }

    /// RMS of the error estimate over the tolerance.
    #[inline(always)]
    fn error_norm(&self, h: f64) -> f64 {
        let mut sum = 0.0;
        for j in 0..self.x.len() {
            let mut e = T::zero();
            for (w, k) in self.tableau.error.iter().zip(&self.k) {
                e += k[j] * (w * h);
            }
            let size = self.x[j].abs().largest().max(self.stage[j].abs().largest());
            let ratio = e.abs().largest() / (self.options.atol + self.options.rtol * size);
            sum += ratio * ratio;
        }
        let norm = (sum / self.x.len() as f64).sqrt();
        if norm.is_nan() { f64::INFINITY } else { norm }
    }

    /// Hairer, II.4: a first step from the sizes of x, x' and x''.
    fn starting_step<S: System<T>>(&mut self, system: &mut S, limit: f64) -> f64 {
        let norm = |v: &[T], x: &[T], o: &Options| {
            let sum: f64 =
                v.iter().zip(x).map(|(v, x)| (v.abs().largest() / (o.atol + o.rtol * x.abs().largest())).powi(2)).sum();
            (sum / v.len() as f64).sqrt()
        };
        let reach = (limit - self.t).min(self.options.max_step).min(1.0);
        system.begin_step(self.t, self.t + reach, &self.x);
        system.derivative(self.t, &self.x, &mut self.k[0]);
        let (d0, d1) = (norm(&self.x, &self.x, &self.options), norm(&self.k[0], &self.x, &self.options));
        let h0 = if d0 < 1e-5 || d1 < 1e-5 { 1e-6 } else { 0.01 * d0 / d1 }.min(reach);
        self.combine(&[1.0], h0);
        system.derivative(self.t + h0, &self.stage, &mut self.k[1]);
        self.statistics.evaluations += 2;
        let (first, rest) = self.k.split_at_mut(1);
        for (a, b) in rest[0].iter_mut().zip(&first[0]) {
            *a -= *b;
        }
        let d2 = norm(&self.k[1], &self.x, &self.options) / h0;
        let largest = d1.max(d2);
        let h1 = if largest <= 1e-15 {
            (h0 * 1e-3).max(1e-6)
        } else {
            (0.01 / largest).powf(1.0 / f64::from(self.tableau.order))
        };
        h1.min(100.0 * h0).min(reach).max(self.options.min_step)
    }

    /// State within the last step, into `output`.
    #[inline(always)]
    fn interpolate(&mut self, t: f64) {
        let h = self.t - self.t_before;
        let theta = (t - self.t_before) / h;
        self.output.copy_from_slice(&self.x_before);
        for (p, k) in self.tableau.dense.iter().zip(&self.k) {
            let weight = h * theta * (p[0] + theta * (p[1] + theta * (p[2] + theta * p[3])));
            for (o, d) in self.output.iter_mut().zip(k) {
                *o += *d * weight;
            }
        }
    }
}
