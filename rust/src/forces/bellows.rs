//! Bellows forces: pressure, spring and damping, and how they act on the arm.
//!
//! Source: paper (25)-(27), (29)-(32); `work_conjugate` is ours (`docs/explanation/model.md`).
//! Sign: a positive force pushes the two ends of the bellows apart. F = A_P (p - p_amb) - F_spr(b) - d b', with b the
//! length of this bellows, b = l - x u - y v for a bellows at (x, y) of the section.
//!
//! `end_force` (the paper's): F acts in head i's z direction at (x, y) of head i, and -F in the same direction's place on
//! the head below, at that head's own radius: (27) takes the reaction of section i + 1 at r_B,ik of head i. For bellows
//! that are not three equal ones this means (x, y) scaled by the ratio of the sections' radii.
//! `work_conjugate`: Q = F db/d(u, v, l), the virtual work of F on its own change of length.
//!
//! Along a section of tapered bellows the length b has the mean radius, weighted by bending, that (x, y) are at. The head's
//! own radius is that of the last arc (`end_force`). A pressure works on the volume, V = sum_j A_j (l_j - x_j u_j - y_j v_j),
//! whose lever is that of b times the mean of A_j r_j (`work_conjugate`); two areas have no place in (27).
//!
//! Limits: massless bellows whose force is along z at both ends; torsion of the section is not modelled.

use super::{ForceSet, Load, Wrench, spring};
use crate::body::parameters::ForceModel;
use crate::body::{Bellows, Body, Section};
use crate::kinematics::link::Link;
use crate::real::Real;
use crate::real::linear::Vec3;
use std::slice::Iter;

/// Length of a bellows at (u, v, l), or its rate at (u', v', l').
#[inline(always)]
pub fn length<T: Real>(b: &Bellows<T>, arc: Vec3<T>) -> T {
    b.y.neg_mul_add(arc.y(), b.x.neg_mul_add(arc.x(), arc.z()))
}

/// Volume of a bellows of `section` at (u, v, l), or its rate at (u', v', l'), m^3; the work of a pressure is (p - p_amb) dV.
#[inline(always)]
pub fn volume<T: Real>(section: &Section<T>, b: &Bellows<T>, arc: Vec3<T>) -> T {
    let mut long = length(b, arc);
    if let Some(taper) = &section.taper {
        long -= (b.x * arc.x() + b.y * arc.y()) * (taper.pressure_lever - T::one());
    }
    b.terminal_area * long
}

/// Spring force F_spr.
#[inline(always)]
fn spring_force<T: Real>(b: &Bellows<T>, length: T) -> T {
    spring::force(&b.stiffness[..b.stiffness_terms], length - b.rest_length)
}

/// Energy in the spring, J.
pub fn spring_energy<T: Real>(b: &Bellows<T>, length: T) -> T {
    spring::energy(&b.stiffness[..b.stiffness_terms], length - b.rest_length)
}

/// Adds the forces of section `i`'s bellows, beginning with the `extra` one of each, to its own load and the one below.
#[allow(clippy::too_many_arguments)] // one call
#[inline(always)]
pub(crate) fn add<T: Real>(
    body: &Body<T>,
    i: usize,
    section: &Section<T>,
    set: ForceSet,
    p: &[T],
    links: &[Link<T>],
    extra: &mut Iter<'_, T>,
    loads: &mut [Load<T>],
) {
    let link = &links[i];
    let (mut along, mut moment_x, mut moment_y) = (T::zero(), T::zero(), T::zero());
    for (b, extra) in section.bellows.iter().zip(extra) {
        let mut force = *extra;
        if set.actuation {
            force = b.terminal_area.mul_add(p[b.input] - body.ambient_pressure, force);
        }
        if set.spring {
            force -= spring_force(b, length(b, link.arc));
        }
        if set.damping {
            force = b.damping.neg_mul_add(length(b, link.rate), force);
        }
        along += force;
        moment_x = b.x.mul_add(force, moment_x);
        moment_y = b.y.mul_add(force, moment_y);
    }
    match body.force_model {
        ForceModel::WorkConjugate => {
            let mut force = Vec3([-moment_x, -moment_y, along]);
            if let (Some(taper), true) = (&section.taper, set.actuation) {
                force -= moment_beyond(section, body.ambient_pressure, p) * (taper.pressure_lever - T::one());
            }
            loads[i].on_arc += force;
        }
        ForceModel::EndForce => {
            let torque = Vec3([moment_y, -moment_x, T::zero()]);
            loads[i].on_head.add(end_wrench(link, torque, along));
            if let Some(taper) = &section.taper {
                let beyond = torque * (taper.head_radius - T::one());
                loads[i].on_head.add(end_wrench(link, beyond, T::zero()));
            }
            if i > 0 {
                let below = &links[i - 1];
                loads[i - 1].on_head.add(end_wrench(below, torque * -section.reaction_scale, -along));
            }
        }
    }
}

/// Moments (x, y) of the pressures about the centre line at the bellows' radius, which tapered bellows have a part more of.
#[inline(always)]
fn moment_beyond<T: Real>(section: &Section<T>, ambient_pressure: T, p: &[T]) -> Vec3<T> {
    let (mut x, mut y) = (T::zero(), T::zero());
    for b in &section.bellows {
        let force = b.terminal_area * (p[b.input] - ambient_pressure);
        x = b.x.mul_add(force, x);
        y = b.y.mul_add(force, y);
    }
    Vec3([x, y, T::zero()])
}

/// A torque (head frame, about the head's origin) and a force along the head's z, as a wrench about O.
#[inline(always)]
fn end_wrench<T: Real>(link: &Link<T>, torque: Vec3<T>, along: T) -> Wrench<T> {
    let force = link.rotation.column(2) * along;
    let turned = link.rotation.column(0) * torque.x() + link.rotation.column(1) * torque.y();
    Wrench { torque: turned + link.position.cross(force), force }
}
