//! One link of the chain: a section and its head body in the world, and the step from the body below to it.
//!
//! Source: paper (13), (14), (19)-(24), (66)-(73); written as a recursion over the sections.
//! Frame: the world's (the base's where an arm has no base pose), spatial quantities about its origin O: the linear part
//! of a motion subspace is the velocity of the body-fixed point that is at O just now. Inertias and wrenches about one
//! common point add without transformation (Featherstone, *Rigid Body Dynamics Algorithms*, sec. 2.10, 7.3), which is
//! what makes the articulated-body recursion cheap here.
//! Limits: those of `section`.

use super::coordinates::arc_from_lengths;
use super::section::{Bent, Bias, Pose, Subspace};
use crate::body::{Base, Section};
use crate::real::Real;
use crate::real::linear::{Mat3, Vec3};

/// What is known of one section and its head body, or of a mass along a section, in the world.
#[derive(Clone, Copy, Debug)]
pub struct Link<T> {
    /// (u, v, l).
    pub arc: Vec3<T>,
    /// (u', v', l').
    pub rate: Vec3<T>,
    /// Orientation of the head.
    pub rotation: Mat3<T>,
    /// Origin of the head, m.
    pub position: Vec3<T>,
    /// Centre of mass, m.
    pub center: Vec3<T>,
    /// Motion subspace about O.
    pub subspace: Subspace<T>,
    /// Angular velocity, rad/s.
    pub angular_velocity: Vec3<T>,
    /// Velocity of the head's origin, m/s.
    pub velocity: Vec3<T>,
    /// Angular acceleration, rad/s^2: from velocity products alone unless accelerations were asked for.
    pub angular_acceleration: Vec3<T>,
    /// Acceleration of the head's origin, m/s^2, likewise.
    pub acceleration: Vec3<T>,
}

impl<T: Real> Link<T> {
    /// A body at rest at the base, from which the chain begins.
    #[inline(always)]
    pub fn of_base(base: &Base<T>) -> Self {
        Self { rotation: base.rotation, position: base.position, center: base.position, ..Self::base() }
    }

    /// A body at rest at the origin.
    #[inline(always)]
    pub fn base() -> Self {
        let o = Vec3::zero();
        Self {
            arc: o,
            rate: o,
            rotation: Mat3::identity(),
            position: o,
            center: o,
            subspace: Subspace { angular: [o; 2], linear: [o; 3] },
            angular_velocity: o,
            velocity: o,
            angular_acceleration: o,
            acceleration: o,
        }
    }

    /// The same over another scalar.
    #[inline(always)]
    pub fn lifted(x: &Link<f64>) -> Self {
        Self {
            arc: Vec3::from_f64(x.arc.0),
            rate: Vec3::from_f64(x.rate.0),
            rotation: Mat3::from_f64(x.rotation.0),
            position: Vec3::from_f64(x.position.0),
            center: Vec3::from_f64(x.center.0),
            subspace: Subspace::lifted(&x.subspace),
            angular_velocity: Vec3::from_f64(x.angular_velocity.0),
            velocity: Vec3::from_f64(x.velocity.0),
            angular_acceleration: Vec3::from_f64(x.angular_acceleration.0),
            acceleration: Vec3::from_f64(x.acceleration.0),
        }
    }

    /// Velocity of the centre of mass, m/s.
    #[inline(always)]
    pub fn center_velocity(&self) -> Vec3<T> {
        self.velocity + self.angular_velocity.cross(self.center - self.position)
    }
}

/// How much of the motion a pass computes.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Motion {
    /// Poses and subspaces.
    Pose,
    /// Velocities too.
    Velocity,
    /// Velocities and velocity-product accelerations.
    Bias,
}

/// A section by itself, in its base frame: all that depends on its own coordinates alone.
#[derive(Clone, Copy, Debug)]
pub struct Local<T> {
    pub(super) arc: Vec3<T>,
    pub(super) rate: Vec3<T>,
    pub(super) pose: Pose<T>,
    pub(super) subspace: Subspace<T>,
    /// Zero unless the motion has it.
    pub(super) bias: Bias<T>,
}

