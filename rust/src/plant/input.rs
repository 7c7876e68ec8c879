//! What drives an arm: pressures, external forces and wrenches sampled at times of their own.

use crate::error::{Error, Result};
use crate::kinematics::point::Point;
use crate::real::Real;

/// What holds between two samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// The straight line between them.
    Linear,
    /// The earlier one.
    Hold,
}

impl Interpolation {
    /// By the user's name.
    pub fn by_name(name: &str) -> Option<Self> {
        match name {
            "linear" => Some(Self::Linear),
            "hold" => Some(Self::Hold),
            _ => None,
        }
    }
}

/// Samples of all channels at common, irregular times; before the first and after the last sample that one holds.
/// Two samples at the same time are a jump.
///
/// Its clock starts at 0 with the first sample, whatever the caller's says then ([`Input::origin`]): seconds since 1970 leave
/// few digits for steps, milliseconds none.
#[derive(Clone, Debug)]
pub struct Input {
    /// The caller's time of the first sample, s.
    origin: f64,
    times: Vec<f64>,
    /// Row by row: pressures, Pa absolute.
    pressures: Vec<f64>,
    pressure_count: usize,
    /// Row by row: forces at the sections' force points, N, or none, then force and moment, N and N m, at each of `points`.
    forces: Vec<f64>,
    force_count: usize,
    /// Where wrenches act.
    points: Vec<Point<f64>>,
    interpolation: Interpolation,
    /// Times of the jumps, ascending.
    jumps: Vec<f64>,
    /// Times of the samples at which a channel may bend, ascending: not those within a stretch that is held.
    bends: Vec<f64>,
}

/// Where a reader of an [`Input`] stands; moves forward cheaply.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cursor(usize);

impl Input {
    /// Samples at `times` (ascending, repeats allowed): `pressures` with `pressure_count` values a row, `forces` with
    /// `force_count` (0: none).
    ///
    /// # Errors
    /// [`Error::Input`] for sizes that do not fit, times that run backwards, values that are not finite.
    pub fn new(
        mut times: Vec<f64>,
        (pressures, pressure_count): (Vec<f64>, usize),
        (forces, force_count): (Vec<f64>, usize),
        interpolation: Interpolation,
    ) -> Result<Self> {
        let rows = times.len();
        if rows == 0 {
            return Err(Error::Input("the input has no samples; at least one is needed".to_owned()));
        }
        for (name, found, count) in
            [("pressures", pressures.len(), pressure_count), ("forces", forces.len(), force_count)]
        {
            if found != rows * count {
                return Err(Error::Input(format!("{name}: {found} values; {rows} samples of {count} are needed")));
            }
        }
        for (name, values, count) in
            [("time", &times, 1), ("pressures", &pressures, pressure_count), ("forces", &forces, force_count)]
        {
            if let Some(k) = values.iter().position(|x| !x.is_finite()) {
                let (row, column, value) = (k / count, k % count, values[k]);
                return Err(Error::Input(format!(
                    "input {name}: sample {row}, channel {column} is {value}; finite numbers are needed"
                )));
            }
        }
        if let Some(k) = times.windows(2).position(|w| w[1] < w[0]) {
            let (a, b) = (times[k], times[k + 1]);
            return Err(Error::Input(format!("input time runs backwards from {a} to {b} s at sample {}", k + 1)));
        }
        if let Some(k) = pressures.iter().position(|p| *p < 0.0) {
            let (row, column, value) = (k / pressure_count, k % pressure_count, pressures[k]);
            return Err(Error::Input(format!(
                "input pressures: sample {row}, channel {column} is {value} Pa, below zero; absolute pressures are needed: is it \
                 a gauge pressure, to which the ambient one has to be added?"
            )));
        }
        let origin = times[0];
        times.iter_mut().for_each(|t| *t -= origin);
        let jumps = Vec::new();
        let mut input = Self {
            origin,
            times,
            pressures,
            pressure_count,
            forces,
            force_count,
            points: Vec::new(),
            interpolation,
            jumps,
            bends: Vec::new(),
        };
        input.jumps = input.find_jumps();
        input.bends = input.find_bends();
        Ok(input)
    }

