//! Identities of the equations of motion over random arms of 1 to 5 sections.

use super::Workspace;
use super::energy::energy;
use super::recursion::{forward_dynamics_into, inverse_dynamics_into};
use super::statics::static_lengths;
use super::terms::{actuation_matrix_into, coriolis_matrix_into, generalized_force_into, inertia_matrix_into};
use crate::arm::Arm;
use crate::arm::testing::{Seed, arms, states};
use crate::body::Base;
use crate::body::Body;
use crate::body::parameters::ForceModel;
use crate::forces::{External, ForceSet, PointWrench};
use crate::kinematics::chain::pass;
use crate::kinematics::link::{Link, Motion};
use crate::kinematics::point::{Point, pose};
use crate::real::linear::{Mat3, Vec3};
use crate::real::{Dual, Real};
use nalgebra::DMatrix;
use proptest::prelude::*;

fn forces(seed: &Seed, arm: &Arm) -> Vec<Vec3<f64>> {
    seed.numbers(3 * arm.body.sections.len()).chunks(3).map(|f| Vec3([f[0], f[1], f[2]])).collect()
}

fn along(value: &[f64], rate: &[f64]) -> Vec<Dual<1>> {
    value.iter().zip(rate).map(|(&value, &d)| Dual { value, derivative: [d] }).collect()
}

/// The arm with the world's axes as those of its base.
fn standing_at_the_origin(mut arm: Arm) -> Arm {
    arm.body.base = Base { rotation: Mat3::identity(), position: Vec3::zero() };
    arm
}

