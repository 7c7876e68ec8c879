//! What effects cost: one second of the nominal arm simulated (rk4, 1 ms) without and with them.
//!
//! `cargo bench --bench effects`

use bha_core::arm::Arm;
use bha_core::body::parameters::ArmParameters;
use bha_core::integrate::{Integrator, Method, Options};
use bha_core::plant::Plant;
use bha_core::plant::input::{Input, Interpolation};
use serde_json::{Value, json};
use std::sync::Arc;
use std::time::Instant;

fn arm(effects: &Value) -> Arc<Arm> {
    let packed = include_bytes!("../tests/data/oracle_cases.json.gz").as_slice();
    let oracle: Value = serde_json::from_reader(flate2::read::GzDecoder::new(packed)).unwrap();
    let mut arms: Vec<ArmParameters> = oracle["core_parameters"]
        .as_object()
        .unwrap()
        .values()
        .map(|arm| {
            let mut arm = arm.clone();
            arm["effect"] = effects.clone();
            serde_json::from_value::<ArmParameters>(arm).unwrap()
        })
        .filter(|arm| arm.section.len() == 3)
        .collect();
    arms.sort_by(|a, b| a.name.cmp(&b.name));
    Arc::new(Arm::new(&arms[0]).unwrap())
}

/// Nanoseconds per evaluation of the right-hand side, the best of several runs.
fn cost(effects: &Value) -> f64 {
    let arm = arm(effects);
    let times: Vec<f64> = (0..=200).map(|k| 5e-3 * f64::from(k)).collect();
    let rows = times.iter().flat_map(|t| (0..arm.body.inputs).map(move |k| 1.2e5 + 1e4 * (6.0 * t + k as f64).sin()));
    let pressures = (rows.collect(), arm.body.inputs);
    let input = Arc::new(Input::new(times, pressures, (Vec::new(), 0), Interpolation::Linear).unwrap());
    let options = Options { method: Method::Rk4, step: 1e-3, ..Options::default() };
    let x = [vec![0.17; arm.coordinates()], vec![0.0; arm.coordinates()]].concat();
    (0..30)
        .map(|_| {
            let mut plant = Plant::new(arm.clone(), input.clone());
            let mut integrator = Integrator::new(options, 0.0, &x);
            let start = Instant::now();
            integrator.run(&mut plant, &[1.0], &mut |_, _| (), &mut || false).unwrap();
            start.elapsed().as_nanos() as f64 / integrator.statistics().evaluations as f64
        })
        .fold(f64::INFINITY, f64::min)
}

fn effect(kind: &str, place: &str, parameters: Value) -> Value {
    json!({"kind": kind, "where": place, "parameters": parameters})
}

fn main() {
    let creep = effect("creep", "all", json!({"stiffness": 100.0, "tau": 0.5}));
    let hysteresis = effect("hysteresis", "all", json!({"amplitude": 1.0, "yield": 5e-3}));
    let friction = effect("friction", "all", json!({"coulomb_force": 0.3}));
    let drag = effect("tool_drag", "section 3", json!({"damping": 0.5, "drag": 0.2}));
    let lag = effect("pressure_lag", "all", json!({"fill": 0.1, "vent": 0.2}));
    let quadratic = effect("quadratic_damping", "all", json!({"damping": 10.0}));
    let bending = effect("bending_damping", "all", json!({"damping": 0.01}));
    let payload = effect("payload", "section 3", json!({"mass": 0.1, "x": 0.03}));
    let mut formula = effect("formula", "all", json!({"c": 0.3, "v0": 0.01}));
    formula["force"] = json!("-c * tanh(qd / v0)");
    let wall = effect("contact", "section 3", json!({"stiffness": 500.0, "wall_z": 2.0, "normal_z": -1.0}));
    let cases = [
        ("none", vec![]),
        ("payload", vec![&payload]),
        ("creep", vec![&creep]),
        ("hysteresis", vec![&hysteresis]),
        ("friction", vec![&friction]),
        ("quadratic_damping", vec![&quadratic]),
        ("tool_drag", vec![&drag]),
        ("pressure_lag", vec![&lag]),
        ("formula", vec![&formula]),
        ("creep, friction, lag", vec![&creep, &friction, &lag]),
        ("eight kinds", vec![&creep, &hysteresis, &payload, &quadratic, &bending, &drag, &lag, &wall]),
    ];
    let plain = cost(&json!([]));
    for (name, effects) in cases {
        let ns = cost(&json!(effects));
        println!("{name:24} {ns:8.1} ns per evaluation, {:.2} times none", ns / plain);
    }
}
