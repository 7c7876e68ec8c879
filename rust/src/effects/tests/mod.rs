//! Tests of the effects against closed forms, against changed arms, and by energy.

mod arm;
mod duals;
mod energy;
mod hidden;
mod pressures;
mod registry;
mod sensors;
mod trapped;

use crate::arm::Arm;
use crate::body::parameters::EffectParameters;
use crate::body::parameters::{ArmParameters, BellowsParameters, ForceModel, SectionParameters};
use crate::dynamics::Workspace;
use crate::dynamics::terms::generalized_force_into;
use crate::forces::ForceSet;

/// The nominal arm, with work_conjugate forces and these effects.
pub fn parameters(effects: &[EffectParameters]) -> ArmParameters {
    let numbers = [
        (0.75, [0.0057, 0.0056, 0.0063], 0.1, 0.0026, 1300.0, 18.0, 4.0),
        (0.6, [0.0042, 0.0041, 0.0043], 0.093, 0.0021, 1050.0, 14.0, 3.0),
        (0.45, [0.0027, 0.0026, 0.0023], 0.079, 0.0015, 750.0, 10.0, 1.8),
    ];
    let section = |(i, (mass, inertia, radius, area, stiffness, damping, bending)): (usize, _)| SectionParameters {
        mass,
        inertia,
        center_of_mass: [0.004, -0.003, 0.002],
        force_point: None,
        bellows_radius: radius,
        base_offset: 0.01,
        head_offset: 0.02,
        bending_stiffness: [bending, 0.0, 0.0],
        cross_bending_stiffness: None,
        bending_plane: 0.0,
        axial: None,
        length_range: [0.1, 0.3],
        bellows: (0..3)
            .map(|k| BellowsParameters {
                angle: (120.0 * k as f64).to_radians(),
                radius,
                terminal_area: area,
                rest_length: 0.15,
                stiffness: vec![stiffness, 1.2 * stiffness, 10.0 * stiffness],
                damping,
                input: 3 * i + k,
            })
            .collect(),
        arcs: Vec::new(),
        masses: Vec::new(),
    };
    ArmParameters {
        name: "nominal".to_owned(),
        base: None,
        gravity: [0.0, 0.0, 9.81],
        ambient_pressure: 101_325.0,
        force_model: ForceModel::WorkConjugate,
        rotational_energy: true,
        coriolis_forces: true,
        inputs: (1..=3).flat_map(|i| (1..=3).map(move |k| format!("p{i}{k}"))).collect(),
        section: numbers.into_iter().enumerate().map(section).collect(),
        pneumatics: None,
        effect: effects.to_vec(),
    }
}

/// One effect.
pub fn effect(kind: &str, place: &str, numbers: &[(&str, f64)]) -> EffectParameters {
    EffectParameters {
        kind: kind.to_owned(),
        place: place.to_owned(),
        parameters: numbers.iter().map(|(n, v)| ((*n).to_owned(), *v)).collect(),
        force: None,
    }
}

/// A formula.
pub fn formula(text: &str, place: &str, numbers: &[(&str, f64)]) -> EffectParameters {
    EffectParameters { force: Some(text.to_owned()), ..effect("formula", place, numbers) }
}

/// The nominal arm with these effects.
pub fn arm(effects: &[EffectParameters]) -> Arm {
    Arm::new(&parameters(effects)).unwrap()
}

/// A bent state: lengths and rates.
pub fn state() -> (Vec<f64>, Vec<f64>) {
    let q = (0..9).map(|k| 0.19 + 0.04 * (1.7 * f64::from(k) + 0.3).sin()).collect();
    let qd = (0..9).map(|k| 0.3 * (2.3 * f64::from(k) + 1.1).sin()).collect();
    (q, qd)
}

/// Pressures around 1.3 bar.
pub fn pressures() -> Vec<f64> {
    (0..9).map(|k| 1.3e5 + 2e4 * (0.9 * f64::from(k)).cos()).collect()
}

/// Generalized force of `set` at [`state`].
pub fn force(arm: &Arm, set: ForceSet) -> Vec<f64> {
    let (q, qd) = state();
    let mut out = vec![0.0; 9];
    generalized_force_into(arm, set, (&q, &qd), &pressures(), None, &mut Workspace::new(arm), &mut out);
    out
}

/// Only the effects that belong to N.
pub const EFFECTS: ForceSet = ForceSet { effects: true, ..ForceSet::NONE };

/// Whether two vectors agree relative to the second's size.
pub fn close(found: &[f64], expected: &[f64], tolerance: f64) -> bool {
    let scale = expected.iter().fold(1e-9_f64, |m, x| m.max(x.abs()));
    found.len() == expected.len() && found.iter().zip(expected).all(|(f, e)| (f - e).abs() <= tolerance * scale)
}
