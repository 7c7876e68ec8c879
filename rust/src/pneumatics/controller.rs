//! The pressure controller of one valve and the spool it moves.
//!
//! The wanted rate of pressure r = k_f p_ref' + k_p e + I with e = p_ref - p, I' = k_i e (PI with feed-forward of the
//! reference's rate) becomes a mass flow at the middle volume of the chamber, and by the valve's own characteristic an
//! opening and a spool position past the dead band (cf. Hildebrandt et al., "A flatness based approach for the position
//! control of a pneumatically actuated joint", IECON 2005). The controller does not know the lengths: the motion of the arm
//! is a disturbance to it, as on the real arm.
//! Anti-windup: I rests while the wanted opening lies beyond fully open and the error would push it further. Errors
//! smaller than [`TOLERANCE`] do not move I, or the dead band would make it hunt.
//! Spool: s' = (s_ref - s) / T_s, s_ref in -1 .. 1.

use super::Pneumatics;
use super::valve::FullFlows;
use crate::real::Real;

/// Pressure errors below this do not move the integral, Pa.
pub const TOLERANCE: f64 = 20.0;
/// Openings below this are led across the dead band linearly instead of by a jump.
const DEAD_BAND_RAMP: f64 = 0.01;
/// Least flow at full opening that the controller reckons with, as a part of the choked flow from the supply.
const LEAST_FLOW: f64 = 1e-3;

/// What the controller wants at a pressure.
#[derive(Clone, Copy, Debug)]
pub struct Command<T> {
    /// Spool position, -1 .. 1.
    pub spool: T,
    /// Its derivative by the pressure, 1/Pa.
    pub spool_by_pressure: T,
    /// Rate of the integral, Pa/s^2.
    pub integral_rate: T,
}

/// The controller's output at pressure `p`, where the valve has `flows`, for a reference (Pa) and its rate (Pa/s).
#[inline(always)]
pub fn command<T: Real>(
    k: &Pneumatics<T>,
    flows: &FullFlows<T>,
    volume: T,
    (reference, rate): (T, T),
    p: T,
    integral: T,
) -> Command<T> {
    let (zero, one) = (T::zero(), T::one());
    let error = reference - p;
    let wanted = k.feed_forward * rate + k.proportional_gain * error + integral;
    let flow_of_rate = volume * k.compliance;
    let flow = wanted * flow_of_rate;
    let least = k.supply_flow * k.supply_pressure * LEAST_FLOW;
    let fill = flows.fill.max(least);
    let vent = (-flows.vent).max(least);
    let inverse = T::select(flow, fill, vent).recip();
    let opening = flow * inverse;
    let limited = opening.max(-one).min(one);
    let across = (limited * (1.0 / DEAD_BAND_RAMP)).max(-one).min(one);
    let spool = limited * (one - k.dead_band) + across * k.dead_band;
    let small = error.abs() - TOLERANCE;
    let beyond = (opening - limited) * error;
    let moving = T::select(beyond, zero, T::select(small, error, zero));
    let ramp = T::select(limited.abs() - DEAD_BAND_RAMP, zero, k.dead_band * (1.0 / DEAD_BAND_RAMP));
    let slope = -k.proportional_gain * flow_of_rate * inverse * (one - k.dead_band + ramp);
    let inside = one - opening.abs();
    Command { spool, spool_by_pressure: T::select(inside, slope, zero), integral_rate: k.integral_gain * moving }
}
