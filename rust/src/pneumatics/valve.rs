//! Mass flow through a valve, both directions, and the ports of a pressure-control valve.
//!
//! Source: ISO 6358-1:2013: with sonic conductance C, critical pressure ratio b, upstream p1 and T1, downstream p2,
//! q_m = C rho_0 p1 sqrt(T_0 / T1) psi(p2 / p1), psi = 1 for p2 / p1 <= b (choked), else
//! psi = sqrt(1 - ((p2 / p1 - b) / (1 - b))^2) (subsonic); rho_0 = 1.185 kg/m^3 and T_0 = 293.15 K of the standard
//! reference atmosphere.
//! Sign: positive from the first to the second pressure.
//! Limits: the standard's formula has an infinite slope at equal pressures, where no valve has one. Above the pressure
//! ratio [`LAMINAR_RATIO`] the flow is linear in the pressure difference (Beater, *Pneumatic Drives*, 2007, sec. 4.3);
//! it is continuous there. Tests against the formula stay below that ratio.

use super::Pneumatics;
use crate::real::Real;

/// Density of the reference atmosphere, kg/m^3.
pub const REFERENCE_DENSITY: f64 = 1.185;
/// Temperature of the reference atmosphere, K.
pub const REFERENCE_TEMPERATURE: f64 = 293.15;
/// Above this pressure ratio the flow is linear in the pressure difference.
pub const LAMINAR_RATIO: f64 = 0.999;

/// psi of a critical pressure ratio, with what does not depend on the pressures worked out once.
#[derive(Clone, Copy, Debug)]
pub struct FlowFunction<T> {
    /// b.
    critical_ratio: T,
    /// 1 / (1 - b).
    inverse: T,
    /// psi at [`LAMINAR_RATIO`].
    at_laminar: T,
}

impl FlowFunction<f64> {
    /// For the critical pressure ratio `b`, from 0 to below [`LAMINAR_RATIO`].
    pub fn new(b: f64) -> Self {
        let inverse = (1.0 - b).recip();
        let x = (LAMINAR_RATIO - b) * inverse;
        Self { critical_ratio: b, inverse, at_laminar: (1.0 - x * x).sqrt() }
    }
}

impl<T: Real> FlowFunction<T> {
    /// The same over another scalar, number by number.
    #[inline(always)]
    pub fn map<U: Real>(&self, c: impl Fn(T) -> U) -> FlowFunction<U> {
        FlowFunction {
            critical_ratio: c(self.critical_ratio),
            inverse: c(self.inverse),
            at_laminar: c(self.at_laminar),
        }
    }

    /// psi(r) and d psi/dr.
    #[inline(always)]
    fn at(&self, r: T) -> (T, T) {
        let x = ((r - self.critical_ratio) * self.inverse).max(T::zero());
        // No square root of zero: its derivative would be infinite, also where its value is not used.
        let subsonic = (T::one() - x * x).max(T::from_f64(1e-12)).sqrt();
        let slope = -self.at_laminar * (1.0 / (1.0 - LAMINAR_RATIO));
        let beyond = r - LAMINAR_RATIO;
        (
            T::select(beyond, self.at_laminar + slope * beyond, subsonic),
            T::select(beyond, slope, -x * self.inverse / subsonic),
        )
    }
}

/// Mass flow per upstream pressure of a choked opening of sonic conductance `conductance` (m^3/(s Pa)) at `temperature`
/// (K): C rho_0 sqrt(T_0 / T), kg/(s Pa).
pub fn choked_flow(conductance: f64, temperature: f64) -> f64 {
    conductance * REFERENCE_DENSITY * (REFERENCE_TEMPERATURE / temperature).sqrt()
}

/// Mass flow from `p1` to `p2`, kg/s, and its derivative by `p2`; `choked` as [`choked_flow`] gives it.
#[inline(always)]
pub fn mass_flow<T: Real>(choked: T, function: &FlowFunction<T>, p1: T, p2: T) -> (T, T) {
    let (high, low) = (p1.max(p2), p1.min(p2));
    let ratio = low / high;
    let (psi, slope) = function.at(ratio);
    let forward = p1 - p2;
    // q = k high psi(low / high): by `low` k psi', by `high` k (psi - r psi').
    let by_low = choked * slope;
    let by_high = choked * (psi - ratio * slope);
    let flow = choked * high * psi;
    (T::select(forward, flow, -flow), T::select(forward, by_low, -by_high))
}

