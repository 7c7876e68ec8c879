//! Effects without hidden states: against changed arms, Jacobians and closed forms.

use super::*;
use crate::dynamics::recursion::forward_dynamics_into;
use crate::dynamics::terms::inertia_matrix_into;
use crate::kinematics::chain::pass;
use crate::kinematics::coordinates::{arc_from_lengths, force_on_arc};
use crate::kinematics::link::{Link, Motion};
use crate::kinematics::point::{Point, jacobian};
use crate::real::linear::Vec3;
use std::f64::consts::FRAC_PI_2;

fn acceleration(arm: &Arm) -> Vec<f64> {
    let (q, qd) = state();
    let mut out = vec![0.0; 9];
    forward_dynamics_into(arm, &q, &qd, &pressures(), None, &mut Workspace::new(arm), &mut out);
    out
}

/// J^T f of a force at a point fixed in a head's frame, and its velocity.
fn at_point(section: usize, offset: [f64; 3], f: impl Fn(Vec3<f64>, Vec3<f64>) -> Vec3<f64>) -> Vec<f64> {
    let arm = arm(&[]);
    let (q, qd) = state();
    let mut links = vec![Link::base(); 3];
    pass(&arm.body, &q, &[], Motion::Pose, &mut links);
    let point = Point { section, fraction: 1.0, offset: Vec3(offset) };
    let mut columns = vec![[Vec3::zero(); 2]; 9];
    jacobian(&arm.body, &links, &point, &mut columns);
    let position = links[section].position + links[section].rotation.mul_vec(point.offset);
    let velocity = columns.iter().zip(&qd).fold(Vec3::zero(), |v, (c, qd)| v + c[0] * *qd);
    let force = f(position, velocity);
    columns.iter().map(|c| c[0].dot(force)).collect()
}

#[test]
fn payload_adds_a_point_mass() {
    for (section, mass, offset) in [(2, 0.15, [0.03, -0.05, 0.08]), (1, -0.1, [0.02, 0.01, -0.03])] {
        let numbers = [("mass", mass), ("x", offset[0]), ("y", offset[1]), ("z", offset[2])];
        let loaded = arm(&[effect("payload", &format!("section {}", section + 1), &numbers)]);
        let weight = ForceSet { gravity: true, ..ForceSet::NONE };
        let expected: Vec<f64> = force(&arm(&[]), weight)
            .iter()
            .zip(at_point(section, offset, |_, _| Vec3([0.0, 0.0, 9.81 * mass])))
            .map(|(a, b)| a + b)
            .collect();
        assert!(close(&force(&loaded, weight), &expected, 1e-12));
        // M grows by dm J^T J: column by column J^T (dm J e_c).
        let (q, _) = state();
        let (mut with, mut without) = (vec![0.0; 81], vec![0.0; 81]);
        inertia_matrix_into(&loaded, &q, &mut Workspace::new(&loaded), &mut with);
        let plain = arm(&[]);
        inertia_matrix_into(&plain, &q, &mut Workspace::new(&plain), &mut without);
        let mut links = vec![Link::base(); 3];
        pass(&plain.body, &q, &[], Motion::Pose, &mut links);
        let mut columns = vec![[Vec3::zero(); 2]; 9];
        jacobian(&plain.body, &links, &Point { section, fraction: 1.0, offset: Vec3(offset) }, &mut columns);
        for r in 0..9 {
            for c in 0..9 {
                without[9 * r + c] += mass * columns[r][0].dot(columns[c][0]);
            }
        }
        assert!(close(&with, &without, 1e-12));
    }
}

