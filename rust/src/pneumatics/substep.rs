//! Mass, spool and integral of one input over a step of the arm: ROS2 in sub-steps of even length.
//!
//! Source: Verwer, Spee, Blom & Hundsdorfer, SIAM J. Sci. Comput. 20 (1999) 1456. Over any scalar; the pressure goes along
//! from sub-step to sub-step ([`super::chamber::Air::pressure_from`]), from a fresh one at the start of each step.

use super::chamber::Volume;
use super::{Pneumatics, controller, valve};
use crate::real::Real;

/// State of one input's pneumatics.
#[derive(Clone, Copy, Debug)]
pub struct Input<T> {
    /// `full`: mass of air, kg. `lag`: pressure, Pa.
    pub content: T,
    /// Spool position.
    pub spool: T,
    /// Integral of the controller, Pa/s.
    pub integral: T,
}

/// What drives an input over a step: straight lines from its start.
#[derive(Clone, Copy, Debug)]
pub struct Drive<T> {
    /// Commanded pressure at the start, Pa.
    pub reference: T,
    /// Its rate, Pa/s.
    pub reference_rate: T,
    /// Volume at the start, m^3.
    pub volume: Volume<T>,
    /// Its rate, m^3/s.
    pub volume_rate: Volume<T>,
}

impl<T: Real> Drive<T> {
    /// Its volume `t` seconds after the start.
    #[inline(always)]
    pub fn volume_at(&self, t: f64) -> Volume<T> {
        self.volume.moved(&self.volume_rate, t)
    }
}

/// Stiff derivatives of the right-hand side; that of the spool by itself is -1 / T_s.
struct Stiff<T> {
    mass_by_mass: T,
    mass_by_spool: T,
    spool_by_mass: T,
}

/// Right-hand side of (mass, spool, integral) where the pressure is `p`, and its stiff derivatives.
#[inline(always)]
fn rates<T: Real>(
    k: &Pneumatics<T>,
    control_volume: T,
    (x, p): (Input<T>, T),
    drive: &Drive<T>,
    t: f64,
) -> (Input<T>, Stiff<T>) {
    let reference = drive.reference + drive.reference_rate * t;
    let flows = valve::FullFlows::new(k, p);
    let command = controller::command(k, &flows, control_volume, (reference, drive.reference_rate), p, x.integral);
    let (flow, by_pressure, by_spool) = flows.at(k, x.spool);
    let rate =
        Input { content: flow, spool: (command.spool - x.spool) * k.spool_rate, integral: command.integral_rate };
    let pressure_by_mass = k.exponent * p / x.content;
    let stiff = Stiff {
        mass_by_mass: by_pressure * pressure_by_mass,
        mass_by_spool: by_spool,
        spool_by_mass: command.spool_by_pressure * pressure_by_mass * k.spool_rate,
    };
    (rate, stiff)
}

/// One ROS2 step of length `h` from time `t` of the arm's step on, from a state and its pressure to those at its end.
#[inline(always)]
pub fn substep<T: Real>(
    k: &Pneumatics<T>,
    control_volume: T,
    (x, p): (Input<T>, T),
    drive: &Drive<T>,
    (t, h): (f64, f64),
) -> (Input<T>, T) {
    const GAMMA: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;
    let one = T::one();
    let (f1, stiff) = rates(k, control_volume, (x, p), drive, t);
    let g = GAMMA * h;
    // (1 - gamma h W) k = f for mass and spool, by Cramer's rule: both diagonal entries are at least 1, and the
    // controller counteracts, so that the determinant is too.
    let (mm, ms, sm) = (one - stiff.mass_by_mass * g, -stiff.mass_by_spool * g, -stiff.spool_by_mass * g);
    let ss = one + k.spool_rate * g;
    let inverse = (mm * ss - ms * sm).recip();
    // No closures: what stays out of line is compiled without the lanes' instruction set.
    let k1 = solved(f1, (mm, ms, sm, ss), inverse);
    let air = k.air();
    let before = (p, x.content, drive.volume_at(t));
    let volume = drive.volume_at(t + h);
    let stage = moved(h, x, k1);
    let stage_pressure = air.pressure_from(before, (stage.content, volume));
    let (f2, _) = rates(k, control_volume, (stage, stage_pressure), drive, t + h);
    let k2 = solved(moved(-2.0, f2, k1), (mm, ms, sm, ss), inverse);
    let next = moved(0.5 * h, moved(1.5 * h, x, k1), k2);
    (next, air.pressure_from(before, (next.content, volume)))
}

/// The solution of (mm ms; sm ss) (content, spool) = f, with one over the determinant; the integral as it is.
#[inline(always)]
fn solved<T: Real>(f: Input<T>, (mm, ms, sm, ss): (T, T, T, T), inverse: T) -> Input<T> {
    Input {
        content: (f.content * ss - ms * f.spool) * inverse,
        spool: (f.spool * mm - sm * f.content) * inverse,
        integral: f.integral,
    }
}

/// a + w b.
#[inline(always)]
fn moved<T: Real>(w: f64, a: Input<T>, b: Input<T>) -> Input<T> {
    Input { content: a.content + b.content * w, spool: a.spool + b.spool * w, integral: a.integral + b.integral * w }
}
