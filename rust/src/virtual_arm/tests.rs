//! The virtual arm against the lumped model, against itself, and against what can be said in closed form.

use super::arc::ArcPoint;
use super::equations::Actions;
use super::{Creep, Distributed, State, VirtualArm};
use crate::arm::Arm;
use crate::arm::testing::{plain_arm_parameters, states};
use crate::body::parameters::{ArmParameters, BaseParameters, ForceModel, PointMassParameters};
use crate::dynamics::Workspace;
use crate::dynamics::recursion::forward_dynamics_into;
use crate::forces::External;
use crate::plant::input::{Input, Interpolation};
use crate::real::linear::Vec3;
use nalgebra::Vector3;
use proptest::prelude::*;

const NONE: Distributed = Distributed { slices: 0, mass: 0.0, inertia: [0.0; 3] };
const SLICES: Distributed = Distributed { slices: 8, mass: 0.4, inertia: [1e-3, 1e-3, 2e-3] };

fn constant(pressures: Vec<f64>, end: f64) -> Input {
    let inputs = pressures.len();
    let both = [pressures.clone(), pressures].concat();
    Input::new(vec![0.0, end], (both, inputs), (Vec::new(), 0), Interpolation::Linear).unwrap()
}

fn undamped(mut parameters: ArmParameters) -> ArmParameters {
    parameters.force_model = ForceModel::WorkConjugate;
    for section in &mut parameters.section {
        section.bellows.iter_mut().for_each(|b| b.damping = 0.0);
    }
    parameters
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Without creep: the lumped model, which goes by recursion and shares none of this code, with all mass at the heads or
    /// with masses at the places of the slices.
    #[test]
    fn without_creep_it_is_the_lumped_model(parameters in plain_arm_parameters(), seed in states(), slices in any::<bool>()) {
        let spread = if slices { SLICES } else { NONE };
        let mut masses = parameters.clone();
        for section in &mut masses.section {
            section.masses = (0..spread.slices)
                .map(|j| PointMassParameters {
                    share: (j as f64 + 0.5) / 8.0,
                    mass: SLICES.mass / 8.0,
                    inertia: SLICES.inertia.map(|x| x / 8.0),
                    offset: [0.0; 3],
                })
                .collect();
        }
        let arm = Arm::new(&masses).unwrap();
        let n = arm.coordinates();
        let twin = VirtualArm::new(&parameters, &vec![spread; n / 3], &[]).unwrap();
        let (q, qd, p) = (seed.lengths(&arm), seed.rates(&arm), seed.pressures(&arm));
        let forces: Vec<_> = (0..n / 3).map(|i| [3.0 * i as f64 - 4.0, 2.0, -1.5]).collect();
        let lumped_forces: Vec<_> = forces.iter().map(|f| Vec3(*f)).collect();
        let mut lumped = vec![0.0; n];
        forward_dynamics_into(&arm, &q, &qd, &p, Some(External::of_forces(&lumped_forces)), &mut Workspace::new(&arm), &mut lumped);

        let external: Vec<_> = forces.iter().map(|f| Vector3::from(*f)).collect();
        let equations =
            twin.equations(&twin.arcs(&q), &twin.arcs(&qd), &[], Actions { pressures: &p, external: &external });
        let acceleration = equations.inertia.cholesky().unwrap().solve(&equations.force);
        let scale = lumped.iter().fold(1.0_f64, |m, x| m.max(x.abs()));
        for (a, b) in twin.lengths(acceleration.as_slice()).iter().zip(&lumped) {
            prop_assert!((a - b).abs() < 1e-9 * scale, "{a} {b}");
        }
    }

    /// Velocities, accelerations and partial derivatives of a point of an arc against differences.
    #[test]
    fn a_point_of_an_arc_moves_as_it_says(arc in (-2.0..2.0_f64, -2.0..2.0_f64, 0.1..0.3_f64), rate in prop::array::uniform3(-1.0..1.0_f64), fraction in 0.1..1.0_f64) {
        let arc = [arc.0, arc.1, arc.2];
        let h = 1e-4;
        let at = |t: f64| ArcPoint::new([0, 1, 2].map(|k| arc[k] + t * rate[k]), rate, fraction);
        let (now, after, before) = (at(0.0), at(h), at(-h));
        prop_assert!(((after.position - before.position) / (2.0 * h) - now.velocity).norm() < 1e-7);
        prop_assert!(((after.velocity - before.velocity) / (2.0 * h) - now.bias).norm() < 1e-6);
        let turning = (after.rotation - before.rotation) / (2.0 * h) * now.rotation.transpose();
        prop_assert!((turning - now.angular_velocity.cross_matrix()).norm() < 1e-7);
        let spin = (after.angular_velocity - before.angular_velocity) / (2.0 * h);
        prop_assert!((spin - now.angular_bias).norm() < 1e-7);
        let sum = |columns: &[Vector3<f64>; 3]| columns[0] * rate[0] + columns[1] * rate[1] + columns[2] * rate[2];
        prop_assert!((sum(&now.linear) - now.velocity).norm() < 1e-12);
        prop_assert!((sum(&now.angular) - now.angular_velocity).norm() < 1e-12);
    }
}

