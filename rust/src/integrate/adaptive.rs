//! Steps whose length follows from an estimate of their error, and output between their ends.
//!
//! Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, sec. II.4 (step size control, starting
//! step). Where lanes take steps together, the worst one decides.
//! Steps end where the input jumps. A linearly implicit method, whose steps are long and whose df/dt is that of a step's
//! start, ends them also where the input bends, unless several bends lie within one; the way there is divided evenly.

use super::System;
use super::runge_kutta::{Integrator, Sequence};
use crate::error::{Error, Result};
use crate::real::{Real, all_finite};

/// How much more than the absolute tolerance of lengths a linearly implicit method's rates have, 1/s. The rates of a stiff arm
/// bend wherever the input does, and forget their errors within a step or two: a tolerance as small as that of lengths
/// takes two to three times the steps for digits that no length shows (measured: docs/decisions/0002-stiff-arms.md).
const RATES: f64 = 100.0;
/// Steps longer than so many distances of bends go over them: the input is finer than what the arm follows.
const BENDS: f64 = 4.0;

impl<T: Real> Integrator<T> {
    #[inline(always)]
    pub(super) fn adaptive_step<S: System<T>>(&mut self, system: &mut S) -> Result<()> {
        let limit = system.next_break(self.t);
        self.fresh = self.carry;
        if self.carry {
            let last = self.k.len() - 1;
            self.k.swap(0, last);
            self.carry = false;
        }
        if let Sequence::Given(ends, done) = &mut self.sequence
            && let Some(&t1) = ends.get(*done)
        {
            *done += 1;
            let h = self.length(t1)?;
            self.h = h;
            system.begin_step(self.t, t1, &self.x);
            self.stages(system, h);
            self.accept(system, t1)?;
            self.carry = self.tableau.first_same_as_last && t1 < limit;
            return Ok(());
        }
        if self.h == 0.0 {
            self.h = self.starting_step(system, limit);
            self.fresh = false;
        }
        let bend = if self.implicit.is_some() { system.next_bend(self.t) } else { f64::INFINITY };
        let exponent = 1.0 / f64::from(self.tableau.order);
        let mut rejected = false;
        loop {
            let wanted = self.h.min(self.options.max_step);
            // A step that would leave a sliver before the break ends on it.
            let at_break = self.t + 1.01 * wanted >= limit;
            let mut t1 = if at_break { limit } else { self.t + wanted };
            let room = bend - self.t;
            let cut = bend < limit && wanted < BENDS * room && room < BENDS * wanted;
            if cut {
                let pieces = (room / wanted - 0.01).ceil().max(1.0);
                t1 = if pieces > 1.0 { self.t + room / pieces } else { bend };
            }
            let h = self.length(t1)?;
            system.begin_step(self.t, t1, &self.x);
            self.stages(system, h);
            let error = self.error_norm(h, system.weight());
            if error <= 1.0 {
                // PI control (Hairer, II.4.2.): the last error damps the growth.
                let grow = 0.9 * error.max(1e-10).powf(-0.7 * exponent) * self.last_error.powf(0.4 * exponent);
                let grow = grow.clamp(0.2, if rejected { 1.0 } else { 10.0 });
                let next = h * grow;
                let shortened = at_break || cut && grow >= 1.0;
                self.h = if shortened { next.max(self.h) } else { next };
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
                let failure = self.too_short();
                let failing = T::from_lanes(|k| self.error_in_lane(h, k));
                if !system.forgo(self.t, &mut self.x, failing, &failure) {
                    return Err(failure);
                }
                self.h = 0.0;
                return Ok(());
            }
        }
    }

    #[cold]
    fn too_short(&self) -> Error {
        let (h, min) = (self.h, self.options.min_step);
        let derivative = self.implicit.as_ref().map_or(&self.k[0], |implicit| &implicit.derivative);
        if !all_finite(derivative) {
            let text = "the equations of motion give no finite accelerations in this state (a formula or a number of an \
                        effect, a section without inertia?)";
            return self.failure(text.to_owned());
        }
        self.failure(format!(
            "the tolerance needs steps below min_step ({h:.1e} < {min:.1e} s): the motion has become too fast or is diverging"
        ))
    }

