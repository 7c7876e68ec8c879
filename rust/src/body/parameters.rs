//! What a parameter file says, fully expanded, as plain data.
//!
//! The keys are those of the schema `bha-arm/1`. The Python package validates a user's file and fills in defaults; this
//! module reads the result (JSON) and `Arm::new` checks it again, so that the crate is safe on its own.

use super::BENDING_TERMS;
use serde::{Deserialize, Deserializer, Serialize, de};
use std::collections::BTreeMap;

/// How bellows forces act on the arm. See `forces`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ForceModel {
    /// The paper's (27)-(32): a pair of end forces along the section's z axes.
    EndForce,
    /// Virtual work of the bellows on its own change of length.
    WorkConjugate,
}

/// An arm. SI units; frames as in `docs/explanation/model.md`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ArmParameters {
    /// Name of the arm.
    pub name: String,
    /// Where the base stands in the world; the world's frame is the base's without.
    #[serde(default)]
    pub base: Option<BaseParameters>,
    /// Gravity in the world, m/s^2.
    pub gravity: [f64; 3],
    /// Ambient pressure, Pa absolute.
    pub ambient_pressure: f64,
    /// How bellows forces act.
    pub force_model: ForceModel,
    /// Whether the sections' rotational energy counts (paper: full model), or not (58).
    #[serde(default = "yes")]
    pub rotational_energy: bool,
    /// Whether Coriolis and centrifugal forces count (paper: full model), or not (60).
    #[serde(default = "yes")]
    pub coriolis_forces: bool,
    /// Names of the pressure inputs.
    pub inputs: Vec<String>,
    /// From commanded to acting pressure; the command acts as it is without.
    #[serde(default)]
    pub pneumatics: Option<PneumaticsParameters>,
    /// The sections from the base on.
    pub section: Vec<SectionParameters>,
    /// The effects that the paper's model leaves out.
    #[serde(default)]
    pub effect: Vec<EffectParameters>,
}

fn yes() -> bool {
    true
}

/// How much of the pneumatics is modelled. See `pneumatics`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PneumaticsLevel {
    /// The commanded pressure acts.
    Ideal,
    /// First-order lag.
    Lag,
    /// Valve, spool, chamber and pressure controller.
    Full,
}

/// The pneumatics of an arm, the same for every input. Keys that the level does not need may be absent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PneumaticsParameters {
    /// How much is modelled.
    pub level: PneumaticsLevel,
    /// Time constant of filling, s (`lag`).
    pub fill_time: Option<f64>,
    /// Time constant of venting, s (`lag`).
    pub vent_time: Option<f64>,
    /// Absolute supply pressure, Pa (`full`, as all that follows).
    pub supply_pressure: Option<f64>,
    /// Absolute pressure behind the exhaust, Pa.
    pub exhaust_pressure: Option<f64>,
    /// Absolute pressure of the vacuum, Pa; none without.
    pub vacuum_pressure: Option<f64>,
    /// Sonic conductance C of ISO 6358, m^3/(s Pa).
    pub sonic_conductance: Option<f64>,
    /// The same towards exhaust and vacuum; `sonic_conductance` without.
    pub exhaust_conductance: Option<f64>,
    /// Critical pressure ratio b of ISO 6358.
    pub critical_pressure_ratio: Option<f64>,
    /// Temperature of the air, K.
    pub air_temperature: Option<f64>,
    /// Volume of an input besides its bellows, m^3.
    pub dead_volume: Option<f64>,
    /// Polytropic exponent of the air in the chambers.
    pub polytropic_exponent: Option<f64>,
    /// Time constant of the valve's spool, s.
    pub spool_time: Option<f64>,
    /// Spool travel without flow, as a part of its full travel.
    pub spool_dead_band: Option<f64>,
    /// Pressure controller: gain on the error, 1/s.
    pub proportional_gain: Option<f64>,
    /// Pressure controller: gain on the error's integral, 1/s^2.
    pub integral_gain: Option<f64>,
    /// Pressure controller: part of the reference's rate that is fed forward.
    pub feed_forward: Option<f64>,
}

/// Pose of the base in the world, paper (12).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BaseParameters {
    /// Its origin, m.
    pub position: [f64; 3],
    /// Rotation vector, rad.
    pub rotation: [f64; 3],
}

/// One of several arcs that make a section, from its base on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SectionArcParameters {
    /// Share of the section's length; the shares add up to 1.
    pub length: f64,
    /// Share of its bending angle, likewise.
    pub bending: f64,
    /// Radius of the bellows here, relative to the other arcs; their mean weighted by bending stands for `bellows_radius`.
    pub relative_radius: f64,
    /// Area of the bellows here, relative to the other arcs; their mean weighted by length stands for `terminal_area`.
    pub relative_area: f64,
}

