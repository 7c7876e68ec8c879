//! Bellows lengths and arc coordinates of one section.
//!
//! Source: paper (3), (7); ours: (u, v, l) with u = psi cos(phi), v = psi sin(phi), which is linear in the lengths.
//! Frame: section base, z along the straight section, bellows k at angle 120 (k - 1) degrees from x.
//! Limits: none; the straight section is an ordinary point.

use crate::real::Real;
use crate::real::linear::Vec3;

/// sqrt(3) / 2.
const H: f64 = 0.866_025_403_784_438_6;
const INVERSE_SQRT3: f64 = 0.577_350_269_189_625_8;
const THIRD: f64 = 1.0 / 3.0;

/// (u, v, l) from the three lengths on the radius whose inverse is given.
#[inline(always)]
pub fn arc_from_lengths<T: Real>(q: Vec3<T>, inverse_radius: T) -> Vec3<T> {
    let [q1, q2, q3] = q.0;
    Vec3([
        (q2 + q3 - q1 * 2.0) * inverse_radius * THIRD,
        (q3 - q2) * inverse_radius * INVERSE_SQRT3,
        (q1 + q2 + q3) * THIRD,
    ])
}

/// The three lengths from (u, v, l).
#[inline(always)]
pub fn lengths_from_arc<T: Real>(arc: Vec3<T>, radius: T) -> Vec3<T> {
    let [u, v, l] = arc.0;
    let (ru, rv) = (u * radius, v * radius);
    let (half, side) = (ru * 0.5, rv * H);
    Vec3([l - ru, l + half - side, l + half + side])
}

/// Generalized forces on the lengths from those on (u, v, l).
#[inline(always)]
pub fn force_on_lengths<T: Real>(force: Vec3<T>, inverse_radius: T) -> Vec3<T> {
    let [fu, fv, fl] = force.0;
    let (u, v, l) = (fu * inverse_radius * THIRD, fv * inverse_radius * INVERSE_SQRT3, fl * THIRD);
    Vec3([l - u * 2.0, l + u - v, l + u + v])
}

/// Generalized forces on (u, v, l) from those on the lengths.
#[inline(always)]
pub fn force_on_arc<T: Real>(force: Vec3<T>, radius: T) -> Vec3<T> {
    let [f1, f2, f3] = force.0;
    Vec3([((f2 + f3) * 0.5 - f1) * radius, (f3 - f2) * radius * H, f1 + f2 + f3])
}

/// The paper's configuration (phi, kappa, l) of (7); phi = 0 for the straight section.
pub fn configuration(q: [f64; 3], bellows_radius: f64) -> [f64; 3] {
    let [u, v, l] = arc_from_lengths(Vec3(q), 1.0 / bellows_radius).0;
    [v.atan2(u), u.hypot(v) / l, l]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn maps_are_inverse_and_adjoint(q in prop::array::uniform3(0.05..0.4_f64), f in prop::array::uniform3(-9.0..9.0_f64), r in 0.02..0.2_f64) {
            let (q, f) = (Vec3(q), Vec3(f));
            let arc = arc_from_lengths(q, 1.0 / r);
            let back = lengths_from_arc(arc, r);
            let on_lengths = force_on_lengths(f, 1.0 / r);
            let again = force_on_arc(on_lengths, r);
            for k in 0..3 {
                prop_assert!((back.0[k] - q.0[k]).abs() < 1e-15);
                prop_assert!((again.0[k] - f.0[k]).abs() < 1e-13);
            }
            // Power does not depend on the coordinates: both maps are linear, so q stands in for its rate.
            prop_assert!((on_lengths.dot(q) - f.dot(arc)).abs() < 1e-12);
        }

        #[test]
        fn configuration_is_the_papers(q in prop::array::uniform3(0.05..0.4_f64), r in 0.02..0.2_f64) {
            let [phi, kappa, l] = configuration(q, r);
            let [q1, q2, q3] = q;
            prop_assert!((phi - (3.0_f64.sqrt() * (q3 - q2)).atan2(q2 + q3 - 2.0 * q1)).abs() < 1e-12);
            let root = (q1*q1 + q2*q2 + q3*q3 - q1*q2 - q2*q3 - q1*q3).sqrt();
            prop_assert!((kappa - 2.0 * root / ((q1 + q2 + q3) * r)).abs() < 1e-7);
            prop_assert!((l - (q1 + q2 + q3) / 3.0).abs() < 1e-15);
        }
    }
}
