//! Bending stiffness of a section.
//!
//! Source: paper (33)-(35) and Fig. 7. The paper writes the moment M_bend(psi) into the potential, which does not fit in
//! units; here U_bend is its integral, M_bend = k1 psi + k3 psi^3, so dU/du = (k1 + k3 psi^2) u: no singularity at 0.

use crate::body::Section;
use crate::real::Real;
use crate::real::linear::Vec3;

/// Generalized force -dU_bend/d(u, v, l).
#[inline(always)]
pub(crate) fn on_arc<T: Real>(section: &Section<T>, arc: Vec3<T>) -> Vec3<T> {
    let [u, v, _] = arc.0;
    let [k1, k3] = section.bending_stiffness;
    let k = -(k1 + k3 * (u * u + v * v));
    Vec3([k * u, k * v, T::zero()])
}

/// U_bend, J.
pub fn energy<T: Real>(section: &Section<T>, arc: Vec3<T>) -> T {
    let [u, v, _] = arc.0;
    let [k1, k3] = section.bending_stiffness;
    let s = u * u + v * v;
    (k1 + k3 * s * 0.5) * s * 0.5
}
