//! The arm as a system of differential equations under its inputs: x = (q, q').

use crate::arm::Arm;
use crate::dynamics::Workspace;
use crate::dynamics::recursion::forward_dynamics_into;
use crate::input::{Cursor, Input};
use crate::integrate::System;
use crate::kinematics::arc::PSI_MAX;
use crate::kinematics::coordinates::arc_from_lengths;
use crate::linear::Vec3;
use crate::pneumatics::Chambers;
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
    /// Pneumatics between the input's pressures and those that act.
    chambers: Option<Chambers<T>>,
    /// Pressures commanded from outside, in place of the input's.
    held: Option<Vec<T>>,
    /// Acting pressures at the outputs so far, one an input each; empty without pneumatics.
    pub acting: Vec<T>,
    cursor: Cursor,
    jump_cursor: Cursor,
    step_end: f64,
}

impl<T: Real> Plant<T> {
    /// The plant of `arm` under `input`, whose channels must be the arm's inputs.
    pub fn new(arm: Arc<Arm<T>>, input: Arc<Input>) -> Self {
        let (ws, pressures) = (Workspace::new(&arm), vec![T::zero(); arm.inputs]);
        let (cursor, jump_cursor) = (Cursor::default(), Cursor::default());
        let (chambers, held, acting) = (None, None, Vec::new());
        Self { arm, input, ws, pressures, chambers, held, acting, cursor, jump_cursor, step_end: f64::INFINITY }
    }

    /// The same plant with the arm's pneumatics, at rest at lengths `q` under pressures `p`.
    pub fn with_pneumatics(mut self, q: &[T], p: &[T]) -> Self {
        self.chambers = Chambers::new(&self.arm, q, p);
        self
    }

    /// Whether pneumatics lie between command and acting pressure.
    pub fn has_pneumatics(&self) -> bool {
        self.chambers.is_some()
    }

    /// Commands `p` from now on, in place of the input's pressures.
    #[inline(always)]
    pub fn hold(&mut self, p: &[T]) {
        match &mut self.held {
            Some(held) => held.copy_from_slice(p),
            None => self.held = Some(p.to_vec()),
        }
    }

    /// The acting pressures at the last stage evaluated or the last output, Pa.
    pub fn pressures(&self) -> &[T] {
        &self.pressures
    }

    /// Reads the inputs at `t` into the work space; `q` are the lengths then.
    #[inline(always)]
    fn read_input(&mut self, t: f64, q: &[T]) {
        // At a step's end the limit from the left belongs to the step, also where a channel jumps.
        let place = self.input.weight(t, t >= self.step_end, &mut self.cursor);
        if let Some(chambers) = &mut self.chambers {
            chambers.pressures(&self.arm, t, q, &mut self.pressures);
        } else if let Some(held) = &self.held {
            self.pressures.copy_from_slice(held);
        } else {
            for (j, p) in self.pressures.iter_mut().enumerate() {
                *p = T::from_f64(self.input.pressure(place, j));
            }
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
        if let Some(chambers) = &mut self.chambers {
            let (input, held) = (&self.input, &self.held);
            let from = input.weight(t0, false, &mut self.cursor);
            let to = input.weight(t1, true, &mut self.cursor);
            let reference = |j: usize| match held {
                Some(p) => (p[j], p[j]),
                None => (T::from_f64(input.pressure(from, j)), T::from_f64(input.pressure(to, j))),
            };
            chambers.begin_step(&self.arm, (t0, t1), x0.split_at(x0.len() / 2), reference);
        }
    }

    #[inline(always)]
    fn end_step(&mut self, _t1: f64, _x1: &[T]) {
        if let Some(chambers) = &mut self.chambers {
            chambers.end_step();
        }
    }

    fn output(&mut self, t: f64, x: &[T]) {
        if let Some(chambers) = &mut self.chambers {
            chambers.pressures(&self.arm, t, &x[..x.len() / 2], &mut self.pressures);
            self.acting.extend_from_slice(&self.pressures);
        }
    }

    #[inline(always)]
    fn derivative(&mut self, t: f64, x: &[T], dx: &mut [T]) {
        let n = x.len() / 2;
        let (q, qd) = x.split_at(n);
        self.read_input(t, q);
        let (dq, dqd) = dx.split_at_mut(n);
        dq.copy_from_slice(qd);
        let external = std::mem::take(&mut self.ws.external);
        let f_ext = self.input.has_forces().then_some(external.as_slice());
        forward_dynamics_into(&self.arm, q, qd, &self.pressures, f_ext, &mut self.ws, dqd);
        self.ws.external = external;
    }

    fn next_break(&mut self, t: f64) -> f64 {
        self.input.next_jump(t, &mut self.jump_cursor)
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
