//! The registry of kinds: one line and one file a kind.

use super::registry;
use super::{Definition, Effect, Instant, Parameter, PlaceKind};
use crate::arm::Arm;
use crate::real::Real;

registry::kinds! {
    creep => Creep,
    hysteresis => Hysteresis,
    friction => Friction,
    quadratic_damping => QuadraticDamping,
    bending_damping => BendingDamping,
    bending_nonlinear => BendingNonlinear,
    section_coupling => SectionCoupling,
    effective_area => EffectiveArea,
    weak_bellows => WeakBellows,
    payload => Payload,
    base_tilt => BaseTilt,
    tool_drag => ToolDrag,
    contact => Contact,
    pressure_lag => PressureLag,
    delay => Delay,
    valve_dead_band => ValveDeadBand,
    pressure_offset => PressureOffset,
    pressure_gain => PressureGain,
    length_offset => LengthOffset,
    length_gain => LengthGain,
    work_conjugate => WorkConjugate,
    torsion => Torsion,
    non_constant_curvature => NonConstantCurvature,
    formula => Formula,
}
