//! The registry of kinds: a file, its `mod` line and its line of the registry for each.
//!
//! The `mod` lines stand outside of the macro, since `cargo fmt` looks into no macro for files.

pub mod base_tilt;
pub mod bending_anisotropy;
pub mod bending_damping;
pub mod bending_nonlinear;
pub mod contact;
pub mod creep;
pub mod delay;
pub mod distributed_mass;
pub mod effective_area;
pub mod formula;
pub mod friction;
pub mod hysteresis;
pub mod leak;
pub mod length_gain;
pub mod length_offset;
pub mod marker_offset;
pub mod payload;
pub mod preload;
pub mod pressure_gain;
pub mod pressure_lag;
pub mod pressure_offset;
pub mod pressure_stiffness;
pub mod quadratic_damping;
pub mod section_coupling;
pub mod supply_sag;
pub mod taper;
pub mod tool_drag;
pub mod torsion;
pub mod valve_dead_band;
pub mod weak_bellows;
pub mod wire_backlash;
pub mod work_conjugate;

use super::registry;
use super::{Definition, Effect, Instant, Parameter, PlaceKind};
use crate::body::Body;
use crate::kinematics::section::Pose;
use crate::real::Real;

registry::kinds! {
    creep => Creep,
    hysteresis => Hysteresis,
    friction => Friction,
    quadratic_damping => QuadraticDamping,
    bending_damping => BendingDamping,
    bending_nonlinear => BendingNonlinear,
    bending_anisotropy => BendingAnisotropy,
    section_coupling => SectionCoupling,
    effective_area => EffectiveArea,
    pressure_stiffness => PressureStiffness,
    weak_bellows => WeakBellows,
    payload => Payload,
    preload => Preload,
    base_tilt => BaseTilt,
    tool_drag => ToolDrag,
    contact => Contact,
    pressure_lag => PressureLag,
    delay => Delay,
    valve_dead_band => ValveDeadBand,
    pressure_offset => PressureOffset,
    pressure_gain => PressureGain,
    leak => Leak,
    supply_sag => SupplySag,
    length_offset => LengthOffset,
    length_gain => LengthGain,
    wire_backlash => WireBacklash,
    marker_offset => MarkerOffset,
    work_conjugate => WorkConjugate,
    torsion => Torsion,
    taper => Taper,
    distributed_mass => DistributedMass,
    formula => Formula,
}
