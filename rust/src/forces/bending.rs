//! Bending stiffness of a section.
//!
//! Source: paper (33)-(35) and Fig. 7. The paper writes the moment M_bend(psi, phi) into the potential, which does not fit
//! in units; here U_bend is its integral, M_bend = k1 psi + k3 psi^3, so dU/du = (k1 + k3 psi^2) u: no singularity at 0.
//! Where planes differ, k1(phi) and k3(phi) go as k cos^2 + k' sin^2 from one principal plane to the other, so that with the
//! symmetric tensors K1, K3 of these and x = (u, v): U = x.K1 x / 2 + (x.K3 x) (x.x) / 4, a polynomial in (u, v) too.
//! Besides the moment along the bend there is then dU/dphi, which turns the bend towards the plane of less stiffness.

use crate::body::{BendingPlanes, Section};
use crate::real::linear::Vec3;
use crate::real::{Real, kernel};

/// Generalized force -dU_bend/d(u, v, l).
#[inline(always)]
pub(crate) fn on_arc<T: Real>(section: &Section<T>, arc: Vec3<T>) -> Vec3<T> {
    let [u, v, _] = arc.0;
    let [k1, k3] = section.bending_stiffness;
    let k = -(k1 + k3 * (u * u + v * v));
    let mut force = Vec3([k * u, k * v, T::zero()]);
    if let Some(planes) = &section.bending_planes {
        beyond_mean(planes, u, v, &mut force);
    }
    force
}

/// (d cos 2 alpha, d sin 2 alpha) as the symmetric matrix without trace that it stands for, times (u, v).
#[inline(always)]
fn times<T: Real>([c, s]: [T; 2], u: T, v: T) -> [T; 2] {
    [c * u + s * v, s * u - c * v]
}

kernel! {
    /// Takes dU/d(u, v, l) of what planes differ by from `force`. Out of line, where arms without planes do not go.
    fn beyond_mean<'a, T>(planes: &'a BendingPlanes<T>, u: T, v: T, force: &'a mut Vec3<T>) {
        let (linear, cubic) = (times(planes.linear, u, v), times(planes.cubic, u, v));
        let (s, form) = (u * u + v * v, u * cubic[0] + v * cubic[1]);
        let slope = [linear[0] + (cubic[0] * s + form * u) * 0.5, linear[1] + (cubic[1] * s + form * v) * 0.5];
        *force -= Vec3([slope[0], slope[1], T::zero()]);
    }
}

/// U_bend, J.
pub fn energy<T: Real>(section: &Section<T>, arc: Vec3<T>) -> T {
    let [u, v, _] = arc.0;
    let [k1, k3] = section.bending_stiffness;
    let s = u * u + v * v;
    let mean = (k1 + k3 * s * 0.5) * s * 0.5;
    let Some(planes) = &section.bending_planes else { return mean };
    let (linear, cubic) = (times(planes.linear, u, v), times(planes.cubic, u, v));
    mean + (u * linear[0] + v * linear[1]) * 0.5 + (u * cubic[0] + v * cubic[1]) * s * 0.25
}
