//! What comes into the chain of effects on pressures: samples given beforehand, or pressures known only as time goes on
//! (commands held from outside, chambers that depend on the arm's motion).

use crate::real::Real;

/// Pressures over time, one an input. Times are on the plant's clock; lanes may stand at different ones.
pub trait Upstream<T: Real> {
    /// All at `t` into `out`; from `end` on, the limit from the left.
    fn read(&mut self, t: T, end: f64, out: &mut [T]);
    /// One at a time that may carry derivatives.
    fn delayed(&mut self, t: T, channel: usize) -> T;
    /// All at such a time.
    #[inline(always)]
    fn all_delayed(&mut self, t: T, out: &mut [T]) {
        for (channel, out) in out.iter_mut().enumerate() {
            *out = self.delayed(t, channel);
        }
    }
    /// The first sample after `t`, where they bend.
    fn next_sample(&mut self, t: T) -> T;
    /// The first time after `t` at which one jumps, as far as known.
    fn next_jump(&self, t: f64) -> f64;
    /// The first time after `t` at which one bends, as far as known.
    fn next_bend(&self, t: f64) -> f64;
    /// The clock of each lane's input minus the plant's, s.
    fn clock(&self) -> T;
}

/// Pressures noted step by step, straight lines between; two rows at the same time are a jump. Rows older than
/// `horizon` are forgotten now and then.
#[derive(Clone, Debug)]
pub struct History<T> {
    times: Vec<f64>,
    rows: Vec<T>,
    inputs: usize,
    committed: usize,
    horizon: f64,
    clock: T,
}

/// Rows after which old ones are looked for.
const MANY: usize = 4096;

impl<T: Real> History<T> {
    /// `p` has stood since ever at `t`.
    pub fn new(t: f64, p: &[T]) -> Self {
        Self { times: vec![t], rows: p.to_vec(), inputs: p.len(), committed: 1, horizon: 0.0, clock: T::zero() }
    }

    /// The same for lanes whose inputs' clocks are ahead of the plant's by `clock` s.
    pub fn on_clock(self, clock: T) -> Self {
        Self { clock, ..self }
    }

    /// Delays reach `horizon` s back.
    pub fn reach(&mut self, horizon: f64) {
        self.horizon = horizon;
    }

    /// A step begins, or begins again: what was noted for it before is forgotten.
    #[inline(always)]
    pub fn begin_step(&mut self) {
        self.times.truncate(self.committed);
        self.rows.truncate(self.committed * self.inputs);
    }

    /// Notes the pressures at `t`, not before the last.
    #[inline(always)]
    pub fn note(&mut self, t: f64, p: &[T]) {
        self.times.push(t);
        self.rows.extend_from_slice(p);
    }

    /// Times and rows, one after the other, of the steps accepted so far.
    pub fn committed(&self) -> (&[f64], &[T]) {
        (&self.times[..self.committed], &self.rows[..self.committed * self.inputs])
    }

    /// Goes on from what [`History::committed`] gave.
    pub fn resume(&mut self, times: &[f64], rows: &[T]) {
        (self.times, self.rows, self.committed) = (times.to_vec(), rows.to_vec(), times.len());
    }

    /// The step was accepted.
    pub fn end_step(&mut self) {
        self.committed = self.times.len();
        if self.committed > MANY {
            let oldest = self.times[self.committed - 1] - self.horizon;
            let gone = self.times.partition_point(|t| *t < oldest).saturating_sub(2);
            if gone > MANY / 2 {
                self.times.drain(..gone);
                self.rows.drain(..gone * self.inputs);
                self.committed = self.times.len();
            }
        }
    }

    #[inline(always)]
    fn place(&self, t: f64, before: bool) -> (usize, f64) {
        let count =
            if before { self.times.partition_point(|x| *x < t) } else { self.times.partition_point(|x| *x <= t) };
        let k = count.saturating_sub(1);
        if k + 1 >= self.times.len() {
            return (k, 0.0);
        }
        let (t0, t1) = (self.times[k], self.times[k + 1]);
        (k, if t1 > t0 { ((t - t0) / (t1 - t0)).clamp(0.0, 1.0) } else { 0.0 })
    }

    #[inline(always)]
    fn value(&self, (k, w): (usize, f64), input: usize) -> T {
        let a = self.rows[k * self.inputs + input];
        if w == 0.0 { a } else { a + (self.rows[(k + 1) * self.inputs + input] - a) * w }
    }
}

impl<T: Real> Upstream<T> for History<T> {
    #[inline(always)]
    fn read(&mut self, t: T, end: f64, out: &mut [T]) {
        // All lanes have the same rows and so stand at the same time.
        let t = t.lane(0);
        let place = self.place(t, t >= end);
        for (j, p) in out.iter_mut().enumerate() {
            *p = self.value(place, j);
        }
    }
    fn delayed(&mut self, t: T, channel: usize) -> T {
        let (low, high) = (t.smallest(), t.largest());
        let mut k = self.times.partition_point(|x| *x <= low).max(1) - 1;
        let value = |k: usize| self.rows[k * self.inputs + channel];
        let mut out = value(k);
        while k + 1 < self.times.len() && self.times[k] <= high {
            let (h, rise) = (self.times[k + 1] - self.times[k], value(k + 1) - value(k));
            let share = if h == 0.0 {
                T::select(t - self.times[k + 1], T::one(), T::zero())
            } else {
                ((t - self.times[k]) * (1.0 / h)).max(T::zero()).min(T::one())
            };
            out += share * rise;
            k += 1;
        }
        out
    }
    #[inline(always)]
    fn next_sample(&mut self, t: T) -> T {
        let t = t.lane(0);
        let k = self.times.partition_point(|x| *x <= t);
        T::from_f64(self.times.get(k).copied().unwrap_or(f64::INFINITY))
    }
    fn next_jump(&self, _t: f64) -> f64 {
        // Held commands jump where steps begin; one that arrives late, within a step, is met by that step's stages.
        f64::INFINITY
    }
    fn next_bend(&self, _t: f64) -> f64 {
        f64::INFINITY
    }
    fn clock(&self) -> T {
        self.clock
    }
}
