//! The air in a chamber: the bellows that one pressure input feeds, and what lies between them and the valve.
//!
//! Law: p (V / m)^n = constant, through ambient pressure at the density of ambient air: n = 1 is isothermal, n = 1.4
//! adiabatic (isentropic) air. State is the mass, so that a closed valve keeps p V^n to the last digit and what leaves one
//! place arrives at another; its time derivative is the usual p' = (n / V) (R T m' - p V') with T = p V / (m R).
//! Volume: dead volume plus that of the input's bellows, A_P times length where nothing changes their area,
//! in tapered bellows arc by arc. It belongs to
//! their force: F = dG/dq and V = dG/dp of one function G(q, p), so that dF/dp = dV/dq and air that is shut in does no work
//! around a closed path, also where bellows share it. With [`AreaChange`], F = A_P (1 + a p + b (q - q_0)) p for p above
//! ambient, that is V = A_P (q + b ((q - q_0)^2 - q_0^2) / 2 + 2 a p q): walls that give way by pressure make the volume
//! one of pressure too. Stiffness that changes with pressure has its share of it ([`crate::forces::stiffening`]).
//! Limits: one temperature path for filling and emptying (no heat exchange of its own); ideal gas.

use super::Pneumatics;
#[cfg(doc)]
use crate::body::AreaChange;
use crate::body::Body;
use crate::forces::{length, stiffening, volume};
use crate::kinematics::coordinates::arc_from_lengths;
use crate::real::linear::Vec3;
use crate::real::{Real, kernel};

/// Specific gas constant of air, J/(kg K).
pub const GAS_CONSTANT: f64 = 287.05;

/// The volume of a chamber: at ambient pressure, m^3, and what it gains for each pascal above that. Or its rate.
#[derive(Clone, Copy, Debug)]
pub struct Volume<T> {
    /// At ambient pressure.
    pub at_ambient: T,
    /// For each pascal above; not read where walls do not give way.
    pub by_pressure: T,
}

impl<T: Real> Volume<T> {
    /// One that pressure does not change.
    #[inline(always)]
    pub fn rigid(volume: T) -> Self {
        Self { at_ambient: volume, by_pressure: T::zero() }
    }

    /// At a pressure above ambient.
    #[inline(always)]
    pub fn at(&self, gauge: T) -> T {
        self.by_pressure.mul_add(gauge, self.at_ambient)
    }

    /// After `t` seconds at an even rate.
    #[inline(always)]
    pub fn moved(&self, rate: &Self, t: f64) -> Self {
        Self { at_ambient: self.at_ambient + rate.at_ambient * t, by_pressure: self.by_pressure + rate.by_pressure * t }
    }
}

/// Volumes of all chambers at lengths `q` into `out`.
#[inline(always)]
pub fn volumes<T: Real>(body: &Body<T>, dead_volume: T, q: &[T], out: &mut [Volume<T>]) {
    // No `fill`: see `linear`.
    for chamber in out.iter_mut() {
        *chamber = Volume::rigid(dead_volume);
    }
    add(body, q, out);
    if !body.area_changes.is_empty() {
        add_changes(body, q, None, out);
    }
    if !body.stiffening.is_empty() {
        add_stiffening(body, q, None, out);
    }
}

/// Their rates at lengths `q` and the lengths' rates `qd` into `out`.
#[inline(always)]
pub fn volume_rates<T: Real>(body: &Body<T>, (q, qd): (&[T], &[T]), out: &mut [Volume<T>]) {
    for rate in out.iter_mut() {
        *rate = Volume::rigid(T::zero());
    }
    add(body, qd, out);
    if !body.area_changes.is_empty() {
        add_changes(body, q, Some(qd), out);
    }
    if !body.stiffening.is_empty() {
        add_stiffening(body, q, Some(qd), out);
    }
}

/// (u, v, l) of section `i`, or their rates.
#[inline(always)]
fn arc<T: Real>(body: &Body<T>, i: usize, x: &[T]) -> Vec3<T> {
    arc_from_lengths(Vec3([x[3 * i], x[3 * i + 1], x[3 * i + 2]]), body.sections[i].inverse_radius)
}

