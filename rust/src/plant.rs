//! The arm as a system of differential equations under its inputs: x = (q, q').

use crate::arm::Arm;
use crate::dynamics::Workspace;
use crate::dynamics::recursion::ForwardDynamics;
use crate::effects::pressures::PressureChain;
use crate::effects::sensors::Sensors;
use crate::input::{Cursor, Input};
use crate::integrate::System;
use crate::kinematics::arc::PSI_MAX;
use crate::kinematics::coordinates::arc_from_lengths;
use crate::linear::Vec3;
use crate::real::Real;
use std::sync::Arc;

/// Most lanes of any scalar.
const MOST_LANES: usize = 8;

/// An arm under an input, or several abreast.
#[derive(Clone, Debug)]
pub struct Plant<T = f64> {
    /// The arm, or the arms abreast.
    pub arm: Arc<Arm<T>>,
    drives: Vec<Drive>,
    ws: Workspace<T>,
    pressures: Vec<T>,
    /// Time of the pressures, and whether from the left.
    read: (f64, bool),
    step_end: f64,
    /// Set up when the first step begins, where the arm has effects on pressures or on sensors.
    chain: Option<PressureChain<T>>,
    sensors: Option<Sensors<T>>,
    begun: bool,
}

/// An input and where its readers stand.
#[derive(Clone, Debug)]
struct Drive {
    input: Arc<Input>,
    /// Its clock minus the plant's, s.
    offset: f64,
    cursor: Cursor,
}

impl<T: Real> Plant<T> {
    /// The plant of `arm` under `input`, whose channels must be the arm's inputs.
    pub fn new(arm: Arc<Arm<T>>, input: Arc<Input>) -> Self {
        Self::abreast(arm, vec![(input, 0.0)])
    }

    /// The plant of arms abreast, each under its own input: `inputs[k]` drives lane `k` (the only one all lanes) with its
    /// clock ahead of the plant's by the seconds given. Either all inputs have forces or none. Arms with effects on
    /// pressures need one input, and its own clock.
    pub fn abreast(arm: Arc<Arm<T>>, inputs: Vec<(Arc<Input>, f64)>) -> Self {
        let cursor = Cursor::default();
        let drives = inputs.into_iter().map(|(input, offset)| Drive { input, offset, cursor }).collect();
        let (ws, pressures) = (Workspace::new(&arm), vec![T::zero(); arm.inputs]);
        let (read, step_end) = ((f64::NAN, false), f64::INFINITY);
        Self { arm, drives, ws, pressures, read, step_end, chain: None, sensors: None, begun: false }
    }

    /// Whether there are external forces.
    #[inline(always)]
    fn has_forces(&self) -> bool {
        self.drives[0].input.has_forces()
    }

    /// Whether sensors of lengths are modelled.
    pub fn has_sensors(&self) -> bool {
        self.sensors.is_some()
    }

    /// The run begins at (`t`, `x`), with the effects' hidden states at rest. The first step calls it if nobody did.
    pub fn begin(&mut self, t: f64, x: &[T]) {
        self.begun = true;
        self.read.0 = f64::NAN;
        self.chain = PressureChain::new(&self.arm, &self.drives[0].input, t);
        self.sensors = Sensors::new(&self.arm, t, x);
    }

    /// Lengths as their sensors have them at (`t`, `x`), within the last step, into `out`: the true ones where no sensor
    /// is modelled.
    pub fn measured_lengths_into(&self, t: f64, x: &[T], out: &mut [T]) {
        match &self.sensors {
            Some(sensors) => sensors.measure(&self.arm, t, x, out),
            None => out.copy_from_slice(&x[..out.len()]),
        }
    }