/// Flows into a chamber at full opening either way, with their derivatives by its pressure.
#[derive(Clone, Copy, Debug)]
pub struct FullFlows<T> {
    /// Towards the supply.
    pub fill: T,
    /// Its derivative.
    pub fill_slope: T,
    /// Towards exhaust and vacuum; negative where air leaves.
    pub vent: T,
    /// Its derivative.
    pub vent_slope: T,
}

impl<T: Real> FullFlows<T> {
    /// At chamber pressure `p`.
    ///
    /// With a vacuum port the exhaust has a check valve: the vacuum draws from the chamber, not from the exhaust.
    #[inline(always)]
    pub fn new(valve: &Pneumatics<T>, p: T) -> Self {
        let function = &valve.flow_function;
        let (fill, fill_slope) = mass_flow(valve.supply_flow, function, valve.supply_pressure, p);
        let (mut vent, mut vent_slope) = mass_flow(valve.exhaust_flow, function, valve.exhaust_pressure, p);
        if valve.has_vacuum {
            let zero = T::zero();
            let (drawn, drawn_slope) = mass_flow(valve.exhaust_flow, function, valve.vacuum_pressure, p);
            vent_slope = T::select(-vent, vent_slope, zero) + drawn_slope;
            vent = T::select(-vent, vent, zero) + drawn;
        }
        Self { fill, fill_slope, vent, vent_slope }
    }

    /// Mass flow into the chamber with the spool at `spool`: value, by the pressure, by the spool.
    #[inline(always)]
    pub fn at(&self, valve: &Pneumatics<T>, spool: T) -> (T, T, T) {
        let (open, slope) = opening(valve, spool);
        (
            T::select(open, open * self.fill, -open * self.vent),
            T::select(open, open * self.fill_slope, -open * self.vent_slope),
            T::select(open, slope * self.fill, -slope * self.vent),
        )
    }
}

/// Opening in -1 .. 1 of a spool at -1 .. 1 with its dead band, and its derivative.
#[inline(always)]
pub fn opening<T: Real>(valve: &Pneumatics<T>, spool: T) -> (T, T) {
    let slope = valve.inverse_travel;
    let beyond = spool.abs() - valve.dead_band;
    let size = beyond * slope;
    let zero = T::zero();
    (T::select(beyond, T::select(spool, size, -size), zero), T::select(beyond, slope, zero))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The standard's formula, written as in the standard.
    fn iso_6358(c: f64, b: f64, temperature: f64, p1: f64, p2: f64) -> f64 {
        let choked = c * 1.185 * p1 * (293.15 / temperature).sqrt();
        if p2 / p1 <= b { choked } else { choked * (1.0 - ((p2 / p1 - b) / (1.0 - b)).powi(2)).sqrt() }
    }

    #[test]
    fn choked_and_subsonic_flow_follow_the_standard() {
        let (c, b, temperature) = (1.3e-8, 0.31, 310.0);
        let (choked, psi) = (choked_flow(c, temperature), FlowFunction::new(b));
        for k in 0..1000 {
            let (p1, p2) = (3.1e5, 3.1e5 * LAMINAR_RATIO * f64::from(k) / 1000.0);
            let expected = iso_6358(c, b, temperature, p1, p2);
            let (there, back) = (mass_flow(choked, &psi, p1, p2).0, mass_flow(choked, &psi, p2, p1).0);
            assert!((there - expected).abs() < 1e-14 * expected.abs().max(1e-3), "{k}: {there} {expected}");
            assert_eq!(there, -back);
        }
        assert_eq!(mass_flow(choked, &psi, 2e5, 2e5).0, 0.0);
    }

    #[test]
    fn slopes_are_derivatives_and_the_laminar_piece_is_continuous() {
        let (choked, psi) = (choked_flow(1.3e-8, 293.15), FlowFunction::new(0.31));
        let flow = |p2: f64| mass_flow(choked, &psi, 1e5, p2);
        for p2 in [0.2e5, 0.5e5, 0.7e5, 0.99e5, 0.9995e5, 1.0002e5, 1.2e5, 3e5, 8e5] {
            let h = 1e-2;
            let difference = (flow(p2 + h).0 - flow(p2 - h).0) / (2.0 * h);
            let slope = flow(p2).1;
            assert!((difference - slope).abs() < 1e-6 * slope.abs().max(1e-9), "{p2}: {difference} {slope}");
        }
        let at = LAMINAR_RATIO * 1e5;
        let (below, above) = (flow(at * (1.0 - 1e-12)).0, flow(at * (1.0 + 1e-12)).0);
        assert!((below - above).abs() < 1e-8 * below);
    }
}
