//! What pressure changes of the stiffness of springs and of bending: forces, and the volumes that belong to them.
//!
//! Form: G = -sum_j p_j (a U_spr,j(q_j) + b U_bend(u, v) / m), m the number of the section's bellows; forces are dG/dq, volumes
//! dG/dp_j, so that dF/dp = dV/dq and air that is shut in does no work around a closed path.

use super::{bellows, bending, spring};
use crate::body::{Bellows, Section, Stiffening};
use crate::real::Real;
use crate::real::linear::Vec3;

/// Force of a bellows for a relative change of its spring force; positive pushes its ends apart.
#[inline(always)]
pub(crate) fn force<T: Real>(change: T, b: &Bellows<T>, length: T) -> T {
    -(change * spring::force(&b.stiffness[..b.stiffness_terms], length - b.rest_length))
}

/// Generalized force on (u, v, l) for a relative change of the bending moment.
#[inline(always)]
pub(crate) fn on_arc<T: Real>(change: T, section: &Section<T>, arc: Vec3<T>) -> Vec3<T> {
    bending::on_arc(section, arc) * change
}

/// What the chamber of a bellows gains in volume at (u, v, l), m^3.
pub(crate) fn volume<T: Real>(change: &Stiffening<T>, section: &Section<T>, b: &Bellows<T>, arc: Vec3<T>) -> T {
    let share = 1.0 / section.bellows.len() as f64;
    -(change.axial * bellows::spring_energy(b, bellows::length(b, arc))
        + change.bending * bending::energy(section, arc) * share)
}

/// Its rate at the rates of (u, v, l), m^3/s.
pub(crate) fn volume_rate<T: Real>(
    change: &Stiffening<T>,
    section: &Section<T>,
    b: &Bellows<T>,
    (arc, rate): (Vec3<T>, Vec3<T>),
) -> T {
    let share = 1.0 / section.bellows.len() as f64;
    force(change.axial, b, bellows::length(b, arc)) * bellows::length(b, rate)
        + on_arc(change.bending, section, arc).dot(rate) * share
}