/// Volumes without changes of areas, or their rates.
#[inline(always)]
fn add<T: Real>(body: &Body<T>, x: &[T], out: &mut [Volume<T>]) {
    for (i, section) in body.sections.iter().enumerate() {
        let arc = arc(body, i, x);
        for b in &section.bellows {
            out[b.input].at_ambient += volume(section, b, arc);
        }
    }
}

/// What changes of the areas add to that.
#[inline(always)]
fn add_changes<T: Real>(body: &Body<T>, q: &[T], qd: Option<&[T]>, out: &mut [Volume<T>]) {
    let mut changes = body.area_changes.iter();
    for (i, section) in body.sections.iter().enumerate() {
        let (arc, rate) = (arc(body, i, q), qd.map(|qd| arc(body, i, qd)));
        for (b, change) in section.bellows.iter().zip(&mut changes) {
            let (long, rest) = (length(b, arc), b.rest_length);
            let e = long - rest;
            let (by_length, by_pressure) = match rate {
                None => ((e * e - rest * rest) * 0.5, long),
                Some(rate) => (e * length(b, rate), length(b, rate)),
            };
            out[b.input].at_ambient += b.terminal_area * change.by_length * by_length;
            out[b.input].by_pressure += b.terminal_area * change.by_pressure * by_pressure * 2.0;
        }
    }
}

/// What stiffness that changes with pressure adds to that: a spring that is stiffer under pressure holds air back.
#[inline(always)]
fn add_stiffening<T: Real>(body: &Body<T>, q: &[T], qd: Option<&[T]>, out: &mut [Volume<T>]) {
    for (i, (section, change)) in body.sections.iter().zip(&body.stiffening).enumerate() {
        let (arc, rate) = (arc(body, i, q), qd.map(|qd| arc(body, i, qd)));
        for b in &section.bellows {
            out[b.input].at_ambient += match rate {
                None => stiffening::volume(change, section, b, arc),
                Some(rate) => stiffening::volume_rate(change, section, b, (arc, rate)),
            };
        }
    }
}

/// Absolute pressure of mass `m` in volume `v`, Pa.
#[inline(always)]
pub fn pressure<T: Real>(pneumatics: &Pneumatics<T>, m: T, v: &Volume<T>) -> T {
    let compression = m / (v.at_ambient * pneumatics.ambient_density);
    let rigid = pneumatics.ambient_pressure * compression.powf(pneumatics.exponent);
    if !pneumatics.walls_give {
        return rigid;
    }
    // From ambient air in the volume that ambient pressure leaves it: Newton's method gets there from anywhere above.
    let ambient = (pneumatics.ambient_pressure, v.at_ambient * pneumatics.ambient_density, *v);
    pneumatics.air().pressure_from(ambient, (m, *v))
}

/// The law of the air, apart from what else pneumatics are.
#[derive(Clone, Copy, Debug)]
pub struct Air<T> {
    /// Polytropic exponent n.
    pub exponent: T,
    /// Ambient pressure, Pa.
    pub ambient: T,
    /// Whether volumes depend on pressure.
    pub walls_give: bool,
}

/// Steps of Newton's method before it is given up: it takes 2 or 3 from one sub-step to the next.
const MOST_STEPS: usize = 60;

impl<T: Real> Air<T> {
    /// Pressure of a mass in a volume, `now`, from pressure, mass and volume of the same input a moment before: that for
    /// which p (V / m)^n stays; not a number where walls that give way let none stay.
    #[inline(always)]
    pub fn pressure_from(&self, before: (T, T, Volume<T>), now: (T, Volume<T>)) -> T {
        let ((p, m_0, v_0), (m, v)) = (before, now);
        if !self.walls_give {
            return pressure_from(self.exponent, (p, m_0, v_0.at_ambient), (m, v.at_ambient));
        }
        let mut out = p;
        giving(*self, before, now, &mut out);
        out
    }
}

