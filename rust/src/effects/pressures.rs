//! The chain between the logged (or commanded) pressures and those that act.
//!
//! Stages in the order of the file, after the delays. Each stage's state is its last output. All depend on time alone, not on the arm's motion, so
//! the chain is kept beside the arm: it moves forward through the samples of the input, in straight pieces, and goes back to
//! the step's start when a step is begun again. Every stage is exact on a straight piece of what comes in (see the kinds); a stage after
//! a lag gets the chord of the lag's output, an error of second order in the distance of samples.

use super::upstream::Upstream;
use crate::arm::Arm;
use crate::input::Cursor;
use crate::real::{Real, kernel};

/// The pressures of one run on their way through the chain.
#[derive(Clone, Debug)]
pub struct PressureChain<T> {
    /// Delay of each input, where there is one.
    delays: Vec<Option<T>>,
    /// Indices of the stages among the arm's effects.
    stages: Vec<usize>,
    inputs: usize,
    /// Outputs: what comes in (delayed), then of each stage; at `time`, and at the step's start.
    values: Vec<T>,
    start_values: Vec<T>,
    next: Vec<T>,
    time: f64,
    start: f64,
    end: f64,
    cursor: Cursor,
    knot_cursor: Cursor,
}

impl<T: Real> PressureChain<T> {
    /// The chain of `arm`; none where no effect acts on pressures. At rest at `start` under what comes in then.
    pub fn new(arm: &Arm<T>, input: &impl Upstream<T>, start: f64) -> Option<Self> {
        let list = &arm.effects.list;
        let delays: Vec<Option<T>> = (0..arm.inputs)
            .map(|j| {
                list.iter()
                    .filter_map(|e| e.kind.input_delay(j))
                    .fold(None, |sum: Option<T>, d| Some(sum.map_or(d, |s| s + d)))
            })
            .collect();
        let stages: Vec<usize> = (0..list.len()).filter(|&k| list[k].kind.shapes_pressures()).collect();
        if stages.is_empty() && delays.iter().all(Option::is_none) {
            return None;
        }
        let values = vec![T::zero(); arm.inputs * (stages.len() + 1)];
        let mut chain = Self {
            delays,
            stages,
            inputs: arm.inputs,
            start_values: values.clone(),
            next: values.clone(),
            values,
            time: start,
            start,
            end: f64::INFINITY,
            cursor: Cursor::default(),
            knot_cursor: Cursor::default(),
        };
        chain.read(input, start);
        let n = chain.inputs;
        for (k, &stage) in chain.stages.iter().enumerate() {
            let (before, after) = chain.next.split_at_mut(n * (k + 1));
            let out = &mut after[..n];
            out.copy_from_slice(&before[n * k..]);
            arm.effects.list[stage].kind.pressures_at_rest(out);
        }
        chain.values.copy_from_slice(&chain.next);
        chain.start_values.copy_from_slice(&chain.next);
        Some(chain)
    }

    /// What comes in at `t`, with its delays, into the first row of `next`.
    #[inline(always)]
    fn read(&mut self, input: &impl Upstream<T>, t: f64) {
        // Within a step the limit from inside belongs to it where a channel jumps at its ends.
        input.read(t, t >= self.end, &mut self.cursor, &mut self.next[..self.inputs]);
        let hair = 1e-9 * (1.0 + t.abs());
        let inside = t.max(self.start + hair).min(self.end - hair);
        for j in 0..self.inputs {
            if let Some(delay) = self.delays[j] {
                self.next[j] = input.delayed(-delay + inside, j);
            }
        }
    }

    /// A step from `t0` to `t1` begins, or begins again.
    #[inline(always)]
    pub fn begin_step(&mut self, arm: &Arm<T>, input: &impl Upstream<T>, t0: f64, t1: f64) {
        (self.start, self.time, self.end) = (t0, t0, t1);
        // What comes in may have jumped.
        self.values.copy_from_slice(&self.start_values);
        self.read(input, t0);
        let n = self.inputs;
        self.values[..n].copy_from_slice(&self.next[..n]);
        self.pass(arm, 0.0);
    }

    /// The step was accepted.
    #[inline(always)]
    pub fn end_step(&mut self, arm: &Arm<T>, input: &impl Upstream<T>, t1: f64) {
        self.go(arm, input, t1);
        self.start_values.copy_from_slice(&self.values);
    }

    /// The pressures that act at `t`, within the step begun last, into `out`.
    #[inline(always)]
    pub fn acting(&mut self, arm: &Arm<T>, input: &impl Upstream<T>, t: f64, out: &mut [T]) {
        self.go(arm, input, t);
        out.copy_from_slice(&self.values[self.values.len() - self.inputs..]);
    }

    /// To `t`, from sample to sample.
    #[inline(always)]
    fn go(&mut self, arm: &Arm<T>, input: &impl Upstream<T>, t: f64) {
        if t < self.time {
            let (start, end) = (self.start, self.end);
            self.begin_step(arm, input, start, end);
        }
        // Samples of delayed inputs come later; where delays differ, those of the first input count.
        let shift = self.delays.first().and_then(|d| *d).map_or(0.0, |d| d.largest());
        while self.time < t {
            let knot = input.next_sample(self.time - shift, &mut self.knot_cursor) + shift;
            let next = if knot > self.time && knot < t { knot } else { t };
            self.read(input, next);
            let elapsed = next - self.time;
            self.pass(arm, elapsed);
            self.time = next;
        }
    }

    /// All stages over `elapsed` seconds; what comes in ends at the first row of `next`.
    #[inline(always)]
    fn pass(&mut self, arm: &Arm<T>, elapsed: f64) {
        stages(self, arm, elapsed);
    }

    #[inline(always)]
    fn stages(&mut self, arm: &Arm<T>, elapsed: f64) {
        let n = self.inputs;
        for (k, &stage) in self.stages.iter().enumerate() {
            let (before, after) = self.next.split_at_mut(n * (k + 1));
            let (from, last) = self.values[n * k..n * (k + 2)].split_at(n);
            let p = &mut after[..n];
            p.copy_from_slice(&before[n * k..]);
            arm.effects.list[stage].kind.pressures(elapsed, from, last, p);
        }
        self.values.copy_from_slice(&self.next);
    }

    /// How far back the delays reach, s.
    pub fn horizon(&self) -> f64 {
        self.delays.iter().flatten().fold(0.0, |m: f64, d| m.max(d.largest()))
    }

    /// The first time after `t` at which a delayed input jumps.
    pub fn next_jump(&self, input: &impl Upstream<T>, t: f64) -> f64 {
        let mut first = f64::INFINITY;
        for delay in self.delays.iter().flatten() {
            for d in [delay.smallest(), delay.largest()] {
                // A hair later, so that rounding does not find the same jump again.
                let hair = 1e-9 * (1.0 + t.abs());
                first = first.min(input.next_jump(t - d + hair) + d);
            }
        }
        first
    }
}

kernel! {
    fn stages<'a, T>(chain: &'a mut PressureChain<T>, arm: &'a Arm<T>, elapsed: f64) {
        chain.stages(arm, elapsed);
    }
}

/// The pressures that act when everything rests at the logged `p`, in place.
pub fn at_rest<T: Real>(arm: &Arm<T>, p: &mut [T]) {
    for entry in &arm.effects.list {
        entry.kind.pressures_at_rest(p);
    }
}
