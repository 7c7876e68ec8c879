//! The core against `tests/data/oracle_cases.json.gz`: values by automatic differentiation of T, U and the virtual work alone,
//! computed independently of this package (70 states of five arms, straight and nearly straight ones among them).

use bha_core::arm::Arm;
use bha_core::body::parameters::{ArmParameters, ForceModel};
use bha_core::dynamics::Workspace;
use bha_core::dynamics::energy::energy;
use bha_core::dynamics::recursion::{forward_dynamics_into, inverse_dynamics_into};
use bha_core::dynamics::terms::{coriolis_matrix_into, generalized_force_into, inertia_matrix_into};
use bha_core::forces::{External, ForceSet};
use bha_core::real::linear::{Mat3, Vec3};
use serde::Deserialize;
use std::collections::HashMap;

#[derive(Deserialize)]
struct Oracle {
    core_parameters: HashMap<String, ArmParameters>,
    cases: Vec<Case>,
}

type PerModel = HashMap<ForceModel, Vec<f64>>;

#[derive(Deserialize)]
struct Case {
    arm: String,
    q: Vec<f64>,
    qd: Vec<f64>,
    p: Vec<f64>,
    f_ext: Vec<[f64; 3]>,
    #[serde(rename = "M")]
    inertia_matrix: Vec<Vec<f64>>,
    #[serde(rename = "M_translational")]
    translational_inertia_matrix: Vec<Vec<f64>>,
    #[serde(rename = "C_qd")]
    coriolis_force: Vec<f64>,
    #[serde(rename = "N")]
    bias_force: PerModel,
    tau: PerModel,
    qdd: PerModel,
    qdd_reduced: PerModel,
    kinetic_translational: f64,
    kinetic_rotational: f64,
    energy: f64,
    head_positions: Vec<[f64; 3]>,
    head_rotations: Vec<[[f64; 3]; 3]>,
}

/// Relative to the largest expected value.
fn assert_close(found: &[f64], expected: &[f64], what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let scale = expected.iter().fold(1e-12_f64, |m, x| m.max(x.abs()));
    for (k, (f, e)) in found.iter().zip(expected).enumerate() {
        assert!((f - e).abs() <= 1e-9 * scale, "{what}[{k}]: {f} instead of {e} (scale {scale})");
    }
}

#[test]
fn all_cases() {
    let packed = include_bytes!("data/oracle_cases.json.gz").as_slice();
    let oracle: Oracle = serde_json::from_reader(flate2::read::GzDecoder::new(packed)).unwrap();
    assert_eq!(oracle.cases.len(), 70);
    for (number, case) in oracle.cases.iter().enumerate() {
        for model in [ForceModel::EndForce, ForceModel::WorkConjugate] {
            let mut parameters = oracle.core_parameters[&case.arm].clone();
            parameters.force_model = model;
            check(&format!("case {number} {model:?}"), &parameters, model, case);
        }
    }
}

fn check(name: &str, parameters: &ArmParameters, model: ForceModel, case: &Case) {
    let arm = Arm::new(parameters).unwrap();
    let (n, m) = (arm.body.sections.len(), arm.coordinates());
    let mut ws = Workspace::new(&arm);
    let (q, qd, p) = (&case.q, &case.qd, &case.p);

    let e = energy(&arm, q, qd, &mut ws);
    for (i, link) in ws.links.iter().enumerate() {
        assert_close(&link.position.0, &case.head_positions[i], &format!("{name} head {i}"));
        for r in 0..3 {
            assert_close(&link.rotation.0[r], &case.head_rotations[i][r], &format!("{name} rotation {i} {r}"));
        }
    }
    // The oracle gives external forces in the head frames.
    let f_ext: Vec<_> = (0..n).map(|i| Mat3::mul_vec(&ws.links[i].rotation, Vec3(case.f_ext[i]))).collect();
    assert_close(&[e.translational, e.rotational], &[case.kinetic_translational, case.kinetic_rotational], name);
    assert_close(&[e.total()], &[case.energy], &format!("{name} energy"));

    let mut matrix = vec![0.0; m * m];
    inertia_matrix_into(&arm, q, &mut ws, &mut matrix);
    assert_close(&matrix, &case.inertia_matrix.concat(), &format!("{name} M"));
    coriolis_matrix_into(&arm, q, qd, &mut ws, &mut matrix);
    let coriolis: Vec<f64> = matrix.chunks(m).map(|row| row.iter().zip(qd).map(|(a, b)| a * b).sum()).collect();
    assert_close(&coriolis, &case.coriolis_force, &format!("{name} C qd"));

    let mut out = vec![0.0; m];
    let actuation = ForceSet { actuation: true, ..ForceSet::NONE };
    generalized_force_into(&arm, actuation, (q, qd), p, None, &mut ws, &mut out);
    assert_close(&out, &case.tau[&model], &format!("{name} tau"));
    generalized_force_into(&arm, ForceSet::PASSIVE, (q, qd), p, Some(External::of_forces(&f_ext)), &mut ws, &mut out);
    out.iter_mut().for_each(|x| *x = -*x);
    assert_close(&out, &case.bias_force[&model], &format!("{name} N"));

    forward_dynamics_into(&arm, q, qd, p, Some(External::of_forces(&f_ext)), &mut ws, &mut out);
    assert_close(&out, &case.qdd[&model], &format!("{name} qdd"));
    let qdd = out.clone();
    inverse_dynamics_into(&arm, q, qd, &qdd, Some(External::of_forces(&f_ext)), &mut ws, &mut out);
    assert_close(&out, &case.tau[&model], &format!("{name} inverse dynamics"));

    let reduced = Arm::new(&ArmParameters { rotational_energy: false, coriolis_forces: false, ..parameters.clone() });
    let reduced = reduced.unwrap();
    inertia_matrix_into(&reduced, q, &mut ws, &mut matrix);
    assert_close(&matrix, &case.translational_inertia_matrix.concat(), &format!("{name} M translational"));
    if let Some(expected) = case.qdd_reduced.get(&model) {
        forward_dynamics_into(&reduced, q, qd, p, Some(External::of_forces(&f_ext)), &mut ws, &mut out);
        assert_close(&out, expected, &format!("{name} reduced qdd"));
    }
}