    /// The same, its last force channels being wrenches at `points`: six each, force and moment.
    ///
    /// # Errors
    /// [`Error::Input`] where there are fewer channels.
    pub fn with_points(self, points: Vec<Point<f64>>) -> Result<Self> {
        if self.force_count < 6 * points.len() {
            let (found, count) = (self.force_count, points.len());
            return Err(Error::Input(format!("wrenches: {found} force channels; {count} points need six each")));
        }
        Ok(Self { points, ..self })
    }

    /// Whether it has external forces or wrenches.
    pub fn has_forces(&self) -> bool {
        self.force_count > 0
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.times.len()
    }

    /// Where wrenches act.
    pub fn points(&self) -> &[Point<f64>] {
        &self.points
    }

    /// Number of force channels at the sections' force points: three a section, or none.
    pub fn section_force_count(&self) -> usize {
        self.force_count - 6 * self.points.len()
    }

    /// Number of pressure channels.
    pub fn pressure_count(&self) -> usize {
        self.pressure_count
    }

    /// Number of force channels, those of wrenches included.
    pub fn force_count(&self) -> usize {
        self.force_count
    }

    /// The times at which a channel jumps, ascending.
    pub fn jumps(&self) -> &[f64] {
        &self.jumps
    }

    /// What the caller's clock says at the first sample, where this one says 0, s.
    pub fn origin(&self) -> f64 {
        self.origin
    }

    /// The last sample at or before `t` (`before`: strictly before, the limit from the left).
    #[inline(always)]
    fn locate(&self, t: f64, before: bool, cursor: &mut Cursor) -> usize {
        let past = |k: usize| if before { self.times[k] < t } else { self.times[k] <= t };
        let mut k = cursor.0.min(self.times.len() - 1);
        let mut scanned = 0;
        while k + 1 < self.times.len() && past(k + 1) && scanned < 8 {
            k += 1;
            scanned += 1;
        }
        if scanned == 8 || !past(k) {
            let count =
                if before { self.times.partition_point(|x| *x < t) } else { self.times.partition_point(|x| *x <= t) };
            k = count.saturating_sub(1);
        }
        cursor.0 = k;
        k
    }

    /// Sample index and weight of the next sample at `t`. `before` takes the limit from the left.
    #[inline(always)]
    pub fn weight(&self, t: f64, before: bool, cursor: &mut Cursor) -> (usize, f64) {
        let k = self.locate(t, before, cursor);
        if self.interpolation == Interpolation::Hold || k + 1 >= self.times.len() {
            return (k, 0.0);
        }
        let (t0, t1) = (self.times[k], self.times[k + 1]);
        if t1 > t0 { (k, ((t - t0) / (t1 - t0)).clamp(0.0, 1.0)) } else { (k, 0.0) }
    }

    /// Pressure `channel` at a place that [`Input::weight`] gave.
    #[inline(always)]
    pub fn pressure(&self, (k, w): (usize, f64), channel: usize) -> f64 {
        let n = self.pressure_count;
        let a = self.pressures[k * n + channel];
        if w == 0.0 { a } else { a + w * (self.pressures[(k + 1) * n + channel] - a) }
    }

    /// Pressure `channel` of sample `k`, and how much it rises to the next one; by nothing after the last.
    #[inline(always)]
    pub fn segment(&self, k: usize, channel: usize) -> (f64, f64) {
        let n = self.pressure_count;
        let a = self.pressures[k * n + channel];
        (a, self.pressures.get((k + 1) * n + channel).map_or(0.0, |b| b - a))
    }

