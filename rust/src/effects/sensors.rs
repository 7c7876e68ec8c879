//! The chain between what is and what is measured. Lengths: delay first, then play, then gains and offsets in the order of
//! the file. Poses of heads: delay, the whole arm's pose of that time, then what is seen of it.

use super::{Effects, poses};
use crate::body::Body;
use crate::kinematics::link::Link;
use crate::kinematics::section::Pose;
use crate::real::{Real, replace};
use std::collections::VecDeque;

/// What delayed sensors need to remember: the states at the ends of steps, as far back as the longest delay.
#[derive(Clone, Debug)]
pub struct Sensors<T> {
    /// Delay of each length sensor, where there is one.
    delays: Vec<Option<T>>,
    /// Delay of what measures each head: the effects that make it, and their sum.
    heads: Vec<(Vec<usize>, T)>,
    /// Whether something else acts on measured heads.
    seen: bool,
    /// Half the play of each length sensor, where there is one.
    plays: Vec<Option<T>>,
    /// Readings behind it, at the start and at the end of the last step; empty where no sensor has play.
    readings: [Vec<T>; 2],
    longest: f64,
    /// Times, oldest first, and lengths and rates there, row by row.
    times: VecDeque<f64>,
    states: VecDeque<Vec<T>>,
}

impl<T: Real> Sensors<T> {
    /// The sensors of an arm with `effects`, which rests at `x` until `start`; none where no effect acts on what is measured.
    pub fn new(effects: &Effects<T>, start: f64, x: &[T]) -> Option<Self> {
        let (list, n) = (&effects.list, x.len() / 2);
        let delays: Vec<Option<T>> = (0..n)
            .map(|j| {
                list.iter()
                    .filter_map(|e| e.kind.sensor_delay(j))
                    .fold(None, |sum: Option<T>, d| Some(sum.map_or(d, |s| s + d)))
            })
            .collect();
        let head = |i: usize| {
            let mut delay = (Vec::new(), T::zero());
            for (number, d) in list.iter().enumerate().filter_map(|(k, e)| Some((k, e.kind.head_delay(i)?))) {
                delay.0.push(number);
                delay.1 += d;
            }
            delay
        };
        let heads: Vec<_> = (0..n / 3).map(head).collect();
        let all = delays.iter().flatten().copied().chain(heads.iter().map(|h| h.1));
        let longest = all.fold(0.0, |m: f64, d| m.max(d.largest()));
        // Plays one behind the other are one of the sum of their widths.
        let play = |j: usize| list.iter().filter_map(|e| e.kind.play(j)).reduce(|sum, w| sum + w);
        let plays: Vec<Option<T>> = (0..n).map(play).collect();
        let seen = list.iter().any(|e| e.kind.shapes_heads());
        let on_lengths = list.iter().any(|e| e.kind.shapes_lengths()) || plays.iter().any(Option::is_some);
        let delayed = delays.iter().any(Option::is_some) || heads.iter().any(|(effects, _)| !effects.is_empty());
        if !(delayed || on_lengths || seen) {
            return None;
        }
        let (times, states) = (VecDeque::from([start]), VecDeque::from([x.to_vec()]));
        let read = if plays.iter().any(Option::is_some) { x[..n].to_vec() } else { Vec::new() };
        Some(Self { delays, heads, seen, plays, readings: [read.clone(), read], longest, times, states })
    }

    /// A step ended at (`t`, `x`).
    pub fn end_step(&mut self, t: f64, x: &[T]) {
        self.remember(t, x);
        let [start, end] = &mut self.readings;
        std::mem::swap(start, end);
        for j in 0..self.readings[1].len() {
            self.readings[1][j] = self.played(t, x, j);
        }
    }

    /// The state at the end of a step, as long as a delay may ask for it.
    fn remember(&mut self, t: f64, x: &[T]) {
        if self.longest == 0.0 {
            return;
        }
        // One state older than the longest delay stays, to interpolate from; rows within the last step look back from
        // its start.
        let horizon = self.times.back().copied().unwrap_or(t) - self.longest;
        let mut row = Vec::new();
        while self.times.len() > 2 && self.times[1] < horizon {
            self.times.pop_front();
            row = self.states.pop_front().unwrap_or_default();
        }
        row.clear();
        row.extend_from_slice(x);
        self.times.push_back(t);
        self.states.push_back(row);
    }

    /// Readings where they stand if lengths have moved before: `moved` says of each bellows which end of its play its wire
    /// is at, -1 to 1; at rest where wires are of other coordinates.
    pub fn moved(&mut self, moved: &[T]) {
        if moved.len() != self.plays.len() {
            return;
        }
        for readings in &mut self.readings {
            for (reading, (play, moved)) in readings.iter_mut().zip(self.plays.iter().zip(moved)) {
                if let Some(play) = play {
                    *reading += *play * *moved;
                }
            }
        }
    }

