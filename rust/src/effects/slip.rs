//! The update that hysteresis and friction share: a spring that slips.
//!
//! Source: Dahl 1968; w' = (q' - |q'| w / g) / x with -1 <= w / g <= 1. Along a motion that does not turn back, w obeys
//! dw/dq = (1 - sign(q') w / g) / x whatever the speed, so w = s g + (w_0 - s g) exp(-|q - q_0| / (g x)), s = sign(q - q_0),
//! is exact; a turn between the two points costs an error of second order in the step.

use crate::real::Real;

/// w after a motion by `travel` from `w`; it tends to `limit` times the sign of the motion over distances `reach`.
#[inline(always)]
pub fn slip<T: Real>(w: T, travel: T, limit: T, inverse_reach: T) -> T {
    let end = T::select(travel, limit, -limit);
    end + (w - end) * (-(travel.abs() * inverse_reach)).exp()
}