/// A mass at a place along a section, beside the one at its head.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PointMassParameters {
    /// Where on the section's arcs, as a share of their length: 0 (base) to 1 (head).
    pub share: f64,
    /// Mass, kg.
    pub mass: f64,
    /// Principal moments of inertia about its centre of mass, along the axes of the centre line's frame there, kg m^2.
    pub inertia: [f64; 3],
    /// Its centre of mass in that frame, m.
    pub offset: [f64; 3],
}

/// One section.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SectionParameters {
    /// Lumped mass, kg.
    pub mass: f64,
    /// Principal moments of inertia about the centre of mass, along the head frame's axes, kg m^2.
    pub inertia: [f64; 3],
    /// Centre of mass r_S in the head frame, m.
    pub center_of_mass: [f64; 3],
    /// Where external forces act, in the head frame, m; the centre of mass, as in (28), if left out.
    #[serde(default)]
    pub force_point: Option<[f64; 3]>,
    /// Radius r_B on which the three coordinate lengths lie, m.
    pub bellows_radius: f64,
    /// Rigid piece along z before the arc, m.
    #[serde(default)]
    pub base_offset: f64,
    /// Rigid piece along z after the arc, m; the head frame sits at its end.
    #[serde(default)]
    pub head_offset: f64,
    /// k1, k3, k5 of M_bend = k1 psi + k3 psi^3 + k5 psi^5, N m / rad^(1, 3, 5); in the plane `bending_plane` where
    /// `cross_bending_stiffness` is given.
    #[serde(deserialize_with = "bending_terms")]
    pub bending_stiffness: [f64; BENDING_TERMS],
    /// k1, k3, k5 at right angles to that plane; all planes are alike if left out.
    #[serde(default, deserialize_with = "cross_bending_terms")]
    pub cross_bending_stiffness: Option<[f64; BENDING_TERMS]>,
    /// phi of that plane, rad.
    #[serde(default)]
    pub bending_plane: f64,
    /// What holds the mean length beside the bellows.
    #[serde(default)]
    pub axial: Option<AxialParameters>,
    /// Shortest and longest bellows length, m (not enforced by the dynamics).
    pub length_range: [f64; 2],
    /// The bellows of this section.
    pub bellows: Vec<BellowsParameters>,
    /// Its arcs from the base on; one arc if left out.
    #[serde(default)]
    pub arcs: Vec<SectionArcParameters>,
    /// The masses along it, beside `mass`.
    #[serde(default)]
    pub masses: Vec<PointMassParameters>,
}

/// What holds the mean length of a section beside its bellows: a sleeve, a backbone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AxialParameters {
    /// Mean length without force, m.
    pub rest_length: f64,
    /// Force polynomial in (mean length - rest_length), ascending from the first power: N/m, N/m^2, ...
    pub stiffness: Vec<f64>,
    /// Viscous damping of the mean length, N s/m.
    pub damping: f64,
}

/// One bellows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BellowsParameters {
    /// Angle about z from the x axis, rad.
    pub angle: f64,
    /// Distance from the backbone, m.
    pub radius: f64,
    /// Terminal area A_P, m^2.
    pub terminal_area: f64,
    /// Length without spring force, m.
    pub rest_length: f64,
    /// Spring force polynomial in (length - rest_length), ascending from the first power: N/m, N/m^2, ...
    pub stiffness: Vec<f64>,
    /// Viscous damping, N s/m.
    pub damping: f64,
    /// Index of the pressure input that feeds it.
    pub input: usize,
}

/// An `[[effect]]` table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EffectParameters {
    /// Kind, a name of the registry.
    pub kind: String,
    /// Place: `all`, `section 2`, `bellows 32`, `input p13`, `sensors`.
    #[serde(rename = "where")]
    pub place: String,
    /// Numbers by name, SI.
    #[serde(default)]
    pub parameters: BTreeMap<String, f64>,
    /// The force of a `formula`.
    #[serde(default)]
    pub force: Option<String>,
}

/// Coefficients of a bending moment, zero where fewer are given.
fn bending_terms<'de, D: Deserializer<'de>>(from: D) -> Result<[f64; BENDING_TERMS], D::Error> {
    let given = Vec::<f64>::deserialize(from)?;
    let mut all = [0.0; BENDING_TERMS];
    let places = all.get_mut(..given.len()).filter(|p| !p.is_empty());
    places.ok_or_else(|| de::Error::invalid_length(given.len(), &"1 to 3 coefficients"))?.copy_from_slice(&given);
    Ok(all)
}

fn cross_bending_terms<'de, D: Deserializer<'de>>(from: D) -> Result<Option<[f64; BENDING_TERMS]>, D::Error> {
    #[derive(Deserialize)]
    struct Terms(#[serde(deserialize_with = "bending_terms")] [f64; BENDING_TERMS]);
    Ok(Option::<Terms>::deserialize(from)?.map(|terms| terms.0))
}