#[test]
fn those_that_change_the_arm_equal_a_changed_arm() {
    let mut changed = parameters(&[]);
    changed.section[1].bellows[2].stiffness.iter_mut().for_each(|k| *k *= 0.7);
    changed.section[2].bending_stiffness[1..].copy_from_slice(&[0.8, -0.1]);
    let (sin, cos) = 0.2_f64.sin_cos();
    changed.gravity = [9.81 * sin, 0.0, 9.81 * cos];
    changed.force_model = ForceModel::EndForce;
    changed.section[0].mass += 0.1;
    changed.section[0].center_of_mass = [0.0; 3];
    let mut with = parameters(&[
        effect("weak_bellows", "bellows 23", &[("change", -0.3)]),
        effect("bending_nonlinear", "section 3", &[("cubic_stiffness", 0.5), ("quintic_stiffness", -0.1)]),
        effect("bending_nonlinear", "all", &[("cubic_stiffness", 0.3)]),
        effect("base_tilt", "all", &[("about_x", 0.0), ("about_y", 0.2)]),
        effect("work_conjugate", "all", &[]),
        effect("payload", "section 1", &[("mass", 0.1)]),
    ]);
    with.section[0].center_of_mass = [0.0; 3];
    changed.section[0].bending_stiffness[1] = 0.3;
    changed.section[1].bending_stiffness[1] = 0.3;
    let (a, b) = (Arm::new(&with).unwrap(), Arm::new(&changed).unwrap());
    assert!(close(&acceleration(&a), &acceleration(&b), 1e-10));
    // A plane of a section, and planes of several effects, add up.
    let stated = |stiffness: [f64; 3], cross: [f64; 3], plane: f64| {
        let mut p = parameters(&[]);
        p.section[1].bending_stiffness = stiffness;
        (p.section[1].cross_bending_stiffness, p.section[1].bending_plane) = (Some(cross), plane);
        p
    };
    let ribs = [
        effect("bending_anisotropy", "section 2", &[("stiffness", 1.3), ("angle", 0.4)]),
        effect("bending_anisotropy", "section 2", &[("stiffness", 0.4), ("angle", 0.4 + FRAC_PI_2)]),
    ];
    let (a, b) = (arm(&ribs), Arm::new(&stated([4.3, 0.0, 0.0], [3.4, 0.0, 0.0], 0.4)).unwrap());
    assert!(close(&acceleration(&a), &acceleration(&b), 1e-10));
    let mut stiff = stated([3.0, 0.2, 0.1], [3.6, 0.5, 0.3], -0.3);
    stiff.effect = ribs[..1].to_vec();
    let bending = ForceSet { bending: true, ..ForceSet::NONE };
    let both: Vec<f64> = force(&Arm::new(&stated([3.0, 0.2, 0.1], [3.6, 0.5, 0.3], -0.3)).unwrap(), bending)
        .iter()
        .zip(force(&arm(&ribs[..1]), bending).iter().zip(force(&arm(&[]), bending)))
        .map(|(a, (b, c))| a + b - c)
        .collect();
    assert!(close(&force(&Arm::new(&stiff).unwrap(), bending), &both, 1e-10));
    // Gravity turned about x, as the base sees it; in the world the base is turned back.
    let tilted = arm(&[effect("base_tilt", "all", &[("about_x", 0.4), ("about_y", 0.0)])]);
    let seen = tilted.body.base.rotation.transposed_mul_vec(tilted.body.gravity);
    assert!(close(&seen.0, &[0.0, -9.81 * 0.4_f64.sin(), 9.81 * 0.4_f64.cos()], 1e-14));
    assert!(close(&tilted.body.base.rotation.column(2).0, &[0.0, 0.4_f64.sin(), 0.4_f64.cos()], 1e-14));
}

