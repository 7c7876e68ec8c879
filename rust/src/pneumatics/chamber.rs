//! The air in a chamber: the bellows that one pressure input feeds, and what lies between them and the valve.
//!
//! Law: p (V / m)^n = constant, through ambient pressure at the density of ambient air: n = 1 is isothermal, n = 1.4
//! adiabatic (isentropic) air. State is the mass, so that a closed valve keeps p V^n to the last digit and what leaves one
//! place arrives at another; its time derivative is the usual p' = (n / V) (R T m' - p V') with T = p V / (m R).
//! Volume: dead volume plus terminal area times length, in tapered bellows arc by arc, summed over the bellows of the input.
//! Limits: one temperature path for filling and emptying (no heat exchange of its own); ideal gas.

use super::Pneumatics;
use crate::body::Body;
use crate::forces::volume;
use crate::kinematics::coordinates::arc_from_lengths;
use crate::real::Real;
use crate::real::linear::Vec3;

/// Specific gas constant of air, J/(kg K).
pub const GAS_CONSTANT: f64 = 287.05;

/// Volumes of all chambers at lengths `q` into `out`; with `rates` true, their rates from the lengths' rates `q`.
#[inline(always)]
pub fn volumes<T: Real>(body: &Body<T>, dead_volume: T, q: &[T], rates: bool, out: &mut [T]) {
    for volume in out.iter_mut() {
        *volume = if rates { T::zero() } else { dead_volume };
    }
    for (i, section) in body.sections.iter().enumerate() {
        let arc = arc_from_lengths(Vec3([q[3 * i], q[3 * i + 1], q[3 * i + 2]]), section.inverse_radius);
        for b in &section.bellows {
            out[b.input] += volume(section, b, arc);
        }
    }
}

/// Absolute pressure of mass `m` in volume `v`, Pa.
#[inline(always)]
pub fn pressure<T: Real>(pneumatics: &Pneumatics<T>, m: T, v: T) -> T {
    let compression = m / (v * pneumatics.ambient_density);
    pneumatics.ambient_pressure * compression.powf(pneumatics.exponent)
}

/// Pressure of a mass in a volume, `now`, from the pressure, mass and volume of the same input a moment before: p (m V_0 /
/// (m_0 V))^n. By series where the ratio is near 1, as it is from sub-step to sub-step, to the last digits and at a
/// fifth of a power's cost.
#[inline(always)]
pub fn pressure_from<T: Real>(exponent: T, before: (T, T, T), now: (T, T)) -> T {
    /// Largest distance of the ratio from 1, times the exponent where that is above 1, that the series are cut for.
    const NEAR: f64 = 0.1;
    let ((p, m_0, v_0), (m, v)) = (before, now);
    let ratio = m * v_0 / (m_0 * v);
    let off = ratio - 1.0;
    if (off.abs() * exponent.max(T::one()) - NEAR).largest() < 0.0 {
        // ln r = 2 artanh((r - 1) / (r + 1)); the rest of the series is below 1e-16.
        let t = off / (ratio + 1.0);
        let tt = t * t;
        let mut logarithm = T::from_f64(1.0 / 11.0);
        for k in [9.0, 7.0, 5.0, 3.0, 1.0] {
            logarithm = logarithm.mul_add(tt, T::from_f64(1.0 / k));
        }
        let x = logarithm * t * 2.0 * exponent;
        // e^x = 1 + x growth.
        let mut growth = T::from_f64(1.0 / 3_628_800.0);
        for factorial in [362_880.0, 40_320.0, 5040.0, 720.0, 120.0, 24.0, 6.0, 2.0, 1.0] {
            growth = growth.mul_add(x, T::from_f64(1.0 / factorial));
        }
        (p * x).mul_add(growth, p)
    } else {
        p * ratio.powf(exponent)
    }
}

/// Mass in volume `v` at absolute pressure `p`, kg.
#[inline(always)]
pub fn mass<T: Real>(pneumatics: &Pneumatics<T>, p: T, v: T) -> T {
    v * pneumatics.ambient_density * (p / pneumatics.ambient_pressure).powf(pneumatics.exponent.recip())
}

#[cfg(test)]
mod tests {
    use super::super::testing::nominal;
    use super::*;

    #[test]
    fn mass_and_pressure_are_inverse_and_adiabatic() {
        let (mut air, temperature) = (nominal(), 293.15);
        air.exponent = 1.4;
        for p in [0.6e5, 1.0e5, 2.5e5] {
            let m = mass(&air, p, 4e-4);
            assert!((pressure(&air, m, 4e-4) - p).abs() < 1e-9 * p);
            // p V^1.4 of the closed chamber, by its closed form.
            let expected = p * (4e-4_f64 / 7e-4).powf(1.4);
            assert!((pressure(&air, m, 7e-4) - expected).abs() < 1e-12 * expected);
        }
        // Step by step, near and far.
        let (m, v) = (mass(&air, 1.5e5, 4e-4), 4e-4);
        for n in [1.0, 1.2, 1.4, 3.0] {
            air.exponent = n;
            let before = (pressure(&air, m, v), m, v);
            for part in [0.5, 0.9, 0.91, 0.97, 0.9999, 1.0, 1.0001, 1.05, 1.099, 1.2, 3.0] {
                for now in [(part * m, v), (m, v / part), (1.01 * m, v / part)] {
                    let (found, expected) = (pressure_from(n, before, now), pressure(&air, now.0, now.1));
                    assert!((found - expected).abs() < 2e-15 * expected, "{n} {part}: {found} {expected}");
                }
            }
        }
        air.exponent = 1.4;
        // Ambient air is ideal gas: p V = m R T.
        let m = mass(&air, air.ambient_pressure, 1e-3);
        assert!((m * GAS_CONSTANT * temperature - air.ambient_pressure * 1e-3).abs() < 1e-9);
    }
}