    /// Reads the inputs at `t` into the work space.
    #[inline(always)]
    fn read_input(&mut self, t: f64) {
        // At a step's end the limit from the left belongs to the step, also where a channel jumps.
        let before = t >= self.step_end;
        if self.read == (t, before) {
            return;
        }
        self.read = (t, before);
        let Self { drives, pressures, ws, chain, arm, .. } = self;
        let forces = drives[0].input.has_forces();
        if let [drive] = drives.as_mut_slice() {
            let place = drive.input.weight(t + drive.offset, before, &mut drive.cursor);
            match chain {
                Some(chain) => chain.acting(arm, &drive.input, t, pressures),
                None => {
                    for (j, p) in pressures.iter_mut().enumerate() {
                        *p = T::from_f64(drive.input.pressure(place, j));
                    }
                }
            }
            if forces {
                for (i, f) in ws.external.iter_mut().enumerate() {
                    for (k, f) in f.0.iter_mut().enumerate() {
                        *f = T::from_f64(drive.input.force(place, 3 * i + k));
                    }
                }
            }
            return;
        }
        let mut places = [(0, 0.0); MOST_LANES];
        for (place, drive) in places.iter_mut().zip(drives.iter_mut()) {
            *place = drive.input.weight(t + drive.offset, before, &mut drive.cursor);
        }
        for (j, p) in pressures.iter_mut().enumerate() {
            *p = T::from_lanes(|k| drives[k].input.pressure(places[k], j));
        }
        if forces {
            for (i, f) in ws.external.iter_mut().enumerate() {
                for (c, f) in f.0.iter_mut().enumerate() {
                    *f = T::from_lanes(|k| drives[k].input.force(places[k], 3 * i + c));
                }
            }
        }
    }
}

impl<T: Real> System<T> for Plant<T> {
    #[inline(always)]
    fn begin_step(&mut self, t0: f64, t1: f64, x0: &[T]) {
        self.step_end = t1;
        // The chain's pressures belong to the step.
        if self.chain.is_some() {
            self.read.0 = f64::NAN;
        }
        if !self.begun {
            self.begin(t0, x0);
        }
        if let Some(chain) = &mut self.chain {
            chain.begin_step(&self.arm, &self.drives[0].input, t0, t1);
        }
        self.ws.effects.begin_step(&self.arm, t0, x0);
    }

    #[inline(always)]
    fn end_step(&mut self, t1: f64, x1: &[T]) {
        self.ws.effects.end_step(&self.arm, t1, x1);
        if let Some(chain) = &mut self.chain {
            chain.end_step(&self.arm, &self.drives[0].input, t1);
        }
        if let Some(sensors) = &mut self.sensors {
            sensors.end_step(t1, x1);
        }
    }

    #[inline(always)]
    fn derivative(&mut self, t: f64, x: &[T], dx: &mut [T]) {
        self.read_input(t);
        self.ws.effects.time = t;
        let n = x.len() / 2;
        let (q, qd) = x.split_at(n);
        let (dq, dqd) = dx.split_at_mut(n);
        dq.copy_from_slice(qd);
        let external = std::mem::take(&mut self.ws.external);
        let f_ext = self.has_forces().then_some(external.as_slice());
        let (arm, p, ws) = (&self.arm, self.pressures.as_slice(), &mut self.ws);
        T::enter(ForwardDynamics { arm, q, qd, p, f_ext, ws, qdd: dqd });
        self.ws.external = external;
    }

    fn next_break(&mut self, t: f64) -> f64 {
        let next = |d: &Drive| d.input.next_jump(t + d.offset) - d.offset;
        let jump = self.drives.iter().map(next).fold(f64::INFINITY, f64::min);
        match &self.chain {
            Some(chain) => jump.min(chain.next_jump(&self.drives[0].input, t)),
            None => jump,
        }
    }

    fn objection(&self, x: &[T]) -> Option<String> {
        for (i, section) in self.arm.sections.iter().enumerate() {
            let [u, v, l] = arc_from_lengths(Vec3([x[3 * i], x[3 * i + 1], x[3 * i + 2]]), section.inverse_radius).0;
            if (u * u + v * v).largest() > PSI_MAX * PSI_MAX {
                return Some(format!("section {} bends by more than one and a half turns", i + 1));
            }
            if l.smallest() <= 0.0 {
                return Some(format!("section {}'s mean length is not positive", i + 1));
            }
        }
        None
    }
}