#[test]
fn damping_torques_and_coupling_act_on_the_bending() {
    let on_arc = |effects: &[EffectParameters]| -> Vec<[f64; 3]> {
        let arm = arm(effects);
        let f = force(&arm, EFFECTS);
        let three = |i: usize| Vec3([f[3 * i], f[3 * i + 1], f[3 * i + 2]]);
        (0..3).map(|i| force_on_arc(three(i), arm.body.sections[i].bellows_radius).0).collect()
    };
    let plain = arm(&[]);
    let (q, qd) = state();
    let arc = |x: &[f64], i: usize| {
        arc_from_lengths(Vec3([x[3 * i], x[3 * i + 1], x[3 * i + 2]]), plain.body.sections[i].inverse_radius).0
    };
    let found = on_arc(&[effect("bending_damping", "section 2", &[("damping", 0.07)])]);
    let rate = arc(&qd, 1);
    assert!(close(&found.concat(), &[0.0, 0.0, 0.0, -0.07 * rate[0], -0.07 * rate[1], 0.0, 0.0, 0.0, 0.0], 1e-12));
    let found = on_arc(&[effect("section_coupling", "section 2", &[("stiffness", 0.4), ("damping", 0.02)])]);
    let (a, b, da, db) = (arc(&q, 1), arc(&q, 2), arc(&qd, 1), arc(&qd, 2));
    let torque = [0, 1].map(|k| -0.4 * (a[k] - b[k]) - 0.02 * (da[k] - db[k]));
    let expected = [0.0, 0.0, 0.0, torque[0], torque[1], 0.0, -torque[0], -torque[1], 0.0];
    assert!(close(&found.concat(), &expected, 1e-11));
    let found = on_arc(&[effect("preload", "section 2", &[("along", 3.0), ("to_x", 0.2), ("to_y", -0.1)])]);
    assert!(close(&found.concat(), &[0.0, 0.0, 0.0, 0.2, -0.1, 3.0, 0.0, 0.0, 0.0], 1e-12));
}

#[test]
fn forces_along_a_bellows() {
    // With work_conjugate forces and three equal bellows the generalized force is that of the bellows themselves.
    let (q, qd) = state();
    let p = pressures();
    let only = |k: usize, f: f64| (0..9).map(|j| if j == k { f } else { 0.0 }).collect::<Vec<_>>();
    let damped = arm(&[effect("quadratic_damping", "bellows 13", &[("damping", 90.0)])]);
    assert!(close(&force(&damped, EFFECTS), &only(2, -90.0 * qd[2].abs() * qd[2]), 1e-11));
    let by_formula = arm(&[formula("-c * abs(qd) * qd", "bellows 13", &[("c", 90.0)])]);
    assert!(close(&force(&by_formula, EFFECTS), &only(2, -90.0 * qd[2].abs() * qd[2]), 1e-11));
    let odd = arm(&[formula(
        "-1e1 * tanh(qd / v0) + max(q, 0.1) - min(2, 3) * pow(q, 3) / -sqrt(exp(0))",
        "bellows 21",
        &[("v0", 0.2)],
    )]);
    let expected = -10.0 * (qd[3] / 0.2).tanh() + q[3] + 2.0 * q[3].powi(3);
    assert!(close(&force(&odd, EFFECTS), &only(3, expected), 1e-11));
    let area = arm(&[effect("effective_area", "bellows 32", &[("by_pressure", 2e-6), ("by_length", 0.7)])]);
    let actuation = ForceSet { actuation: true, ..ForceSet::NONE };
    let gauge = p[7] - 101_325.0;
    let extra = 0.0015 * (2e-6 * gauge + 0.7 * (q[7] - 0.15)) * gauge;
    let difference: Vec<f64> =
        force(&area, actuation).iter().zip(force(&arm(&[]), actuation)).map(|(a, b)| a - b).collect();
    assert!(close(&difference, &only(7, extra), 1e-9));
    assert!(force(&area, EFFECTS).iter().all(|f| *f == 0.0));
    // A formula that reads the pressure belongs to tau.
    let with_p = arm(&[formula("1e-4 * (p - 101325)", "bellows 32", &[])]);
    assert!(force(&with_p, EFFECTS).iter().all(|f| *f == 0.0));
}

