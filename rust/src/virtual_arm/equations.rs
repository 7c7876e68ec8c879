//! The equations of motion, M x'' = f, summed body by body, and the energy.
//!
//! Source: see the module. Bellows forces: paper (25)-(32), here by the velocity of their points of attack, and the
//! virtual work of `docs/explanation/model.md`; a positive force lengthens.

use super::arc::ArcPoint;
use super::frame::{Frame, product, times};
use super::{Bellows, Section, VirtualArm};
use crate::body::parameters::ForceModel;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// Inertia matrix and generalized force (everything but M x'') on (u, v, l) of all sections.
pub struct Equations {
    pub inertia: DMatrix<f64>,
    pub force: DVector<f64>,
}

/// What acts on the arm from outside.
#[derive(Clone, Copy)]
pub struct Actions<'a> {
    /// Pressures, Pa absolute.
    pub pressures: &'a [f64],
    /// Forces at the sections' force points in the base frame, N; none: no forces.
    pub external: &'a [Vector3<f64>],
}

impl Bellows {
    pub fn length(&self, arc: &[f64]) -> f64 {
        arc[2] - self.x * arc[0] - self.y * arc[1]
    }

    /// Spring force, a polynomial in the elongation from its first power on.
    fn spring(&self, length: f64) -> f64 {
        let e = length - self.rest_length;
        self.stiffness.iter().zip(1..).map(|(k, power)| k * e.powi(power)).sum()
    }

    fn spring_energy(&self, length: f64) -> f64 {
        let e = length - self.rest_length;
        self.stiffness.iter().zip(2..).map(|(k, power)| k * e.powi(power) / f64::from(power)).sum()
    }
}

impl Equations {
    /// Adds a rigid body in `frame`, with principal moments of inertia along its axes.
    fn add_body(&mut self, frame: &Frame, mass: f64, inertia: &Vector3<f64>, gravity: &Vector3<f64>) {
        let r = &frame.rotation;
        let scaled = Matrix3::from_columns(&[0, 1, 2].map(|k| r.column(k) * inertia[k]));
        let tensor = product(&scaled, &r.transpose());
        let w = &frame.angular_velocity;
        let force = mass * (gravity - frame.bias);
        let torque = -(times(&tensor, &frame.angular_bias) + w.cross(&times(&tensor, w)));
        let columns = frame.linear.iter().zip(&frame.angular);
        for (c, (linear, angular)) in columns.clone().enumerate() {
            self.force[c] += linear.dot(&force) + angular.dot(&torque);
            let (momentum, spin) = (mass * linear, times(&tensor, angular));
            // The upper triangle; the rest follows at the end.
            let mut column = self.inertia.column_mut(c);
            for (entry, (linear, angular)) in column.iter_mut().zip(columns.clone().take(c + 1)) {
                *entry += linear.dot(&momentum) + angular.dot(&spin);
            }
        }
    }

    /// Adds a force at a point of `frame` (both in the base frame; `lever` from the frame's origin).
    fn add_force(&mut self, frame: &Frame, lever: &Vector3<f64>, force: &Vector3<f64>) {
        let torque = lever.cross(force);
        for (c, (linear, angular)) in frame.linear.iter().zip(&frame.angular).enumerate() {
            self.force[c] += linear.dot(force) + angular.dot(&torque);
        }
    }
}

impl VirtualArm {
    /// Every bellows with its section and its first creep state.
    pub(super) fn each_bellows(&self) -> impl Iterator<Item = (usize, &Bellows, usize)> {
        let all = self.sections.iter().enumerate().flat_map(|(i, s)| s.bellows.iter().map(move |b| (i, b)));
        all.enumerate().map(|(k, (i, b))| (i, b, k * self.creep.len()))
    }

    /// Force of one bellows: pressure, spring, damping and creep.
    fn bellows_force(&self, b: &Bellows, arc: &[f64], rate: &[f64], creep: &[f64], pressures: &[f64]) -> f64 {
        let stiffness = b.stiffness[0];
        let branches: f64 = self.creep.iter().zip(creep).map(|(c, z)| c.share * stiffness * z).sum();
        b.terminal_area * (pressures[b.input] - self.ambient_pressure)
            - b.spring(b.length(arc))
            - b.damping * b.length(rate)
            - branches
    }