kernel! {
    /// The same where walls give way. Out of line, where others do not go.
    fn giving<'a, T>(air: Air<T>, before: (T, T, Volume<T>), now: (T, Volume<T>), out: &'a mut T) {
        let ((p, m_0, v_0), (m, v)) = (before, now);
        let start = (p, m_0, v_0.at(p - air.ambient));
        let (mut found, mut step, mut more) = (p, p, true);
        for _ in 0..MOST_STEPS {
            let volume = v.at(found - air.ambient);
            // Of this air in the volume that the walls have at the pressure found so far.
            let expected = pressure_from(air.exponent, start, (m, volume));
            step = (expected - found) / (air.exponent * expected * v.by_pressure / volume + 1.0);
            found += step;
            if !more {
                break;
            }
            // Once more where it is found to half of the digits: derivatives come one step later.
            more = (step.abs() - found.abs() * 1e-9).largest() > 0.0;
        }
        *out = T::select(step.abs() - found.abs() * 1e-9, T::from_f64(f64::NAN), found);
    }
}

/// Pressure of a mass in a volume, `now`, from the pressure, mass and volume of the same input a moment before: p (m V_0 /
/// (m_0 V))^n. By series where the ratio is near 1, as it is from sub-step to sub-step, to the last digits and at a
/// fifth of a power's cost.
#[inline(always)]
fn pressure_from<T: Real>(exponent: T, before: (T, T, T), now: (T, T)) -> T {
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
pub fn mass<T: Real>(pneumatics: &Pneumatics<T>, p: T, v: &Volume<T>) -> T {
    v.at(p - pneumatics.ambient_pressure)
        * pneumatics.ambient_density
        * (p / pneumatics.ambient_pressure).powf(pneumatics.exponent.recip())
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
            let m = mass(&air, p, &Volume::rigid(4e-4));
            assert!((pressure(&air, m, &Volume::rigid(4e-4)) - p).abs() < 1e-9 * p);
            // p V^1.4 of the closed chamber, by its closed form.
            let expected = p * (4e-4_f64 / 7e-4).powf(1.4);
            assert!((pressure(&air, m, &Volume::rigid(7e-4)) - expected).abs() < 1e-12 * expected);
        }
        // Step by step, near and far.
        let (m, v) = (mass(&air, 1.5e5, &Volume::rigid(4e-4)), 4e-4);
        for n in [1.0, 1.2, 1.4, 3.0] {
            air.exponent = n;
            let before = (pressure(&air, m, &Volume::rigid(v)), m, v);
            for part in [0.5, 0.9, 0.91, 0.97, 0.9999, 1.0, 1.0001, 1.05, 1.099, 1.2, 3.0] {
                for now in [(part * m, v), (m, v / part), (1.01 * m, v / part)] {
                    let (found, expected) =
                        (pressure_from(n, before, now), pressure(&air, now.0, &Volume::rigid(now.1)));
                    assert!((found - expected).abs() < 2e-15 * expected, "{n} {part}: {found} {expected}");
                }
            }
        }
        air.exponent = 1.4;
        // Walls that give way: p V(p)^n stays, near and far.
        air.walls_give = true;
        let soft = |v: f64| Volume { at_ambient: v, by_pressure: 3e-10 };
        let whole = |p: f64, v: f64| v + 3e-10 * (p - air.ambient_pressure);
        for p in [0.6e5, 1.0e5, 2.5e5] {
            let m = mass(&air, p, &soft(4e-4));
            assert!((pressure(&air, m, &soft(4e-4)) - p).abs() < 1e-9 * p);
            for v in [2.5e-4, 3.99e-4, 4.01e-4, 7e-4] {
                let found = air.air().pressure_from((p, m, soft(4e-4)), (m, soft(v)));
                let (before, now) = (p * whole(p, 4e-4).powf(1.4), found * whole(found, v).powf(1.4));
                assert!((before - now).abs() < 1e-12 * before, "{p} {v}: {found}");
                assert!((pressure(&air, m, &soft(v)) - found).abs() < 1e-9 * found);
            }
        }
        air.walls_give = false;
        // Ambient air is ideal gas: p V = m R T.
        let m = mass(&air, air.ambient_pressure, &Volume::rigid(1e-3));
        assert!((m * GAS_CONSTANT * temperature - air.ambient_pressure * 1e-3).abs() < 1e-9);
    }
}