#[test]
fn forces_at_a_head() {
    let drag = effect(
        "tool_drag",
        "section 3",
        &[("stiffness", 30.0), ("damping", 1.5), ("drag", 2.0), ("anchor_x", 0.1), ("anchor_z", 0.4)],
    );
    let expected = at_point(2, [0.0; 3], |r, v| (Vec3([0.1, 0.0, 0.4]) - r) * 30.0 - v * (1.5 + 2.0 * v.dot(v).sqrt()));
    assert!(close(&force(&arm(&[drag]), EFFECTS), &expected, 1e-8));
    // A wall 20 mm into the head, pushing along -z (normal of length 1/2).
    let (q, _) = state();
    let mut links = vec![Link::base(); 3];
    pass(&arm(&[]).body, &q, &[], Motion::Pose, &mut links);
    let height = links[2].position.z();
    // Far inside, where the onset is rounded (before the wall and behind it), and before it.
    for (inside, rounding) in [(0.02, 1e-6), (0.02, 1e-2), (0.02, 0.03), (-0.02, 0.03), (-0.02, 0.02), (-0.02, 1e-6)] {
        let wall = [
            ("stiffness", 500.0),
            ("damping", 3.0),
            ("wall_z", height - inside),
            ("normal_z", -0.5),
            ("rounding", rounding),
        ];
        let found = force(&arm(&[effect("contact", "section 3", &wall)]), EFFECTS);
        let expected = at_point(2, [0.0; 3], |_, v| {
            // The slope of the rounded depth is the cubic step from 0 to 1; the depth its integral, by the midpoint rule.
            let step = |d: f64| {
                let t = (0.5 + 0.5 * d / rounding).clamp(0.0, 1.0);
                t * t * (3.0 - 2.0 * t)
            };
            let (count, from) = (20_000, -rounding.max(inside.abs()));
            let h = (inside - from) / f64::from(count);
            let depth: f64 = (0..count).map(|k| h * step(from + h * (f64::from(k) + 0.5))).sum();
            Vec3([0.0, 0.0, -(500.0 * depth + 3.0 * v.z() * step(inside)).max(0.0)])
        });
        assert!(close(&found, &expected, 1e-7), "{found:?} {expected:?}");
        assert!(inside > -rounding || found.iter().all(|f| *f == 0.0), "felt from afar: {found:?}");
    }
}

#[test]
fn poses_see_twist() {
    let (q, _) = state();
    let positions = |effects: &[EffectParameters]| {
        let arm = arm(effects);
        let mut links = vec![Link::base(); 3];
        pass(&arm.body, &q, &[], Motion::Pose, &mut links);
        let mut out = Vec::new();
        crate::effects::poses::heads(&arm.body, &arm.effects, &links, |head| out.push(head));
        (links, out)
    };
    let (links, plain) = positions(&[effect("torsion", "all", &[("stiffness", 1e6)])]);
    for (link, head) in links.iter().zip(&plain) {
        assert!(close(&head.position.0, &link.position.0, 1e-4));
    }
    // Torsion: the head turns about its own z axis by M_z / k.
    let (links, twisted) = positions(&[effect("torsion", "section 2", &[("stiffness", 20.0)])]);
    let arm = arm(&[]);
    let axis = links[1].rotation.column(2);
    let moment: f64 = (1..3)
        .map(|i| axis.dot((links[i].center - links[1].position).cross(arm.body.gravity * arm.body.sections[i].mass)))
        .sum();
    let (sin, cos) = (moment / 20.0).sin_cos();
    let column = links[1].rotation.column(0) * cos + links[1].rotation.column(1) * sin;
    assert!(close(&twisted[1].rotation.column(0).0, &column.0, 1e-4) && moment.abs() > 1e-3);
    assert!(close(&twisted[1].position.0, &links[1].position.0, 1e-14));
    let reach = links[2].position - links[1].position;
    let turned = links[1].rotation.transposed_mul_vec(reach);
    let turned = links[1].rotation.mul_vec(Vec3([
        cos * turned.x() - sin * turned.y(),
        sin * turned.x() + cos * turned.y(),
        turned.z(),
    ]));
    assert!(close(&(twisted[2].position - twisted[1].position).0, &turned.0, 1e-4));
    // Wound bellows: the head turns with the section's length beyond rest, what it carries with it.
    let (_, wound) = positions(&[effect("torsion", "section 1", &[("twist_per_length", 0.7)])]);
    let rest = arm.body.sections[0].bellows.iter().map(|b| b.rest_length).sum::<f64>() / 3.0;
    let (sin, cos) = (0.7 * (q[..3].iter().sum::<f64>() / 3.0 - rest)).sin_cos();
    let column = links[0].rotation.column(0) * cos + links[0].rotation.column(1) * sin;
    assert!(close(&wound[0].rotation.column(0).0, &column.0, 1e-4) && sin.abs() > 1e-3);
}

