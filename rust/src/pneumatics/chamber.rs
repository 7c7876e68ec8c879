//! The air in a chamber: the bellows that one pressure input feeds, and what lies between them and the valve.
//!
//! Law: p (V / m)^n = constant, through ambient pressure at the density of ambient air: n = 1 is isothermal, n = 1.4
//! adiabatic (isentropic) air. State is the mass, so that a closed valve keeps p V^n to the last digit and what leaves one
//! place arrives at another; its time derivative is the usual p' = (n / V) (R T m' - p V') with T = p V / (m R).
//! Volume: dead volume plus terminal area times length, summed over the bellows of the input.
//! Limits: one temperature path for filling and emptying (no heat exchange of its own); ideal gas.

use super::Pneumatics;
use crate::arm::Arm;
use crate::forces::length;
use crate::kinematics::coordinates::arc_from_lengths;
use crate::linear::Vec3;
use crate::real::Real;

/// Specific gas constant of air, J/(kg K).
pub const GAS_CONSTANT: f64 = 287.05;

/// Volumes of all chambers at lengths `q` into `out`; with `rates` true, their rates from the lengths' rates `q`.
#[inline(always)]
pub fn volumes<T: Real>(arm: &Arm<T>, dead_volume: T, q: &[T], rates: bool, out: &mut [T]) {
    for volume in out.iter_mut() {
        *volume = if rates { T::zero() } else { dead_volume };
    }
    for (i, section) in arm.sections.iter().enumerate() {
        let arc = arc_from_lengths(Vec3([q[3 * i], q[3 * i + 1], q[3 * i + 2]]), section.inverse_radius);
        for b in &section.bellows {
            out[b.input] += b.terminal_area * length(b, arc);
        }
    }
}

/// Absolute pressure of mass `m` in volume `v`, Pa.
#[inline(always)]
pub fn pressure<T: Real>(pneumatics: &Pneumatics<T>, m: T, v: T) -> T {
    let compression = m / (v * pneumatics.ambient_density);
    pneumatics.ambient_pressure * compression.powf(pneumatics.exponent)
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
        // Ambient air is ideal gas: p V = m R T.
        let m = mass(&air, air.ambient_pressure, 1e-3);
        assert!((m * GAS_CONSTANT * temperature - air.ambient_pressure * 1e-3).abs() < 1e-9);
    }
}