    /// The lanes that `which` says have rested at `x` since ever.
    pub fn restart(&mut self, which: impl Fn(usize) -> bool + Copy, x: &[T]) {
        for row in &mut self.states {
            replace(row, x, which);
        }
        for readings in &mut self.readings {
            let n = readings.len();
            replace(readings, &x[..n], which);
        }
    }

    /// Calls `elapsed` s after the clock's present zero its new one.
    pub fn rewind(&mut self, elapsed: f64) {
        self.times.iter_mut().for_each(|t| *t -= elapsed);
    }

    /// Readings behind the play of sensors, at the end of the last step.
    pub fn readings(&self) -> &[T] {
        &self.readings[1]
    }

    /// Goes on from what [`Sensors::readings`] gave, the first of `numbers`; how many they are.
    pub fn read_on(&mut self, numbers: &[T]) -> usize {
        let n = self.readings[1].len();
        for readings in &mut self.readings {
            readings.copy_from_slice(&numbers[..n]);
        }
        n
    }

    /// What is remembered: times, oldest first, and the states then, one after the other.
    pub fn remembered(&self) -> (Vec<f64>, Vec<T>) {
        (self.times.iter().copied().collect(), self.states.iter().flatten().copied().collect())
    }

    /// Goes on from what [`Sensors::remembered`] gave; `size` numbers a state.
    pub fn resume(&mut self, times: &[f64], states: &[T], size: usize) {
        self.times = times.iter().copied().collect();
        self.states = states.chunks_exact(size).map(<[T]>::to_vec).collect();
    }

    /// Measured lengths at `t`, where the state is `x`, into `out`.
    pub fn measure(&self, effects: &Effects<T>, t: f64, x: &[T], out: &mut [T]) {
        for (j, length) in out.iter_mut().enumerate() {
            let mut q = self.played(t, x, j);
            for entry in &effects.list {
                q = entry.kind.measure(j, q);
            }
            *length = q;
        }
    }

    /// Length `j` at `t` behind delay and play.
    fn played(&self, t: f64, x: &[T], j: usize) -> T {
        let length = match self.delays[j] {
            None => x[j],
            Some(delay) => self.at(-delay + t, t, x, j),
        };
        match self.plays[j] {
            None => length,
            Some(play) => self.readings[0][j].max(length - play).min(length + play),
        }
    }

    /// Whether heads are measured otherwise than they are, one at least.
    pub fn changes_heads(&self) -> bool {
        self.seen || self.heads.iter().any(|(effects, _)| !effects.is_empty())
    }

    /// Measured poses of the heads at `t`, where the state is `x`, in order; `links` is work space, one a section.
    pub fn measure_heads(
        &self,
        body: &Body<T>,
        effects: &Effects<T>,
        t: f64,
        x: &[T],
        links: &mut [Link<T>],
        mut each: impl FnMut(usize, Pose<T>),
    ) {
        let n = x.len() / 2;
        let mut q = x[..n].to_vec();
        // A head's pose is that of its time, with all that the arm below (and the loads above) then did. Neighbours
        // with the same delay share a pass.
        let mut first = 0;
        for group in self.heads.chunk_by(|a, b| a.0 == b.0) {
            let own = first..first + group.len();
            first = own.end;
            let (own_delays, delay) = &group[0];
            for (j, length) in q.iter_mut().enumerate() {
                *length = if own_delays.is_empty() { x[j] } else { self.at(-*delay + t, t, x, j) };
            }
            poses::seen(body, effects, &q, links, |i, mut head| {
                if own.contains(&i) {
                    for entry in &effects.list {
                        entry.kind.see(i, &mut head);
                    }
                    each(i, head);
                }
            });
        }
    }

    /// Length `j` at the earlier time `when`: a sum over the pieces that `when` may lie in, so that lanes may lie apart.
    fn at(&self, when: T, t: f64, x: &[T], j: usize) -> T {
        let (low, high) = (when.smallest(), when.largest());
        let last = self.times.len();
        let time = |k: usize| if k < last && self.times[k] < t { self.times[k] } else { t };
        let state = |k: usize| -> &[T] { if k < last && self.times[k] < t { &self.states[k] } else { x } };
        let mut k = self.times.partition_point(|s| *s <= low && *s < t).max(1) - 1;
        let n = x.len() / 2;
        let mut value = state(k)[j];
        while time(k) < high && time(k) < t {
            let (t0, t1) = (time(k), time(k + 1));
            let h = t1 - t0;
            // Cubic through lengths and rates at both ends.
            let s = ((when - t0) * (1.0 / h)).max(T::zero()).min(T::one());
            let (a, b) = (state(k), state(k + 1));
            let (v0, v1, travel) = (a[n + j] * h, b[n + j] * h, b[j] - a[j]);
            let (c2, c3) = (travel * 3.0 - v0 * 2.0 - v1, v0 + v1 - travel * 2.0);
            value += s * (v0 + s * (c2 + s * c3));
            k += 1;
        }
        value
    }
}