/// Curvature that falls along the section, integrated here along the curve: orientations stay, heads move, and what moves
/// with them too.
#[test]
fn taper_bends_the_lower_part_more() {
    let (q, _) = state();
    let taper = arm(&[effect("taper", "section 1", &[("change", 0.4)])]);
    let (mut plain, mut tapered) = (vec![Link::base(); 3], vec![Link::base(); 3]);
    pass(&arm(&[]).body, &q, &[], Motion::Pose, &mut plain);
    pass(&taper.body, &q, &[], Motion::Pose, &mut tapered);
    for (link, head) in plain.iter().zip(&tapered) {
        for k in 0..3 {
            assert!(close(&head.rotation.column(k).0, &link.rotation.column(k).0, 1e-13));
        }
    }
    let [u, v, l] = plain[0].arc.0;
    let psi = u.hypot(v);
    let (mut along, mut across, mut angle, steps) = (0.0, 0.0, 0.0, 20_000);
    for k in 0..steps {
        // The mean of 1 + c (1 - 2 s) over each quarter.
        let bending = 1.0 + 0.4 * [0.75, 0.25, -0.25, -0.75][4 * k / steps];
        let half = 0.5 * bending * psi / steps as f64;
        along += l / steps as f64 * (angle + half).cos();
        across += l / steps as f64 * (angle + half).sin();
        angle += 2.0 * half;
    }
    let (reach, up) = (across + 0.02 * psi.sin(), 0.01 + along + 0.02 * psi.cos());
    assert!((angle - psi).abs() < 1e-12);
    assert!(close(&tapered[0].position.0, &[reach * u / psi, reach * v / psi, up], 1e-8));
    assert!(!close(&acceleration(&taper), &acceleration(&arm(&[])), 1e-3));
}

/// A share of the mass along a straight section weighs a third of what it did against lengthening; its weight stays.
#[test]
fn distributed_mass_weighs_less_where_it_moves_less() {
    let spread = |share: f64| {
        let mut p = parameters(&[effect("distributed_mass", "all", &[("share", share)])]);
        for section in &mut p.section {
            (section.base_offset, section.head_offset, section.center_of_mass) = (0.0, 0.0, [0.0; 3]);
        }
        Arm::new(&p).unwrap()
    };
    let q = [0.2; 9];
    let lengthening = |arm: &Arm| {
        let mut m = vec![0.0; 81];
        crate::dynamics::terms::inertia_matrix_into(arm, &q, &mut Workspace::new(arm), &mut m);
        // All three lengths of section 3 together.
        (6..9).flat_map(|i| (6..9).map(move |j| (i, j))).map(|(i, j)| m[9 * i + j]).sum::<f64>()
    };
    assert!((lengthening(&spread(0.0)) - 0.45).abs() < 1e-14);
    assert!((lengthening(&spread(0.6)) - 0.45 * (0.4 + 0.6 / 3.0)).abs() < 1e-14);
    let weight = |arm: &Arm| {
        let heads: f64 = arm.body.sections.iter().map(|s| s.mass).sum();
        heads + arm.body.sections.iter().flat_map(|s| &s.masses).map(|m| m.mass).sum::<f64>()
    };
    assert!((weight(&spread(0.6)) - 1.8).abs() < 1e-14);
}
