//! The arm as a system of differential equations under its inputs: x = (q, q').

use crate::arm::Arm;
use crate::dynamics::Workspace;
use crate::dynamics::recursion::forward_dynamics_into;
use crate::effects::pressures::PressureChain;
use crate::effects::sensors::Sensors;
use crate::input::{Cursor, Input};
use crate::integrate::System;
use crate::kinematics::arc::PSI_MAX;
use crate::kinematics::coordinates::arc_from_lengths;
use crate::linear::Vec3;
use crate::real::Real;
use std::sync::Arc;

/// An arm under an input.
#[derive(Clone, Debug)]
pub struct Plant<T = f64> {
    /// The arm.
    pub arm: Arc<Arm<T>>,
    /// Its input.
    pub input: Arc<Input>,
    ws: Workspace<T>,
    pressures: Vec<T>,
    cursor: Cursor,
    step_end: f64,
    /// Set up when the first step begins, where the arm has effects on pressures or on sensors.
    chain: Option<PressureChain<T>>,
    sensors: Option<Sensors<T>>,
    begun: bool,
}

impl<T: Real> Plant<T> {
    /// The plant of `arm` under `input`, whose channels must be the arm's inputs.
    pub fn new(arm: Arc<Arm<T>>, input: Arc<Input>) -> Self {
        let (ws, pressures) = (Workspace::new(&arm), vec![T::zero(); arm.inputs]);
        let (cursor, step_end) = (Cursor::default(), f64::INFINITY);
        Self { arm, input, ws, pressures, cursor, step_end, chain: None, sensors: None, begun: false }
    }

    /// Whether sensors of lengths are modelled.
    pub fn has_sensors(&self) -> bool {
        self.sensors.is_some()
    }

    /// The run begins at (`t`, `x`), with the effects' hidden states at rest. The first step calls it if nobody did.
    pub fn begin(&mut self, t: f64, x: &[T]) {
        self.begun = true;
        self.chain = PressureChain::new(&self.arm, &self.input, t);
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
        let place = self.input.weight(t, t >= self.step_end, &mut self.cursor);
        for (j, p) in self.pressures.iter_mut().enumerate() {
            *p = T::from_f64(self.input.pressure(place, j));
        }
        if let Some(chain) = &mut self.chain {
            chain.acting(&self.arm, &self.input, t, &mut self.pressures);
        }
        if self.input.has_forces() {
            for (i, f) in self.ws.external.iter_mut().enumerate() {
                *f = Vec3([0, 1, 2].map(|k| T::from_f64(self.input.force(place, 3 * i + k))));
            }
        }
    }
}

impl<T: Real> System<T> for Plant<T> {
    #[inline(always)]
    fn begin_step(&mut self, t0: f64, t1: f64, x0: &[T]) {
        self.step_end = t1;
        if !self.begun {
            self.begin(t0, x0);
        }
        if let Some(chain) = &mut self.chain {
            chain.begin_step(&self.arm, &self.input, t0, t1);
        }
        self.ws.effects.begin_step(&self.arm, t0, x0);
    }

    #[inline(always)]
    fn end_step(&mut self, t1: f64, x1: &[T]) {
        self.ws.effects.end_step(&self.arm, t1, x1);
        if let Some(chain) = &mut self.chain {
            chain.end_step(&self.arm, &self.input, t1);
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
        let f_ext = self.input.has_forces().then_some(external.as_slice());
        forward_dynamics_into(&self.arm, q, qd, &self.pressures, f_ext, &mut self.ws, dqd);
        self.ws.external = external;
    }

    fn next_break(&mut self, t: f64) -> f64 {
        let jump = self.input.next_jump(t);
        match &self.chain {
            Some(chain) => jump.min(chain.next_jump(&self.input, t)),
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