    /// Pressures of channels from `first` on at a time that may differ from lane to lane or carry derivatives, into `out`: sums
    /// over the pieces it may lie in.
    #[inline(always)]
    pub fn pressures_at<T: Real>(&self, t: T, first: usize, out: &mut [T]) {
        let (low, high) = (t.smallest(), t.largest());
        let mut k = self.times.partition_point(|x| *x <= low).max(1) - 1;
        let value = |k: usize, j: usize| self.pressures[k * self.pressure_count + first + j];
        for (j, out) in out.iter_mut().enumerate() {
            *out = T::from_f64(value(k, j));
        }
        while k + 1 < self.times.len() && self.times[k] <= high {
            let h = self.times[k + 1] - self.times[k];
            let share = if self.interpolation == Interpolation::Hold || h == 0.0 {
                T::select(t - self.times[k + 1], T::one(), T::zero())
            } else {
                ((t - self.times[k]) * (1.0 / h)).max(T::zero()).min(T::one())
            };
            for (j, out) in out.iter_mut().enumerate() {
                *out += share * (value(k + 1, j) - value(k, j));
            }
            k += 1;
        }
    }

    /// Of one channel.
    #[inline(always)]
    pub fn pressure_at<T: Real>(&self, t: T, channel: usize) -> T {
        let mut out = [T::zero()];
        self.pressures_at(t, channel, &mut out);
        out[0]
    }

    /// The first sample after `t`, where an interpolated input bends; infinity after the last.
    #[inline(always)]
    pub fn next_sample(&self, t: f64, cursor: &mut Cursor) -> f64 {
        if self.interpolation == Interpolation::Hold || t < self.times[0] {
            return if t < self.times[0] { self.times[0] } else { f64::INFINITY };
        }
        let k = self.locate(t, false, cursor);
        self.times.get(k + 1).copied().unwrap_or(f64::INFINITY)
    }

    /// Force `channel` at a place that [`Input::weight`] gave.
    #[inline(always)]
    pub fn force(&self, (k, w): (usize, f64), channel: usize) -> f64 {
        let n = self.force_count;
        let a = self.forces[k * n + channel];
        if w == 0.0 { a } else { a + w * (self.forces[(k + 1) * n + channel] - a) }
    }

    /// The first time after `t` at which a channel jumps.
    #[inline(always)]
    pub fn next_jump(&self, t: f64) -> f64 {
        let next = self.jumps.partition_point(|jump| *jump <= t);
        self.jumps.get(next).copied().unwrap_or(f64::INFINITY)
    }

    /// The first sample after `t` at which an interpolated input may bend; infinity after the last.
    #[inline(always)]
    pub fn next_bend(&self, t: f64) -> f64 {
        let next = self.bends.partition_point(|bend| *bend <= t);
        self.bends.get(next).copied().unwrap_or(f64::INFINITY)
    }

    /// Whether a channel of sample `k` + 1 differs from that of sample `k`.
    fn changes(&self, k: usize) -> bool {
        let (n, m) = (self.pressure_count, self.force_count);
        self.pressures[k * n..(k + 1) * n] != self.pressures[(k + 1) * n..(k + 2) * n]
            || self.forces[k * m..(k + 1) * m] != self.forces[(k + 1) * m..(k + 2) * m]
    }

    /// The times of all bends. Commands are held for most of their samples, and steps need not end at those.
    fn find_bends(&self) -> Vec<f64> {
        let last = self.times.len() - 1;
        if self.interpolation == Interpolation::Hold {
            return vec![self.times[0]];
        }
        let bends = |k: usize| k == 0 || self.changes(k - 1) || (k < last && self.changes(k));
        (0..=last).filter(|k| bends(*k)).map(|k| self.times[k]).collect()
    }

    /// The times of all jumps. Found once: an integrator asks for the next one before every step.
    fn find_jumps(&self) -> Vec<f64> {
        let may_jump = |k: usize| self.interpolation == Interpolation::Hold || self.times[k + 1] == self.times[k];
        (0..self.times.len() - 1).filter(|k| may_jump(*k) && self.changes(*k)).map(|k| self.times[k + 1]).collect()
    }
}
