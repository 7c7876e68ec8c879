//! The chain between the logged (or commanded) pressures and those that act.
//!
//! Stages in the order of the file, after the delays. Each stage's state is its last output. All depend on time alone, not on the arm's motion, so
//! the chain is kept beside the arm: it moves forward through the samples of the input, in straight pieces, and goes back to
//! the step's start when a step is begun again. Every stage is exact on a straight piece of what comes in (see the kinds); a stage after
//! a lag gets the chord of the lag's output, an error of second order in the pieces, which are then no longer than
//! [`PIECE`].
//!
//! Behind chambers that shut air in ([`Sort::Remembering`]) pressures in the chain are those that the air would have at
//! constant volume, which the arm's motion does not change (`pneumatics::Chambers::reference`); stages that remember nothing
//! (gain, offset) act behind it, on the pressures themselves ([`read`]).
//!
//! A dead time and a lag do not mind the order: delayed commands lag as lagged ones are delayed. Behind chambers that lag
//! the chain therefore reads the commands themselves and has the lag as its first stage
//! ([`PressureChain::behind_commands`]): exact from sample to sample, with no past to note.

use super::kinds::pressure_lag::PressureLag;

use super::upstream::Upstream;
use super::{Effect, Effects, Entry};
use crate::real::{Real, kernel};

/// Longest piece where a stage follows a lag, s.
const PIECE: f64 = 5e-3;

/// Which effects on pressures a chain has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sort {
    /// All.
    All,
    /// Those that remember earlier pressures.
    Remembering,
}

/// The pressures of one run on their way through the chain.
#[derive(Clone, Debug)]
pub struct PressureChain<T> {
    /// Delay of each input, where there is one.
    delays: Vec<Option<T>>,
    /// The delay of all inputs, where each effect that delays one delays all.
    common: Option<T>,
    /// The lag of the chambers, where what comes in are commands.
    lag: Option<PressureLag<T>>,
    /// Longest piece, s.
    piece: f64,
    /// Indices of the stages among the arm's effects.
    stages: Vec<usize>,
    inputs: usize,
    /// Outputs: what comes in (delayed), then of the lag and of each stage; at `time`, and at the step's start.
    values: Vec<T>,
    start_values: Vec<T>,
    next: Vec<T>,
    /// Where each lane is on its way, from sample to sample of its own input.
    time: T,
    start: f64,
    end: f64,
    /// Clock of each lane's input minus the plant's.
    clock: T,
}

impl<T: Real> PressureChain<T> {
    /// The chain of an arm with `effects` and so many pressure inputs; none where no effect of the `sort` acts on pressures. At
    /// rest at `start` under what comes in then.
    pub fn new(
        (effects, sort): (&Effects<T>, Sort),
        inputs: usize,
        input: &mut impl Upstream<T>,
        start: f64,
    ) -> Option<Self> {
        Self::of((effects, sort), inputs, None, (input, start))
    }

    /// The chain of an arm whose chambers lag behind their commands, which come in: delays, the lag, and effects of the
    /// `sort`; none where there are neither delays nor such effects.
    pub fn behind_commands(
        (effects, sort): (&Effects<T>, Sort),
        inputs: usize,
        lag: PressureLag<T>,
        input: &mut impl Upstream<T>,
        start: f64,
    ) -> Option<Self> {
        Self::of((effects, sort), inputs, Some(lag), (input, start))
    }