proptest! {
    #[test]
    fn inertia_matrix_is_symmetric_and_positive(arm in arms(), seed in states()) {
        let (m, q) = (arm.coordinates(), seed.lengths(&arm));
        let mut out = vec![0.0; m * m];
        inertia_matrix_into(&arm, &q, &mut Workspace::new(&arm), &mut out);
        let matrix = DMatrix::from_row_slice(m, m, &out);
        prop_assert!((&matrix - matrix.transpose()).amax() == 0.0);
        prop_assert!(matrix.cholesky().is_some());
    }

    /// T = 1/2 q'^T M q', and x^T (dM/dt - 2 C) x = 0 for every x.
    #[test]
    fn coriolis_matrix_belongs_to_the_inertia_matrix(arm in arms(), seed in states()) {
        let (m, q, qd) = (arm.coordinates(), seed.lengths(&arm), seed.rates(&arm));
        let mut ws = Workspace::new(&arm);
        let mut c = vec![0.0; m * m];
        coriolis_matrix_into(&arm, &q, &qd, &mut ws, &mut c);
        let lifted = arm.lift::<Dual<1>>();
        let mut matrix = vec![Dual::zero(); m * m];
        inertia_matrix_into(&lifted, &along(&q, &qd), &mut Workspace::new(&lifted), &mut matrix);
        let kinetic: f64 = (0..m * m).map(|k| 0.5 * qd[k / m] * matrix[k].value * qd[k % m]).sum();
        prop_assert!((kinetic - energy(&arm, &q, &qd, &mut ws).kinetic()).abs() < 1e-10 * kinetic.abs());
        let scale = c.iter().fold(1e-3_f64, |s, x| s.max(x.abs()));
        for i in 0..m {
            for j in 0..m {
                let skew = matrix[i * m + j].derivative[0] - c[i * m + j] - c[j * m + i];
                prop_assert!(skew.abs() < 1e-10 * scale, "{i} {j}: {skew}");
            }
        }
    }

    #[test]
    fn inverse_dynamics_undoes_forward_dynamics(arm in arms(), seed in states()) {
        let (m, q, qd, p) = (arm.coordinates(), seed.lengths(&arm), seed.rates(&arm), seed.pressures(&arm));
        let f = forces(&seed, &arm);
        for reduced in [false, true] {
            let body = Body { rotational_energy: !reduced, coriolis_forces: !reduced, ..arm.body.clone() };
            let arm = Arm { body, ..arm.clone() };
            let mut ws = Workspace::new(&arm);
            let (mut qdd, mut tau, mut expected) = (vec![0.0; m], vec![0.0; m], vec![0.0; m]);
            forward_dynamics_into(&arm, &q, &qd, &p, Some(External::of_forces(&f)), &mut ws, &mut qdd);
            inverse_dynamics_into(&arm, &q, &qd, &qdd, Some(External::of_forces(&f)), &mut ws, &mut tau);
            let set = ForceSet { actuation: true, ..ForceSet::NONE };
            generalized_force_into(&arm, set, (&q, &qd), &p, None, &mut ws, &mut expected);
            let scale = expected.iter().fold(1.0_f64, |s, x| s.max(x.abs()));
            for k in 0..m {
                prop_assert!((tau[k] - expected[k]).abs() < 1e-8 * scale);
            }
        }
    }

    /// M q'' + C q' + N = tau from the separate terms.
    #[test]
    fn terms_add_up_to_forward_dynamics(arm in arms(), seed in states()) {
        let (m, q, qd, p) = (arm.coordinates(), seed.lengths(&arm), seed.rates(&arm), seed.pressures(&arm));
        let f = forces(&seed, &arm);
        let mut ws = Workspace::new(&arm);
        let mut qdd = vec![0.0; m];
        forward_dynamics_into(&arm, &q, &qd, &p, Some(External::of_forces(&f)), &mut ws, &mut qdd);
        let (mut inertia, mut coriolis, mut total) = (vec![0.0; m * m], vec![0.0; m * m], vec![0.0; m]);
        inertia_matrix_into(&arm, &q, &mut ws, &mut inertia);
        coriolis_matrix_into(&arm, &q, &qd, &mut ws, &mut coriolis);
        generalized_force_into(&arm, ForceSet::ALL, (&q, &qd), &p, Some(External::of_forces(&f)), &mut ws, &mut total);
        let scale = total.iter().fold(1.0_f64, |s, x| s.max(x.abs()));
        for i in 0..m {
            let left: f64 = (0..m).map(|j| inertia[i * m + j] * qdd[j] + coriolis[i * m + j] * qd[j]).sum();
            prop_assert!((left - total[i]).abs() < 1e-8 * scale);
        }
    }

    /// tau is linear in p: A(q) (p - p_amb).
    #[test]
    fn actuation_matrix_is_d_tau_dp(arm in arms(), seed in states()) {
        let (m, q, p) = (arm.coordinates(), seed.lengths(&arm), seed.pressures(&arm));
        let mut ws = Workspace::new(&arm);
        let mut matrix = vec![0.0; m * arm.body.inputs];
        actuation_matrix_into(&arm, &q, &mut ws, &mut matrix);
        let mut tau = vec![0.0; m];
        let set = ForceSet { actuation: true, ..ForceSet::NONE };
        generalized_force_into(&arm, set, (&q, &[]), &p, None, &mut ws, &mut tau);
        for i in 0..m {
            let row = &matrix[i * arm.body.inputs..][..arm.body.inputs];
            let product: f64 = row.iter().zip(&p).map(|(a, p)| a * (p - arm.body.ambient_pressure)).sum();
            prop_assert!((product - tau[i]).abs() < 1e-9 * (1.0 + tau[i].abs()));
        }
    }

    /// With work_conjugate: dE/dt = pressure power + external power - dissipation.
    #[test]
    fn power_balances(arm in arms(), seed in states()) {
        let mut arm = arm;
        arm.body.force_model = ForceModel::WorkConjugate;
        let (m, q, qd, p) = (arm.coordinates(), seed.lengths(&arm), seed.rates(&arm), seed.pressures(&arm));
        let f = forces(&seed, &arm);
        let mut ws = Workspace::new(&arm);
        let mut qdd = vec![0.0; m];
        forward_dynamics_into(&arm, &q, &qd, &p, Some(External::of_forces(&f)), &mut ws, &mut qdd);
        let lifted = arm.lift::<Dual<1>>();
        let e = energy(&lifted, &along(&q, &qd), &along(&qd, &qdd), &mut Workspace::new(&lifted));
        let mut power = 0.0;
        let mut force = vec![0.0; m];
        for set in [
            ForceSet { actuation: true, ..ForceSet::NONE },
            ForceSet { damping: true, ..ForceSet::NONE },
            ForceSet { external: true, ..ForceSet::NONE },
        ] {
            generalized_force_into(&arm, set, (&q, &qd), &p, Some(External::of_forces(&f)), &mut ws, &mut force);
            power += force.iter().zip(&qd).map(|(f, v)| f * v).sum::<f64>();
        }
        let scale: f64 = 1.0 + power.abs() + e.kinetic().derivative[0].abs();
        prop_assert!((e.total().derivative[0] - power).abs() < 1e-9 * scale, "{} {power}", e.total().derivative[0]);
    }

    /// The potential's gradient is minus the generalized force of the conservative forces (work_conjugate).
    #[test]
    fn conservative_forces_have_a_potential(arm in arms(), seed in states(), j in 0..15_usize) {
        let mut arm = arm;
        arm.body.force_model = ForceModel::WorkConjugate;
        let (m, q) = (arm.coordinates(), seed.lengths(&arm));
        let j = j % m;
        let set = ForceSet { gravity: true, bending: true, spring: true, axial: true, ..ForceSet::NONE };
        let mut force = vec![0.0; m];
        generalized_force_into(&arm, set, (&q, &[]), &[], None, &mut Workspace::new(&arm), &mut force);
        let lifted = arm.lift::<Dual<1>>();
        let dual: Vec<_> = q.iter().enumerate().map(|(k, &x)| Dual::variable(x, usize::from(k != j))).collect();
        let e = energy(&lifted, &dual, &vec![Dual::zero(); m], &mut Workspace::new(&lifted));
        prop_assert!((e.potential().derivative[0] + force[j]).abs() < 1e-9 * (1.0 + force[j].abs()));
    }

    /// The generalized force of a wrench is the power of its force and moment, from the pose of its point alone.
    #[test]
    fn wrenches_do_virtual_work(arm in arms(), seed in states(), which in 0..5_usize, fraction in 0.0..1.5_f64) {
        let (m, q) = (arm.coordinates(), seed.lengths(&arm));
        let x = seed.numbers(9);
        let three = |k: usize| Vec3([x[k], x[k + 1], x[k + 2]]);
        // A third of them at heads.
        let point = Point { section: which % arm.body.sections.len(), fraction: fraction.min(1.0), offset: three(0) * 0.05 };
        let wrench = PointWrench { point, force: three(3), moment: three(6) };
        let outside = External { forces: &[], wrenches: &[wrench] };
        let set = ForceSet { external: true, ..ForceSet::NONE };
        let mut force = vec![0.0; m];
        generalized_force_into(&arm, set, (&q, &[]), &[], Some(outside), &mut Workspace::new(&arm), &mut force);
        let lifted = arm.lift::<Dual<1>>();
        for j in 0..m {
            let dual: Vec<_> = q.iter().enumerate().map(|(k, &x)| Dual::variable(x, usize::from(k != j))).collect();
            let mut links = vec![Link::base(); arm.body.sections.len()];
            pass(&lifted.body, &dual, &[], Motion::Pose, &mut links);
            let (rotation, position) = pose(&lifted.body, &links, &PointWrench::lifted(&wrench).point);
            let velocity = Vec3(position.0.map(|x| x.derivative[0]));
            // [w]x = R' R^T, (24).
            let spin = |a: usize, b: usize| -> f64 {
                (0..3).map(|c| rotation.0[a][c].derivative[0] * rotation.0[b][c].value).sum()
            };
            let turn = Vec3([spin(2, 1), spin(0, 2), spin(1, 0)]);
            let expected = wrench.force.dot(velocity) + wrench.moment.dot(turn);
            prop_assert!((force[j] - expected).abs() < 1e-11 * (1.0 + expected.abs()), "{j}: {} {expected}", force[j]);
        }
    }

    /// Turning the whole arm about z by 120 degrees permutes the bellows.
    #[test]
    fn turning_permutes_the_bellows(arm in arms(), seed in states()) {
        let mut arm = standing_at_the_origin(arm);
        for s in &mut arm.body.sections {
            s.inertia.0[1] = s.inertia.0[0];
            for mass in &mut s.masses {
                mass.inertia.0[1] = mass.inertia.0[0];
            }
        }
        let (m, q, qd, p) = (arm.coordinates(), seed.lengths(&arm), seed.rates(&arm), seed.pressures(&arm));
        let mut turned = arm.clone();
        let (c, s) = (-0.5, 0.75_f64.sqrt());
        let turn = |v: Vec3<f64>| Vec3([c * v.x() - s * v.y(), s * v.x() + c * v.y(), v.z()]);
        turned.body.gravity = turn(arm.body.gravity);
        for (section, original) in turned.body.sections.iter_mut().zip(&arm.body.sections) {
            section.center_of_mass = turn(original.center_of_mass);
            section.force_point = turn(original.force_point);
            for (mass, original) in section.masses.iter_mut().zip(&original.masses) {
                mass.offset = turn(original.offset);
            }
            if let Some(planes) = &mut section.bending_planes {
                // Twice the angle.
                let turn = |[x, y]: [f64; 2]| [c * x + s * y, c * y - s * x];
                for of_power in [&mut planes.linear, &mut planes.cubic, &mut planes.quintic] {
                    *of_power = turn(*of_power);
                }
            }
        }
        let shift = |x: &[f64]| x.chunks(3).flat_map(|c| [c[2], c[0], c[1]]).collect::<Vec<_>>();
        let (mut qdd, mut again) = (vec![0.0; m], vec![0.0; m]);
        forward_dynamics_into(&arm, &q, &qd, &p, None, &mut Workspace::new(&arm), &mut qdd);
        forward_dynamics_into(&turned, &shift(&q), &shift(&qd), &shift(&p), None, &mut Workspace::new(&arm), &mut again);
        let scale = qdd.iter().fold(1.0_f64, |s, x| s.max(x.abs()));
        for (a, b) in shift(&qdd).iter().zip(&again) {
            prop_assert!((a - b).abs() < 1e-9 * scale);
        }
    }

    /// Motion that starts in the x-z plane of a symmetric arm stays there: lengths 2 and 3 accelerate alike.
    #[test]
    fn planar_motion_stays_planar(arm in arms(), seed in states()) {
        let mut arm = standing_at_the_origin(arm);
        arm.body.gravity.0[1] = 0.0;
        for s in &mut arm.body.sections {
            s.center_of_mass.0[1] = 0.0;
            s.force_point.0[1] = 0.0;
            for mass in &mut s.masses {
                mass.offset.0[1] = 0.0;
            }
            if let Some(planes) = &mut s.bending_planes {
                (planes.linear[1], planes.cubic[1], planes.quintic[1]) = (0.0, 0.0, 0.0);
            }
        }
        let mirror = |x: Vec<f64>| x.chunks(3).flat_map(|c| [c[0], c[1], c[1]]).collect::<Vec<_>>();
        let (q, qd, p) = (mirror(seed.lengths(&arm)), mirror(seed.rates(&arm)), mirror(seed.pressures(&arm)));
        let mut qdd = vec![0.0; arm.coordinates()];
        forward_dynamics_into(&arm, &q, &qd, &p, None, &mut Workspace::new(&arm), &mut qdd);
        let scale = qdd.iter().fold(1.0_f64, |s, x| s.max(x.abs()));
        for c in qdd.chunks(3) {
            prop_assert!((c[1] - c[2]).abs() < 1e-9 * scale);
        }
    }

    /// Derivatives of q'' against central differences, through the straight pose.
    #[test]
    fn forward_dynamics_is_smooth_through_the_straight_pose(arm in arms(), seed in states(), j in 0..15_usize) {
        let m = arm.coordinates();
        let q = vec![0.2; m];
        let (qd, p, j) = (seed.rates(&arm), seed.pressures(&arm), j % m);
        let mut ws = Workspace::new(&arm);
        let mut at = |x: f64| {
            let mut q = q.clone();
            q[j] += x;
            let mut qdd = vec![0.0; m];
            forward_dynamics_into(&arm, &q, &qd, &p, None, &mut ws, &mut qdd);
            qdd
        };
        let h = 1e-5;
        let (plus, minus) = (at(h), at(-h));
        let lifted = arm.lift::<Dual<1>>();
        let dual: Vec<_> = q.iter().enumerate().map(|(k, &x)| Dual::<1>::variable(x, usize::from(k != j))).collect();
        let constant = |x: &[f64]| x.iter().map(|&v| Dual::from_f64(v)).collect::<Vec<_>>();
        let mut qdd = vec![Dual::zero(); m];
        forward_dynamics_into(&lifted, &dual, &constant(&qd), &constant(&p), None, &mut Workspace::new(&lifted), &mut qdd);
        let scale = qdd.iter().fold(1.0_f64, |s, x| s.max(x.derivative[0].abs()));
        for k in 0..m {
            let difference = (plus[k] - minus[k]) / (2.0 * h);
            prop_assert!((difference - qdd[k].derivative[0]).abs() < 1e-5 * scale);
        }
    }

    /// Where statics finds a rest, nothing accelerates there.
    #[test]
    fn rest_is_at_rest(arm in arms(), seed in states()) {
        let m = arm.coordinates();
        let p: Vec<f64> = seed.pressures(&arm).iter().map(|p| 1.1e5 + 0.2 * (p - 1.1e5)).collect();
        if let Ok(q) = static_lengths(&arm, &p, None, None) {
            let mut force = vec![0.0; m];
            let set = ForceSet::ALL;
            generalized_force_into(&arm, set, (&q, &vec![0.0; m]), &p, None, &mut Workspace::new(&arm), &mut force);
            prop_assert!(force.iter().all(|f| f.abs() < 1e-6), "{force:?}");
        }
    }
}
