//! Bending stiffness of a section.
//!
//! Source: paper (33)-(35) and Fig. 7. The paper writes the moment M_bend(psi, phi) into the potential, which does not fit
//! in units; here U_bend is its integral, M_bend = k1 psi + k3 psi^3 + k5 psi^5, so dU/du = (k1 + k3 psi^2 + k5 psi^4) u:
//! no singularity at 0. Where planes differ, each k(phi) goes as k cos^2 + k' sin^2 from one principal plane to the other,
//! so that with the symmetric tensors K1, K3, K5 of these and x = (u, v):
//! U = x.K1 x / 2 + (x.K3 x) (x.x) / 4 + (x.K5 x) (x.x)^2 / 6, a polynomial in (u, v) too.
//! Besides the moment along the bend there is then dU/dphi, which turns the bend towards the plane of less stiffness.

use crate::body::{BendingPlanes, Section};
use crate::real::linear::Vec3;
use crate::real::{Real, kernel};

/// Generalized force -dU_bend/d(u, v, l).
#[inline(always)]
pub(crate) fn on_arc<T: Real>(section: &Section<T>, arc: Vec3<T>) -> Vec3<T> {
    let [u, v, _] = arc.0;
    let [k1, k3, k5] = section.bending_stiffness;
    let s = u * u + v * v;
    let k = -(k1 + (k3 + k5 * s) * s);
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
        let s = u * u + v * v;
        let [linear, cubic, quintic] = [planes.linear, planes.cubic, planes.quintic].map(|k| times(k, u, v));
        let [cubed, fifth] = [cubic, quintic].map(|k| u * k[0] + v * k[1]);
        // Of (x.K x) s^n / (2 n + 2) the slope is (K x s^n + n x (x.K x) s^(n - 1)) / (n + 1).
        let slope = |k: usize, x: T| {
            linear[k] + (cubic[k] * s + cubed * x) * 0.5 + (quintic[k] * s + fifth * x * 2.0) * s * (1.0 / 3.0)
        };
        *force -= Vec3([slope(0, u), slope(1, v), T::zero()]);
    }
}

/// U_bend, J.
pub fn energy<T: Real>(section: &Section<T>, arc: Vec3<T>) -> T {
    let [u, v, _] = arc.0;
    let [k1, k3, k5] = section.bending_stiffness;
    let s = u * u + v * v;
    let mean = (k1 * 0.5 + (k3 * 0.25 + k5 * s * (1.0 / 6.0)) * s) * s;
    let Some(planes) = &section.bending_planes else { return mean };
    let [linear, cubic, quintic] = [planes.linear, planes.cubic, planes.quintic].map(|k| times(k, u, v));
    let [linear, cubic, quintic] = [linear, cubic, quintic].map(|k| u * k[0] + v * k[1]);
    mean + linear * 0.5 + (cubic * 0.25 + quintic * s * (1.0 / 6.0)) * s
}