    fn of(
        (effects, sort): (&Effects<T>, Sort),
        inputs: usize,
        lag: Option<PressureLag<T>>,
        (input, start): (&mut impl Upstream<T>, f64),
    ) -> Option<Self> {
        let list = &effects.list;
        let delays: Vec<Option<T>> = (0..inputs)
            .map(|j| {
                list.iter()
                    .filter_map(|e| e.kind.input_delay(j))
                    .fold(None, |sum: Option<T>, d| Some(sum.map_or(d, |s| s + d)))
            })
            .collect();
        let has = |k: &usize| {
            let kind = &list[*k].kind;
            kind.shapes_pressures() && (sort == Sort::All || kind.remembers())
        };
        let stages: Vec<usize> = (0..list.len()).filter(has).collect();
        if stages.is_empty() && delays.iter().all(Option::is_none) {
            return None;
        }
        let first = 1 + usize::from(lag.is_some());
        let lags = usize::from(lag.is_some()) + stages.iter().filter(|k| list[**k].kind.remembers()).count();
        let values = vec![T::zero(); inputs * (stages.len() + first)];
        let delayed = |e: &Entry<T>| (0..inputs).filter(|j| e.kind.input_delay(*j).is_some()).count();
        let alike = list.iter().all(|e| [0, inputs].contains(&delayed(e)));
        let common = delays.first().copied().flatten().filter(|_| alike);
        let mut chain = Self {
            delays,
            common,
            lag,
            piece: if lags > 1 { PIECE } else { f64::INFINITY },
            stages,
            inputs,
            start_values: values.clone(),
            next: values.clone(),
            values,
            time: T::from_f64(start),
            start,
            end: f64::INFINITY,
            clock: input.clock(),
        };
        chain.read(input, chain.time);
        let n = chain.inputs;
        if first > 1 {
            chain.next.copy_within(..n, n);
        }
        for (k, &stage) in (first..).zip(&chain.stages) {
            let (before, after) = chain.next.split_at_mut(n * k);
            let out = &mut after[..n];
            out.copy_from_slice(&before[n * (k - 1)..]);
            effects.list[stage].kind.pressures_at_rest(out);
        }
        chain.values.copy_from_slice(&chain.next);
        chain.start_values.copy_from_slice(&chain.next);
        Some(chain)
    }

    /// What comes in at `t`, with its delays, into the first row of `next`.
    #[inline(always)]
    fn read(&mut self, input: &mut impl Upstream<T>, t: T) {
        // Within a step the limit from inside belongs to it where a channel jumps at its ends.
        input.read(t, self.end, &mut self.next[..self.inputs]);
        // A hair on the input's clock: that is where a simulation alone has it, too.
        let hair = ((t + self.clock).abs() + 1.0) * 1e-9;
        let inside = t.max(hair + self.start).min(-hair + self.end);
        if let Some(delay) = self.common {
            input.all_delayed(inside - delay, &mut self.next[..self.inputs]);
            return;
        }
        for j in 0..self.inputs {
            if let Some(delay) = self.delays[j] {
                self.next[j] = input.delayed(inside - delay, j);
            }
        }
    }

    /// A step from `t0` to `t1` begins, or begins again.
    #[inline(always)]
    pub fn begin_step(&mut self, effects: &Effects<T>, input: &mut impl Upstream<T>, t0: f64, t1: f64) {
        (self.start, self.time, self.end) = (t0, T::from_f64(t0), t1);
        // What comes in may have jumped.
        self.values.copy_from_slice(&self.start_values);
        self.read(input, self.time);
        let n = self.inputs;
        self.values[..n].copy_from_slice(&self.next[..n]);
        self.pass(effects, T::zero());
    }

    /// Nothing comes in within the step begun last before `t`: each lane goes on from there.
    pub fn skip(&mut self, t: T) {
        self.time = self.time.max(t);
    }

    /// The step was accepted.
    #[inline(always)]
    pub fn end_step(&mut self, effects: &Effects<T>, input: &mut impl Upstream<T>, t1: f64) {
        self.go(effects, input, t1);
        self.start_values.copy_from_slice(&self.values);
    }

    /// The pressures that act at `t`, within the step begun last, into `out`.
    #[inline(always)]
    pub fn acting(&mut self, effects: &Effects<T>, input: &mut impl Upstream<T>, t: f64, out: &mut [T]) {
        self.go(effects, input, t);
        out.copy_from_slice(&self.values[self.values.len() - self.inputs..]);
    }

    /// To `t`, each lane from sample to sample of its input; lanes that are there wait for the others.
    #[inline(always)]
    fn go(&mut self, effects: &Effects<T>, input: &mut impl Upstream<T>, t: f64) {
        if t < self.time.largest() {
            let (start, end) = (self.start, self.end);
            self.begin_step(effects, input, start, end);
        }
        // Samples of delayed inputs come later; where delays differ, those of the first input count.
        let shift = self.delays.first().and_then(|d| *d).map_or(0.0, |d| d.largest());
        let end = T::from_f64(t);
        let hair = 1e-12 * (1.0 + self.clock.abs().largest() + t.abs());
        while self.time.smallest() < t {
            // A sample that is here or at the end but for rounding bends nothing on the way.
            let knot = input.next_sample(self.time - shift + hair) + shift;
            let next = T::select(end - knot - hair, knot, end).min(self.time + self.piece);
            self.read(input, next);
            let elapsed = next - self.time;
            self.pass(effects, elapsed);
            self.time = next;
        }
    }

