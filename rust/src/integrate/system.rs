//! What is integrated.

use crate::error::Error;
use crate::real::{Real, all_finite};

/// The reason given where a state is no longer finite.
pub(crate) const NOT_FINITE: &str = "the state is no longer finite; try a smaller step or tolerance";

/// A system of ordinary differential equations x' = f(t, x), possibly with hidden states of its own.
///
/// Hidden states are those that are better advanced by an exact update than by the integrator (stiff or not smooth). The
/// system keeps them: [`System::derivative`] may work out their value at a stage from the one at the step's start, and
/// [`System::end_step`] commits them. A rejected step is simply begun again.
pub trait System<T: Real> {
    /// A step from (`t0`, `x0`) to `t1` begins (or begins again, shorter).
    fn begin_step(&mut self, _t0: f64, _t1: f64, _x0: &[T]) {}
    /// f(t, x) into `dx`, within the step begun last.
    fn derivative(&mut self, t: f64, x: &[T], dx: &mut [T]);
    /// The step was accepted and ended at (`t1`, `x1`).
    fn end_step(&mut self, _t1: f64, _x1: &[T]) {}
    /// An output at (`t`, `x`), within the step accepted last: the place to note hidden states for the record.
    fn output(&mut self, _t: f64, _x: &[T]) {}
    /// The first time after `t` at which f is discontinuous in t; steps end there.
    fn next_break(&mut self, _t: f64) -> f64 {
        f64::INFINITY
    }
    /// The first time after `t` at which df/dt is.
    fn next_bend(&mut self, _t: f64) -> f64 {
        f64::INFINITY
    }
    /// Whether x = (q, q'): the first half of f is the second half of x.
    fn is_second_order(&self) -> bool {
        false
    }
    /// Which lanes count in the control of steps: those above 0.
    #[inline(always)]
    fn weight(&self) -> T {
        T::one()
    }
    /// No step from (`t`, `x`) is short enough for the lanes with an `error` above 1: whether the others can go on without
    /// them, from `x` as it is then.
    fn forgo(&mut self, _t: f64, _x: &mut [T], _error: T, _reason: &Error) -> bool {
        false
    }
    /// Looks at the state `x1` in which a step from `t0` ended, before it is taken over; why it cannot be gone on from, if
    /// so. A system of several lanes may put something else in the place of single lanes.
    #[inline(always)]
    fn inspect(&mut self, _t0: f64, x1: &mut [T]) -> Option<String> {
        if !all_finite(x1) {
            return Some(NOT_FINITE.to_owned());
        }
        self.objection(x1)
    }
    /// Why the finite state `x` cannot be gone on from, if so.
    fn objection(&self, _x: &[T]) -> Option<String> {
        None
    }
}
