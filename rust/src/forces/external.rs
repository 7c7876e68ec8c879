//! Forces and moments that act on the arm from outside.
//!
//! Source: paper (17) and (28): Q = F . dr/dq at each section's centre of mass. Here also at any point of the arm, and
//! moments, whose Q is M . w with w the rotation rate for a unit rate of the coordinate (24).
//! Frame: that of the chain, in which forces and moments are given; places in the frame of the arm there. A point moves
//! with the arm, the direction of a force does not turn with it.
//! A wrench at a fraction of a section moves its own section by part of its arc and all below it whole.

use super::{Load, Wrench, act_along};
use crate::body::Body;
use crate::kinematics::link::Link;
use crate::kinematics::point::{Point, motion};
use crate::real::linear::Vec3;
use crate::real::{Real, kernel};

/// A force and a moment at a point of the arm.
#[derive(Clone, Copy, Debug)]
pub struct PointWrench<T> {
    /// Where it acts.
    pub point: Point<T>,
    /// Force, N.
    pub force: Vec3<T>,
    /// Moment, N m.
    pub moment: Vec3<T>,
}

impl<T: Real> PointWrench<T> {
    /// The same over another scalar.
    pub fn lifted(x: &PointWrench<f64>) -> Self {
        let Point { section, fraction, offset } = x.point;
        let point = Point { section, fraction, offset: Vec3::from_f64(offset.0) };
        Self { point, force: Vec3::from_f64(x.force.0), moment: Vec3::from_f64(x.moment.0) }
    }
}

/// All that acts from outside.
#[derive(Clone, Copy, Debug)]
pub struct External<'a, T> {
    /// Force at each section's force point (by default its centre of mass), N; none: empty.
    pub forces: &'a [Vec3<T>],
    /// Wrenches anywhere.
    pub wrenches: &'a [PointWrench<T>],
}

impl<'a, T> External<'a, T> {
    /// Forces at the sections' force points alone.
    pub fn of_forces(forces: &'a [Vec3<T>]) -> Self {
        Self { forces, wrenches: &[] }
    }
}

kernel! {
    /// Adds wrenches to the loads of their sections and of those below. Out of line, where arms without them do not go.
    pub(crate) fn add<'a, T>(
        body: &'a Body<T>,
        links: &'a [Link<T>],
        wrenches: &'a [PointWrench<T>],
        loads: &'a mut [Load<T>],
    ) {
        for w in wrenches {
            let i = w.point.section;
            let (position, own) = motion(body, links, &w.point);
            let mut wrench = Wrench::at(position, w.force);
            wrench.torque += w.moment;
            match own {
                None => loads[i].on_head.add(wrench),
                Some(own) => act_along(i, &own, wrench, loads),
            }
        }
    }
}