    /// All stages over `elapsed` seconds; what comes in ends at the first row of `next`.
    #[inline(always)]
    fn pass(&mut self, effects: &Effects<T>, elapsed: T) {
        stages(self, effects, elapsed);
    }

    #[inline(always)]
    fn stages(&mut self, effects: &Effects<T>, elapsed: T) {
        let n = self.inputs;
        let mut first = 1;
        if let Some(lag) = &self.lag {
            first = 2;
            let (before, after) = self.next.split_at_mut(n);
            let (from, last) = self.values[..2 * n].split_at(n);
            after[..n].copy_from_slice(before);
            lag.pressures(elapsed, from, last, &mut after[..n]);
        }
        for (k, &stage) in (first..).zip(&self.stages) {
            let (before, after) = self.next.split_at_mut(n * k);
            let (from, last) = self.values[n * (k - 1)..n * (k + 1)].split_at(n);
            let p = &mut after[..n];
            p.copy_from_slice(&before[n * (k - 1)..]);
            effects.list[stage].kind.pressures(elapsed, from, last, p);
        }
        self.values.copy_from_slice(&self.next);
    }

    /// The stages where they stand if pressures have moved before, see [`Effect::moved_pressures`]; one number an input.
    pub fn moved(&mut self, effects: &Effects<T>, moved: &[T]) {
        let n = self.inputs;
        let first = 1 + usize::from(self.lag.is_some());
        let mut by = vec![T::zero(); n];
        for (k, &stage) in (first..).zip(&self.stages) {
            effects.list[stage].kind.moved_pressures(moved, &mut by);
            for (value, by) in self.start_values[n * k..].iter_mut().zip(&by) {
                *value += *by;
            }
        }
        self.values.copy_from_slice(&self.start_values);
    }

    /// The outputs of all stages at the end of the last accepted step.
    pub fn committed(&self) -> &[T] {
        &self.start_values
    }

    /// Goes on at `t` from outputs as [`PressureChain::committed`] gives them.
    pub fn resume(&mut self, t: f64, outputs: &[T]) {
        self.start_values.copy_from_slice(outputs);
        self.values.copy_from_slice(outputs);
        (self.start, self.time) = (t, T::from_f64(t));
    }

    /// How far back the delays reach, s.
    pub fn horizon(&self) -> f64 {
        self.delays.iter().flatten().fold(0.0, |m: f64, d| m.max(d.largest()))
    }

    /// The first time after `t` at which a delayed input jumps, or bends where it then lags.
    pub fn next_jump(&self, input: &impl Upstream<T>, t: f64) -> f64 {
        let next = |t| if self.lag.is_some() { input.next_jump(t).min(input.next_bend(t)) } else { input.next_jump(t) };
        let mut first = f64::INFINITY;
        for delay in self.delays.iter().flatten() {
            for d in [delay.smallest(), delay.largest()] {
                // A hair later, so that rounding does not find the same jump again.
                let hair = 1e-9 * (1.0 + t.abs());
                first = first.min(next(t - d + hair) + d);
            }
        }
        first
    }
}

kernel! {
    fn stages<'a, T>(chain: &'a mut PressureChain<T>, effects: &'a Effects<T>, elapsed: T) {
        chain.stages(effects, elapsed);
    }
}

/// Whether effects on pressures are left over behind those that remember.
pub fn has_readings<T: Real>(effects: &Effects<T>) -> bool {
    effects.list.iter().any(|e| e.kind.shapes_pressures() && !e.kind.remembers())
}

/// Whether what effects make of a pressure depends on earlier ones, delays aside.
pub fn has_memory<T: Real>(effects: &Effects<T>) -> bool {
    effects.list.iter().any(|e| e.kind.shapes_pressures() && e.kind.remembers())
}

/// What these make of pressures, in place.
#[inline(always)]
pub fn read<T: Real>(effects: &Effects<T>, p: &mut [T]) {
    for entry in &effects.list {
        if !entry.kind.remembers() {
            entry.kind.pressures_at_rest(p);
        }
    }
}

/// The pressures that act when everything rests at the logged `p`, in place.
pub fn at_rest<T: Real>(effects: &Effects<T>, p: &mut [T]) {
    for entry in &effects.list {
        entry.kind.pressures_at_rest(p);
    }
}