    /// The equations at arcs `x`, rates `xd` and creep states `z`.
    pub(super) fn equations(&self, x: &[f64], xd: &[f64], z: &[f64], actions: Actions<'_>) -> Equations {
        let n = self.coordinates();
        let mut out = Equations { inertia: DMatrix::zeros(n, n), force: DVector::zeros(n) };
        let mut below = Frame::base();
        let mut radius_below = self.sections[0].radius;
        let mut states = z.chunks(self.creep.len().max(1));
        for (i, section) in self.sections.iter().enumerate() {
            let (arc, rate) = (three(x, i), three(xd, i));
            let start = below.shifted(&(Vector3::z() * section.base_offset));
            self.add_slices(&mut out, section, &start, (arc, rate));
            let head = start.along(&ArcPoint::new(arc, rate, 1.0)).shifted(&(Vector3::z() * section.head_offset));
            let plate = head.shifted(&section.plate_center);
            out.add_body(&plate, section.plate_mass, &section.plate_inertia, &self.gravity);
            if let Some(f) = actions.external.get(i) {
                out.add_force(&head, &times(&head.rotation, &section.force_point), f);
            }
            let [k1, k3, k5] = section.bending_stiffness;
            let s = arc[0] * arc[0] + arc[1] * arc[1];
            let bending = k1 + k3 * s + k5 * s * s;
            out.force[3 * i] -= bending * arc[0];
            out.force[3 * i + 1] -= bending * arc[1];
            for b in &section.bellows {
                let force = self.bellows_force(b, &arc, &rate, states.next().unwrap_or(&[]), actions.pressures);
                match self.force_model {
                    ForceModel::WorkConjugate => {
                        for (k, by_arc) in [-b.x, -b.y, 1.0].into_iter().enumerate() {
                            out.force[3 * i + k] += force * by_arc;
                        }
                    }
                    ForceModel::EndForce => {
                        let place = Vector3::new(b.x, b.y, 0.0);
                        let at_head = times(&head.rotation, &place);
                        out.add_force(&head, &at_head, &(head.rotation.column(2) * force));
                        // (27) takes the reaction at the contact point of the head below, on that head's own radius.
                        let at_below = times(&below.rotation, &place) * (radius_below / section.radius);
                        out.add_force(&below, &at_below, &(below.rotation.column(2) * -force));
                    }
                }
            }
            (below, radius_below) = (head, section.radius);
        }
        for row in 0..n {
            for column in 0..row {
                out.inertia[(row, column)] = out.inertia[(column, row)];
            }
        }
        out
    }

    fn add_slices(&self, out: &mut Equations, section: &Section, start: &Frame, (arc, rate): ([f64; 3], [f64; 3])) {
        let d = &section.distributed;
        let share = 1.0 / d.slices.max(1) as f64;
        for j in 0..d.slices {
            let point = ArcPoint::new(arc, rate, (j as f64 + 0.5) * share);
            let frame = start.along(&point);
            out.add_body(&frame, d.mass * share, &(Vector3::from(d.inertia) * share), &self.gravity);
        }
    }

    /// Kinetic and potential energy (gravity, bending, springs, creep branches), J.
    pub fn energy(&self, lengths: &[f64], velocities: &[f64], creep: &[f64]) -> [f64; 2] {
        let (x, xd) = (self.arcs(lengths), self.arcs(velocities));
        let still = vec![self.ambient_pressure; self.inputs];
        let inertia = self.equations(&x, &xd, creep, Actions { pressures: &still, external: &[] }).inertia;
        let rates = DVector::from_vec(xd);
        let kinetic = 0.5 * rates.dot(&(inertia * &rates));
        let mut potential = 0.0;
        let mut below = Frame::base();
        for (i, section) in self.sections.iter().enumerate() {
            let arc = three(&x, i);
            let start = below.shifted(&(Vector3::z() * section.base_offset));
            let share = 1.0 / section.distributed.slices.max(1) as f64;
            for j in 0..section.distributed.slices {
                let frame = start.along(&ArcPoint::new(arc, [0.0; 3], (j as f64 + 0.5) * share));
                potential -= section.distributed.mass * share * self.gravity.dot(&frame.position);
            }
            let end = start.along(&ArcPoint::new(arc, [0.0; 3], 1.0));
            below = end.shifted(&(Vector3::z() * section.head_offset));
            potential -= section.plate_mass * self.gravity.dot(&below.shifted(&section.plate_center).position);
            let s = arc[0] * arc[0] + arc[1] * arc[1];
            let [k1, k3, k5] = section.bending_stiffness;
            potential += k1 * s / 2.0 + k3 * s.powi(2) / 4.0 + k5 * s.powi(3) / 6.0;
        }
        for (i, b, first) in self.each_bellows() {
            potential += b.spring_energy(b.length(&x[3 * i..3 * i + 3]));
            for (k, c) in self.creep.iter().enumerate() {
                potential += 0.5 * c.share * b.stiffness[0] * creep[first + k].powi(2);
            }
        }
        [kinetic, potential]
    }
}

/// The three values of section `i`.
pub(super) fn three(x: &[f64], i: usize) -> [f64; 3] {
    [x[3 * i], x[3 * i + 1], x[3 * i + 2]]
}
