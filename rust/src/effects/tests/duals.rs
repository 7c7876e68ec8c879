//! Derivatives by every number of every kind: dual numbers against central differences.

use super::*;
use crate::dynamics::recursion::forward_dynamics_into;
use crate::effects::poses::heads;
use crate::effects::pressures::{PressureChain, Sort};
use crate::effects::sensors::Sensors;
use crate::effects::{EffectState, KINDS, PlaceKind};
use crate::plant::drives::Drives;
use crate::plant::input::{Input, Interpolation};
use crate::real::{Dual, Real};
use std::sync::Arc;

fn lift<T: Real>(x: &[f64]) -> Vec<T> {
    x.iter().map(|&v| T::from_f64(v)).collect()
}

/// Everything an effect can act on, within one step of an arm.
fn outputs<T: Real>(arm: &Arm<T>) -> Vec<T> {
    let (q, qd) = state();
    let x0: Vec<T> = lift(&[q.clone(), qd.clone()].concat());
    let h = 3e-3;
    let later: Vec<f64> = q.iter().zip(&qd).map(|(q, v)| q + h * v).collect();
    let x1: Vec<T> = lift(&[later.clone(), qd.iter().map(|v| 1.1 * v).collect()].concat());
    let mut ws = crate::dynamics::Workspace::new(arm);
    // One step behind, so that hidden states are not at rest.
    let mut effects = EffectState::new(&arm.body, &arm.effects);
    effects.begin_step(&arm.body, 0.0, &x0);
    effects.end_step(&arm.body, &arm.effects, h, &x1);
    effects.begin_step(&arm.body, h, &x1);
    effects.time = 2.0 * h;
    ws.effects = effects;
    let mut out = vec![T::zero(); 9];
    let (q2, v2): (Vec<T>, Vec<T>) =
        (lift(&later.iter().zip(&qd).map(|(q, v)| q + h * v).collect::<Vec<_>>()), x1[9..].to_vec());
    forward_dynamics_into(arm, &q2, &v2, &lift::<T>(&pressures()), None, &mut ws, &mut out);
    heads(&arm.body, &arm.effects, &ws.links, |head| out.extend(head.position.0.map(|x| x * 100.0)));
    // Channels that rise and fall through the chain.
    let samples = [(0.0, 0.0), (0.01, 1e4), (0.02, -2e4)];
    let rows = samples.iter().flat_map(|(_, p)| (0..9).map(move |k| 1.2e5 + (f64::from(k) - 3.5) * p)).collect();
    let samples = samples.map(|(t, _)| t);
    let input = Input::new(samples.to_vec(), (rows, 9), (Vec::new(), 0), Interpolation::Linear).unwrap();
    let mut drives = Drives::new(vec![(Arc::new(input), 0.0)]);
    if let Some(mut chain) = PressureChain::new((&arm.effects, Sort::All), arm.body.inputs, &mut drives, 0.0) {
        let mut p = vec![T::zero(); 9];
        chain.begin_step(&arm.effects, &mut drives, 0.0, 0.017);
        chain.acting(&arm.effects, &mut drives, 0.017, &mut p);
        out.extend(p.iter().map(|p| *p * 1e-3));
    }
    if let Some(mut sensors) = Sensors::new(&arm.effects, 0.0, &x0) {
        sensors.end_step(h, &x1);
        let mut lengths = vec![T::zero(); 9];
        sensors.measure(&arm.effects, 2.0 * h, &x1, &mut lengths);
        out.extend(lengths.iter().map(|l| *l * 100.0));
        sensors.measure_heads(&arm.body, &arm.effects, 2.0 * h, &x1, &mut ws.links, |_, head| {
            out.extend(head.position.0.map(|x| x * 100.0));
        });
    }
    out
}

fn with<T: Real>(p: &ArmParameters, name: &str, value: T) -> Vec<T> {
    let mut arm = Arm::unapplied(p).unwrap().lift::<T>();
    arm.effects.set(0, name, value).unwrap();
    outputs(&arm.applied())
}

