//! The registry of kinds: one line and one file a kind.

use super::registry;
use super::{Definition, Effect, Instant, Parameter, PlaceKind};
use crate::arm::Arm;
use crate::real::Real;

registry::kinds! {
    creep => Creep,
    hysteresis => Hysteresis,
    quadratic_damping => QuadraticDamping,
    formula => Formula,
}
