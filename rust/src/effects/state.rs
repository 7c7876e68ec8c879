//! What effects see of the arm at one instant, and their hidden states.

use super::Effects;
use crate::body::Body;
use crate::forces::{Load, length};
use crate::kinematics::coordinates::arc_from_lengths;
use crate::kinematics::link::Link;
use crate::real::linear::Vec3;
use crate::real::{Real, kernel};

/// One bellows at one instant.
#[derive(Clone, Copy, Debug)]
pub struct BellowsState<T> {
    /// Length, m.
    pub length: T,
    /// Its rate, m/s.
    pub rate: T,
    /// Pressure above ambient, Pa.
    pub pressure: T,
    /// Length at the step's start, m.
    pub start_length: T,
    /// Its rate there, m/s.
    pub start_rate: T,
}

/// What a force sees.
pub struct Instant<'a, T> {
    /// The arm's body.
    pub body: &'a Body<T>,
    /// Kinematics of each section.
    pub links: &'a [Link<T>],
    /// All bellows, section by section.
    pub bellows: &'a [BellowsState<T>],
    /// Extra force of each bellows, N; like pressure, positive pushes its ends apart.
    pub bellows_force: &'a mut [T],
    /// Loads of each section.
    pub loads: &'a mut [Load<T>],
    /// Time on the caller's clock, s.
    pub time: f64,
    /// Time since the step began, s; none outside a simulation, where hidden states are at rest.
    pub elapsed: Option<f64>,
}

/// Work space of the effects of one arm, and their hidden states.
#[derive(Clone, Debug)]
pub struct EffectState<T> {
    /// Time of the instant, s.
    pub time: f64,
    /// The caller's clock minus the plant's, s (formulas read the caller's).
    pub clock: f64,
    start: Option<f64>,
    pub(crate) bellows: Vec<BellowsState<T>>,
    pub(crate) bellows_force: Vec<T>,
    hidden: Vec<T>,
}

impl<T: Real> EffectState<T> {
    /// Work space for `body` with `effects`, hidden states where these start.
    pub fn new(body: &Body<T>, effects: &Effects<T>) -> Self {
        let count = body.sections.iter().map(|s| s.bellows.len()).sum();
        let o = T::zero();
        let still = BellowsState { length: o, rate: o, pressure: o, start_length: o, start_rate: o };
        Self {
            time: 0.0,
            clock: 0.0,
            start: None,
            bellows: vec![still; count],
            bellows_force: vec![o; count],
            hidden: effects.start(),
        }
    }

    /// Hidden states at the step's start (or the last commit), one effect after the other.
    pub fn hidden(&self) -> &[T] {
        &self.hidden
    }

    /// The same, to set them.
    pub fn hidden_mut(&mut self) -> &mut [T] {
        &mut self.hidden
    }

    /// A step begins at `t0` with lengths and rates `x0`.
    #[inline(always)]
    pub fn begin_step(&mut self, body: &Body<T>, t0: f64, x0: &[T]) {
        self.start = Some(t0);
        if self.hidden.is_empty() {
            return;
        }
        self.read(body, x0);
        for b in &mut self.bellows {
            (b.start_length, b.start_rate) = (b.length, b.rate);
        }
    }

    /// The step was accepted: takes the hidden states to (`t1`, `x1`).
    #[inline(always)]
    pub fn end_step(&mut self, body: &Body<T>, effects: &Effects<T>, t1: f64, x1: &[T]) {
        self.time = t1;
        if self.hidden.is_empty() {
            return;
        }
        self.read(body, x1);
        let elapsed = self.start.map(|t0| t1 - t0);
        advance(self, body, effects, t1, elapsed);
    }

    /// Lengths and rates of all bellows from the state.
    #[inline(always)]
    fn read(&mut self, body: &Body<T>, x: &[T]) {
        let n = x.len() / 2;
        let mut all = self.bellows.iter_mut();
        for (i, section) in body.sections.iter().enumerate() {
            let arc = three(x, 3 * i, section.inverse_radius);
            let rate = three(x, n + 3 * i, section.inverse_radius);
            for (b, state) in section.bellows.iter().zip(&mut all) {
                state.length = length(b, arc);
                state.rate = length(b, rate);
            }
        }
    }
}

kernel! {
    /// Takes the hidden states to the instant `time`, `elapsed` seconds after the step's start.
    fn advance<'a, T>(state: &'a mut EffectState<T>, body: &'a Body<T>, effects: &'a Effects<T>, time: f64, elapsed: Option<f64>) {
        let EffectState { bellows, bellows_force, hidden, clock, .. } = state;
        let time = time + *clock;
        let now = Instant { body, links: &[], bellows, bellows_force, loads: &mut [], time, elapsed };
        for entry in &effects.list {
            entry.kind.advance(&now, &mut hidden[entry.hidden.clone()]);
        }
    }
}

/// (u, v, l), or their rates, from three entries of the state.
#[inline(always)]
fn three<T: Real>(x: &[T], k: usize, inverse_radius: T) -> Vec3<T> {
    arc_from_lengths(Vec3([x[k], x[k + 1], x[k + 2]]), inverse_radius)
}

kernel! {
    /// Adds the forces of all effects of the wanted sort (`actuation`: those that belong to tau) to `loads` and to the bellows'
    /// extra forces.
    pub(crate) fn add_forces<'a, T>(
        body: &'a Body<T>,
        effects: &'a Effects<T>,
        which: (bool, bool),
        p: &'a [T],
        links: &'a [Link<T>],
        state: &'a mut EffectState<T>,
        loads: &'a mut [Load<T>],
    ) {
        let (actuation, passive) = which;
        let EffectState { time, clock, start, bellows, bellows_force, hidden } = state;
        for force in bellows_force.iter_mut() {
            *force = T::zero();
        }
        let mut all = bellows.iter_mut();
        for (section, link) in body.sections.iter().zip(links) {
            for (b, state) in section.bellows.iter().zip(&mut all) {
                state.length = length(b, link.arc);
                state.rate = length(b, link.rate);
                state.pressure = if actuation { p[b.input] - body.ambient_pressure } else { T::zero() };
            }
        }
        let elapsed = start.map(|t0| *time - t0);
        let mut now = Instant { body, links, bellows, bellows_force, loads, time: *time + *clock, elapsed };
        for entry in &effects.list {
            if if entry.kind.is_actuation() { actuation } else { passive } {
                entry.kind.add_forces(&mut now, &hidden[entry.hidden.clone()]);
            }
        }
    }
}