/// Numbers that make each kind act.
fn sample(name: &str) -> Option<&'static [(&'static str, f64)]> {
    Some(match name {
        "effective_area" => &[("by_pressure", 1e-6), ("by_length", 0.5)],
        "pressure_stiffness" => &[("axial", 1e-6), ("bending", 3e-6)],
        "payload" => &[("mass", 0.2), ("x", 0.03), ("y", -0.02), ("z", 0.05)],
        "base_tilt" => &[("about_x", 0.05), ("about_y", -0.1)],
        "tool_drag" => &[("stiffness", 20.0), ("damping", 1.0), ("drag", 2.0), ("anchor_x", 0.1)],
        "contact" => &[
            ("stiffness", 500.0),
            ("damping", 5.0),
            ("wall_z", 0.46),
            ("normal_x", 0.2),
            ("normal_z", -0.9),
            ("rounding", 0.1),
        ],
        "creep" => &[("stiffness", 300.0), ("tau", 0.01), ("strain", 1e-3)],
        "hysteresis" => &[("amplitude", 3.0), ("yield", 2e-3), ("sharpness", 0.3), ("start", 0.2)],
        "friction" => {
            &[("coulomb_force", 1.0), ("presliding", 1e-3), ("static_ratio", 1.4), ("stribeck_velocity", 0.1)]
        }
        "pressure_lag" => &[("fill", 0.02), ("vent", 0.05)],
        "delay" => &[("time", 2.2e-3)],
        "valve_dead_band" => &[("band", 3e3)],
        "preload" => &[("along", 5.0), ("to_x", 0.2), ("to_y", -0.1)],
        "pressure_offset" => &[("offset", 500.0)],
        "pressure_gain" => &[("gain", 0.03)],
        "leak" => &[("drop", 2e3)],
        "supply_sag" => &[("share", 0.2), ("tau", 0.03)],
        "wire_backlash" => &[("play", 1e-4)],
        "marker_offset" => &[("x", 0.01), ("y", -0.02), ("z", 0.03)],
        "length_offset" => &[("offset", 1e-3)],
        "length_gain" => &[("gain", 0.01)],
        "weak_bellows" => &[("change", -0.2)],
        "bending_nonlinear" => &[("cubic_stiffness", 0.4), ("quintic_stiffness", 0.2)],
        "bending_anisotropy" => &[("stiffness", 0.7), ("angle", 0.6)],
        "bending_damping" => &[("damping", 0.05)],
        "quadratic_damping" => &[("damping", 50.0)],
        "section_coupling" => &[("stiffness", 0.3), ("damping", 0.01)],
        "torsion" => &[("stiffness", 20.0)],
        "taper" => &[("change", 0.3)],
        "distributed_mass" => &[("share", 0.4)],
        _ => return None,
    })
}

#[test]
fn derivatives_by_every_number_of_every_kind() {
    let mut checked = 0;
    for kind in KINDS {
        let mut cases = Vec::new();
        if kind.name == "formula" {
            cases.push(formula(
                "-c * tanh(qd / v0) * (1 + k * (p - 1e5)) + pow(a, 3) * sqrt(abs(q)) * t",
                "all",
                &[("c", 2.0), ("v0", 0.1), ("k", 1e-6), ("a", 3.0)],
            ));
        } else if let Some(numbers) = sample(kind.name) {
            for place in kind.places {
                let text = match place {
                    PlaceKind::All => "all",
                    PlaceKind::Section => "section 2",
                    PlaceKind::Bellows => "bellows 22",
                    PlaceKind::Input => "input p22",
                    PlaceKind::Sensors => "sensors",
                    PlaceKind::Heads => "heads",
                };
                cases.push(effect(kind.name, text, numbers));
            }
        } else {
            assert!(kind.parameters.is_empty(), "no sample of {}", kind.name);
        }
        for case in cases {
            let p = parameters(std::slice::from_ref(&case));
            for (name, &value) in &case.parameters {
                let h = 1e-5 * value.abs().max(1e-6);
                let (plus, minus) = (with(&p, name, value + h), with(&p, name, value - h));
                let dual = with(&p, name, Dual::<1>::variable(value, 0));
                let differences: Vec<f64> = plus.iter().zip(&minus).map(|(a, b)| (a - b) / (2.0 * h)).collect();
                let exact: Vec<f64> = dual.iter().map(|d| d.derivative[0]).collect();
                assert!(close(&exact, &differences, 2e-5), "{case:?} {name}:\n{exact:?}\n{differences:?}");
                assert!(differences.iter().any(|d| d.abs() > 0.0), "{case:?}: {name} does nothing");
                checked += 1;
            }
        }
    }
    assert!(checked > 60);
}