/// A straight section that only lengthens: slices at (j + 1/2) / S of the way weigh m sum ((j + 1/2) / S)^2 / S.
#[test]
fn spread_mass_counts_a_third() {
    let parameters = crate::arm::testing::fixed_parameters(1);
    let bare = VirtualArm::new(&parameters, &[NONE], &[]).unwrap();
    let full = VirtualArm::new(&parameters, &[SLICES], &[]).unwrap();
    let still = Actions { pressures: &[0.0; 3], external: &[] };
    let at = |arm: &VirtualArm| arm.equations(&[0.0, 0.0, 0.2], &[0.0; 3], &[], still).inertia[(2, 2)];
    let expected = 0.4 * (1.0 / 3.0 - 1.0 / (12.0 * 64.0));
    assert!((at(&full) - at(&bare) - expected).abs() < 1e-14);
}

/// Without damping and creep, energy is kept although everything moves fast: Coriolis forces of all slices are right.
#[test]
fn energy_is_kept_without_damping() {
    let parameters = undamped(crate::arm::testing::fixed_parameters(3));
    let arm = VirtualArm::new(&parameters, &[SLICES; 3], &[]).unwrap();
    let lengths = vec![0.14, 0.2, 0.22, 0.2, 0.15, 0.17, 0.12, 0.2, 0.16];
    let start = State { lengths, velocities: vec![0.1; 9], creep: Vec::new() };
    let times: Vec<f64> = (0..=20).map(|k| 0.05 * f64::from(k)).collect();
    let input = constant(vec![parameters.ambient_pressure; 9], 1.0);
    let rows = arm.run(&input, &times, &start, 2.5e-4, &mut || false).unwrap();
    let energies: Vec<[f64; 2]> = (0..times.len())
        .map(|k| arm.energy(&rows.lengths[9 * k..9 * k + 9], &rows.velocities[9 * k..9 * k + 9], &[]))
        .collect();
    let most = energies.iter().map(|e| e[0]).fold(0.0, f64::max);
    assert!(most > 0.5, "the arm must move; its kinetic energy stays below {most} J");
    for [kinetic, potential] in &energies {
        let change = kinetic + potential - energies[0][0] - energies[0][1];
        assert!(change.abs() < 1e-6 * most, "{change} of {most}");
    }
}

/// Creep relaxes with its time constant, takes energy only, and leaves the rest where it was.
#[test]
fn creep_relaxes() {
    let mut parameters = crate::arm::testing::fixed_parameters(1);
    parameters.gravity = [0.0; 3];
    let creep = [Creep { share: 0.3, time_constant: 0.5 }];
    let arm = VirtualArm::new(&parameters, &[SLICES], &creep).unwrap();
    let p = vec![1.4e5; 3];
    let rest = arm.rest(&p, &[]).unwrap();
    assert!(rest.lengths[0] - parameters.section[0].bellows[0].rest_length > 0.01);

    // Held at constant pressure from a state with strained branches: the length returns slowly, with a time constant
    // between tau and tau (1 + share) for a spring that hardens, and a little more for the damping beside it.
    let start = State { creep: vec![0.02; 3], ..rest.clone() };
    let times = [0.0, 1.0, 1.5, 2.0, 12.0];
    let rows = arm.run(&constant(p, 12.0), &times, &start, 5e-4, &mut || false).unwrap();
    let left = |k: usize| rows.lengths[3 * k] - rest.lengths[0];
    let rate = (left(1) / left(3)).ln();
    assert!(left(1) < -1e-4, "the branches pull the section together: {}", left(1));
    assert!((1.0 / 0.7..1.0 / 0.5).contains(&rate), "decays with {rate} 1/s");
    assert!(left(4).abs() < 1e-9);
}

#[test]
fn what_is_wrong_is_named() {
    let parameters = crate::arm::testing::fixed_parameters(2);
    let text = |d: &[Distributed], c: &[Creep]| VirtualArm::new(&parameters, d, c).unwrap_err().to_string();
    assert!(text(&[NONE], &[]).contains("one for each of the 2 sections"));
    assert!(text(&[NONE, Distributed { slices: 0, ..SLICES }], &[]).contains("section 2"));
    assert!(text(&[NONE; 2], &[Creep { share: 0.1, time_constant: 0.0 }]).contains("positive time"));
    let reduced = ArmParameters { coriolis_forces: false, ..parameters.clone() };
    assert!(VirtualArm::new(&reduced, &[NONE; 2], &[]).is_err());
    let base = Some(BaseParameters { position: [0.0; 3], rotation: [0.1, 0.0, 0.0] });
    let moved = ArmParameters { base, ..parameters.clone() };
    assert!(VirtualArm::new(&moved, &[NONE; 2], &[]).unwrap_err().to_string().contains("world's origin"));

    let arm = VirtualArm::new(&parameters, &[NONE; 2], &[]).unwrap();
    let start = State { lengths: vec![0.15; 6], velocities: vec![0.0; 6], creep: Vec::new() };
    let input = constant(vec![1.2e5; 6], 1.0);
    assert_eq!(arm.run(&input, &[0.0, 1.0], &start, 1e-3, &mut || true).unwrap_err(), crate::error::Error::Interrupted);
    let folded = State { lengths: vec![-0.15; 6], ..start };
    let failure = arm.run(&input, &[0.0, 1.0], &folded, 1e-3, &mut || false).unwrap_err();
    assert!(failure.to_string().contains("section 1 of the virtual arm"));
}