    /// RMS of the error estimate over the tolerance, of the lanes that count (`weight` > 0).
    #[inline(always)]
    fn error_norm(&self, h: f64, weight: T) -> f64 {
        let mut sum = 0.0;
        for j in 0..self.x.len() {
            let e = self.error_of(h, j);
            let (before, after) = (self.x[j].abs(), self.stage[j].abs());
            let zero = T::zero();
            let size = T::select(weight, before, zero).largest().max(T::select(weight, after, zero).largest());
            let ratio = T::select(weight, e.abs(), zero).largest() / (self.atol_of(j) + self.options.rtol * size);
            sum += ratio * ratio;
        }
        let norm = (sum / self.x.len() as f64).sqrt();
        // The largest of lanes may pass over one that is no number; a state made of such is not taken over.
        let finite = T::select(weight, self.sum_of_stage(), T::zero()).is_finite();
        if norm.is_nan() || !finite { f64::INFINITY } else { norm }
    }

    /// Absolute tolerance of state `j`.
    #[inline(always)]
    fn atol_of(&self, j: usize) -> f64 {
        match &self.implicit {
            Some(implicit) if implicit.positions > 0 && j >= implicit.positions => RATES * self.options.atol,
            _ => self.options.atol,
        }
    }

    /// Estimated error of state `j`.
    #[inline(always)]
    fn error_of(&self, h: f64, j: usize) -> T {
        let mut e = T::zero();
        for (w, k) in self.tableau.error.iter().zip(&self.k) {
            e += k[j] * (w * h);
        }
        e
    }

    #[inline(always)]
    fn sum_of_stage(&self) -> T {
        let mut sum = T::zero();
        for x in &self.stage {
            sum += *x;
        }
        sum
    }

    /// The error of lane `k` alone, as [`Integrator::error_norm`] has it; infinity if it is no number.
    #[cold]
    #[inline(never)]
    fn error_in_lane(&self, h: f64, k: usize) -> f64 {
        let of = |j: usize| {
            let size = self.x[j].lane(k).abs().max(self.stage[j].lane(k).abs());
            (self.error_of(h, j).lane(k) / (self.atol_of(j) + self.options.rtol * size)).powi(2)
        };
        let norm = ((0..self.x.len()).map(of).sum::<f64>() / self.x.len() as f64).sqrt();
        if norm.is_finite() { norm } else { f64::INFINITY }
    }

    /// Hairer, II.4: a first step from the sizes of x, x' and x''.
    fn starting_step<S: System<T>>(&mut self, system: &mut S, limit: f64) -> f64 {
        let (atol, rtol, weight) = (self.options.atol, self.options.rtol, system.weight());
        let norm = |v: &[T], x: &[T]| {
            let size = |x: T| T::select(weight, x.abs(), T::zero()).largest();
            let sum: f64 = v.iter().zip(x).map(|(v, x)| (size(*v) / (atol + rtol * size(*x))).powi(2)).sum();
            (sum / v.len() as f64).sqrt()
        };
        let reach = (limit - self.t).min(self.options.max_step).min(1.0);
        system.begin_step(self.t, self.t + reach, &self.x);
        system.derivative(self.t, &self.x, &mut self.k[0]);
        let (d0, d1) = (norm(&self.x, &self.x), norm(&self.k[0], &self.x));
        let h0 = if d0 < 1e-5 || d1 < 1e-5 { 1e-6 } else { 0.01 * d0 / d1 }.min(reach);
        self.combine(&[1.0], h0);
        system.derivative(self.t + h0, &self.stage, &mut self.k[1]);
        self.statistics.evaluations += 2;
        let (first, rest) = self.k.split_at_mut(1);
        for (a, b) in rest[0].iter_mut().zip(&first[0]) {
            *a -= *b;
        }
        let d2 = norm(&self.k[1], &self.x) / h0;
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
    pub(super) fn interpolate(&mut self, t: f64) {
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
