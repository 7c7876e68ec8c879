//! A first-order lag with one time constant for filling and another for venting.

use super::Pneumatics;
use super::substep::Drive;
use crate::real::Real;

/// The lagged pressure after `elapsed` under a reference that moves evenly: exact, also where it meets the reference, from
/// which on the other time constant holds.
#[inline(always)]
pub fn lagged<T: Real>(pneumatics: &Pneumatics<T>, p: T, drive: &Drive<T>, elapsed: f64) -> T {
    let (zero, elapsed) = (T::zero(), T::from_f64(elapsed));
    let (ahead, rate) = (p - drive.reference, drive.reference_rate);
    let time = T::select(-ahead, pneumatics.fill_time, pneumatics.vent_time);
    // Past the transient the pressure follows the reference's line, `time` behind it: on the other side of the reference
    // if that moves towards the pressure.
    let behind = rate * time;
    let meets = ahead * rate;
    let ratio = T::select(meets, ahead / T::select(rate * rate, behind, T::one()), zero);
    let at_once = T::select(rate * rate, zero, elapsed);
    let meeting = T::select(-meets, elapsed, T::select(meets, time * (ratio.max(zero) + 1.0).ln(), at_once));
    let before = meeting.min(elapsed);
    let rest = elapsed - before;
    let first = (ahead + behind) * (-(before / time)).exp() - behind;
    let other = T::select(rate, pneumatics.fill_time, pneumatics.vent_time);
    let second = rate * other * ((-(rest / other)).exp() - 1.0);
    drive.reference + rate * elapsed + T::select(rest, second, first)
}