impl<T: Real> Local<T> {
    /// Nothing known yet.
    #[inline(always)]
    pub fn zero() -> Self {
        let o = Vec3::zero();
        let pose = Pose { rotation: Mat3::identity(), position: o };
        Self { arc: o, rate: o, pose, subspace: Subspace::zero(), bias: Bias::zero() }
    }

    /// `section`, which is one arc, at three lengths, with their rates.
    #[inline(always)]
    pub fn new(section: &Section<T>, lengths: Vec3<T>, rates: Vec3<T>, motion: Motion) -> Self {
        let arc = arc_from_lengths(lengths, section.inverse_radius);
        let rate = arc_from_lengths(rates, section.inverse_radius);
        let bent = Bent::new(arc, section.base_offset, section.head_offset);
        let bias = if motion == Motion::Bias { bent.bias(rate) } else { Bias::zero() };
        Self { arc, rate, pose: bent.pose(), subspace: bent.subspace(), bias }
    }

    /// The same over another scalar.
    #[inline(always)]
    pub fn lifted(x: &Local<f64>) -> Self {
        Self {
            arc: Vec3::from_f64(x.arc.0),
            rate: Vec3::from_f64(x.rate.0),
            pose: Pose { rotation: Mat3::from_f64(x.pose.rotation.0), position: Vec3::from_f64(x.pose.position.0) },
            subspace: Subspace::lifted(&x.subspace),
            bias: Bias { angular: Vec3::from_f64(x.bias.angular.0), linear: Vec3::from_f64(x.bias.linear.0) },
        }
    }
}

/// One step up the chain: the body above `below`.
#[inline(always)]
pub fn step<T: Real>(below: &Link<T>, local: &Local<T>, center_of_mass: Vec3<T>, motion: Motion) -> Link<T> {
    let r = &below.rotation;
    let Local { arc, rate, pose, subspace: local, bias } = local;
    let reach = r.mul_vec(pose.position);
    let position = below.position + reach;
    let rotation = r.mul_mat(&pose.rotation);
    let angular = [r.mul_vec(local.angular[0]), r.mul_vec(local.angular[1])];
    let linear = [r.mul_vec(local.linear[0]), r.mul_vec(local.linear[1]), r.mul_vec(local.linear[2])];
    let subspace = Subspace {
        angular,
        linear: [linear[0] + position.cross(angular[0]), linear[1] + position.cross(angular[1]), linear[2]],
    };
    let mut link = Link {
        arc: *arc,
        rate: *rate,
        rotation,
        position,
        center: position + rotation.mul_vec(center_of_mass),
        subspace,
        ..Link::base()
    };
    if motion == Motion::Pose {
        return link;
    }
    let (omega, velocity) = Subspace { angular, linear }.twist(*rate);
    let turn = below.angular_velocity.cross(reach);
    link.angular_velocity = below.angular_velocity + omega;
    link.velocity = below.velocity + turn + velocity;
    if motion == Motion::Bias {
        link.angular_acceleration =
            below.angular_acceleration + r.mul_vec(bias.angular) + below.angular_velocity.cross(omega);
        link.acceleration = below.acceleration
            + below.angular_acceleration.cross(reach)
            + below.angular_velocity.cross(turn + velocity * T::from_f64(2.0))
            + r.mul_vec(bias.linear);
    }
    link
}

/// The time derivative about O of a joint's subspace, from the subspace and its derivative in the frame of the joint's base.
pub(super) fn subspace_rate_about_origin<T: Real>(
    below: &Link<T>,
    link: &Link<T>,
    local: &Subspace<T>,
    rate: &Subspace<T>,
) -> Subspace<T> {
    let (r, omega) = (&below.rotation, below.angular_velocity);
    let turned = |value: Vec3<T>, derivative: Vec3<T>| r.mul_vec(derivative) + omega.cross(r.mul_vec(value));
    let angular = [0, 1].map(|k| turned(local.angular[k], rate.angular[k]));
    let mut linear = [0, 1, 2].map(|k| turned(local.linear[k], rate.linear[k]));
    for k in 0..2 {
        linear[k] += link.velocity.cross(link.subspace.angular[k]) + link.position.cross(angular[k]);
    }
    Subspace { angular, linear }
}
