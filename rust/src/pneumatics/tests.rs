//! Stability, accuracy and conservation of the sub-steps, alone and with the arm.

use super::chamber::Volume;
use super::lag::lagged;
use super::substep::{Drive, Input};
use super::testing::{nominal, parameters};
use super::*;
use crate::arm::Arm;
use crate::arm::testing::{arms, states};
use crate::body::parameters::PneumaticsLevel;
use crate::integrate::{Method, Options};
use crate::plant::input::{Input as Samples, Interpolation};
use crate::real::linear::Vec3;
use crate::run::simulation::Simulation;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;
use std::sync::Arc;

/// One sub-step of the nominal input from a state alone.
fn substep(k: &Pneumatics<f64>, x: Input<f64>, drive: &Drive<f64>, t: f64, h: f64) -> Input<f64> {
    let p = chamber::pressure(k, x.content, &drive.volume_at(t));
    super::substep::substep(k, k.control_volume[0], (x, p), drive, (t, h)).0
}

const STAIRS: [f64; 4] = [1.2e5, 2.1e5, 0.75e5, 1.0e5];

/// One input at constant volume through a staircase of references, with periods of 1 ms and the given sub-step.
fn staircase(k: &Pneumatics<f64>, h: f64, volume: impl Fn(f64) -> (f64, f64)) -> Vec<f64> {
    let mut x = Input { content: chamber::mass(k, 1.2e5, &Volume::rigid(volume(0.0).0)), spool: 0.0, integral: 0.0 };
    let count = (1e-3 / h).round() as usize;
    let mut out = Vec::new();
    for ms in 0..1200 {
        let reference = STAIRS[ms / 300];
        let t0 = ms as f64 * 1e-3;
        let (volume, volume_rate) = volume(t0);
        let (volume, volume_rate) = (Volume::rigid(volume), Volume::rigid(volume_rate));
        let drive = Drive { reference, reference_rate: 0.0, volume, volume_rate };
        for j in 0..count {
            x = substep(k, x, &drive, j as f64 * h, h);
        }
        out.push(chamber::pressure(k, x.content, &drive.volume_at(1e-3)));
    }
    out
}

fn moving(t: f64) -> (f64, f64) {
    (5e-4 + 5e-5 * (20.0 * t).sin(), 1e-3 * (20.0 * t).cos())
}

#[test]
fn accurate_at_one_millisecond_against_tiny_steps() {
    let k = nominal();
    let (coarse, fine) = (staircase(&k, SUBSTEP, moving), staircase(&k, 1e-6, moving));
    for (ms, (a, b)) in coarse.iter().zip(&fine).enumerate() {
        // 1e-3 of the range of pressures, worst within the steps; the end of each stair to 10 Pa.
        assert!((a - b).abs() < 150.0, "{ms} ms: {a} {b}");
        if ms % 300 == 299 {
            assert!((a - b).abs() < 10.0, "{ms} ms: {a} {b}");
        }
    }
    // It goes where it is told, and not beyond by much.
    let still = staircase(&k, SUBSTEP, |_| (5e-4, 0.0));
    for ms in (299..1200).step_by(300) {
        assert!((still[ms] - STAIRS[ms / 300]).abs() < 100.0, "{ms} ms: {}", still[ms]);
    }
}

#[test]
fn stable_for_pneumatics_far_stiffer_than_the_step() {
    let mut k = nominal();
    k.supply_flow *= 30.0;
    k.exhaust_flow *= 30.0;
    k.spool_rate = 5e4;
    (k.dead_band, k.inverse_travel) = (0.0, 1.0);
    k.integral_gain = 0.0;
    let out = staircase(&k, 1e-3, |_| (1e-4, 0.0));
    for (ms, p) in out.iter().enumerate() {
        assert!(*p > 0.3e5 && *p < 3.1e5, "{ms} ms: {p}");
        if ms % 300 > 200 {
            assert!((p - STAIRS[ms / 300]).abs() < 100.0, "{ms} ms: {p}");
        }
    }
}

#[test]
fn second_order_in_the_substep() {
    let mut k = nominal();
    // Smooth pieces only: no dead band, one stair that fills without reaching a limit of the opening.
    (k.dead_band, k.inverse_travel) = (0.0, 1.0);
    k.proportional_gain = 5.0;
    k.integral_gain = 5.0;
    let run = |h: f64| {
        let mut x = Input { content: chamber::mass(&k, 1.2e5, &Volume::rigid(5e-4)), spool: 0.1, integral: 0.0 };
        let drive = Drive {
            reference: 1.6e5,
            reference_rate: 2e5,
            volume: Volume::rigid(5e-4),
            volume_rate: Volume::rigid(1e-3),
        };
        for j in 0..(0.02 / h).round() as usize {
            x = substep(&k, x, &drive, j as f64 * h, h);
        }
        x.content
    };
    let exact = run(1e-6);
    let errors = [1e-3, 5e-4, 2.5e-4, 1.25e-4].map(|h| (run(h) - exact).abs());
    assert!(errors[2] / errors[3] > 3.2 && errors[2] / errors[3] < 5.0, "{errors:?}");
}

fn plant(level: PneumaticsLevel) -> Arc<Arm> {
    let mut runner = TestRunner::deterministic();
    let mut arm = arms().new_tree(&mut runner).unwrap().current();
    arm.body.gravity = Vec3([0.0, 0.0, 9.81]);
    let middle: Vec<f64> = vec![5e-4; arm.body.inputs];
    arm.pneumatics = Some(Pneumatics::new(&parameters(level), 101_325.0, &middle).unwrap());
    Arc::new(arm)
}

fn run(arm: &Arc<Arm>, options: Options, times: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let inputs = arm.body.inputs;
    let row = |p: f64| (0..inputs).map(move |j| p + 2e3 * j as f64);
    let input = Samples::new(
        vec![0.0, 0.1, 0.2],
        ([1.2e5, 1.6e5, 1.1e5].into_iter().flat_map(row).collect(), inputs),
        (Vec::new(), 0),
        Interpolation::Hold,
    )
    .unwrap();
    let mut simulation = Simulation::new(arm.clone(), Arc::new(input), options, 0.0, None, None).unwrap();
    let (rows, result) = simulation.advance(times, &mut || false);
    result.unwrap();
    (rows.lengths, rows.pressures)
}

#[test]
fn the_arm_with_pneumatics_at_one_millisecond_against_tiny_steps() {
    let times: Vec<f64> = (0..=30).map(|k| 0.01 * f64::from(k)).collect();
    for level in [PneumaticsLevel::Lag, PneumaticsLevel::Full] {
        let arm = plant(level);
        let rk4 = Options { method: Method::Rk4, ..Options::default() };
        let (q, p) = run(&arm, rk4, &times);
        let (q_fine, p_fine) = run(&arm, Options { step: 1e-5, ..rk4 }, &times);
        let (q_adaptive, _) = run(&arm, Options::default(), &times);
        let worst = |a: &[f64], b: &[f64]| a.iter().zip(b).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(worst(&q, &q_fine) < 5e-5, "{level:?}: {}", worst(&q, &q_fine));
        assert!(worst(&q_adaptive, &q_fine) < 1e-4, "{level:?}: {}", worst(&q_adaptive, &q_fine));
        assert!(worst(&p, &p_fine) < 200.0, "{level:?}: {}", worst(&p, &p_fine));
        // The pressures move: away from the first, towards the second command.
        let (before, after) = (p[10 * arm.body.inputs], p[19 * arm.body.inputs]);
        assert!((before - 1.2e5).abs() < 100.0 && (after - 1.6e5).abs() < 0.05e5, "{level:?}: {before} {after}");
    }
}

/// Over one step along which the reference comes towards the pressure, passes it and goes on, or stands still.
#[test]
fn lag_is_exact_where_it_meets_its_reference() {
    let k = Pneumatics::new(&parameters(PneumaticsLevel::Lag), 101_325.0, &[5e-4]).unwrap();
    for (p, rate) in
        [(1.3e5, 4e5), (0.9e5, -4e5), (1.3e5, -4e5), (0.9e5, 4e5), (1.1e5, 2e5), (1.1e5, 0.0), (1.3e5, 0.0)]
    {
        let drive = Drive {
            reference: 1.1e5,
            reference_rate: rate,
            volume: Volume::rigid(1e-3),
            volume_rate: Volume::rigid(0.0),
        };
        // Steps of 2 us by the midpoint rule, each with the time constant of its own start.
        let (mut expected, h, count) = (p, 2e-6, 50_000);
        for i in 0..count {
            let slope = |t: f64, p: f64| {
                let ahead = drive.reference + rate * t - p;
                ahead / if ahead > 0.0 { k.fill_time } else { k.vent_time }
            };
            let t = h * f64::from(i);
            expected += h * slope(t + 0.5 * h, expected + 0.5 * h * slope(t, expected));
        }
        let found = lagged(&k, p, &drive, h * f64::from(count));
        assert!((found - expected).abs() < 1e-2, "{p} {rate}: {found} {expected}");
    }
}

#[test]
fn lag_is_exact() {
    let arm = plant(PneumaticsLevel::Lag);
    let q = vec![0.2; arm.coordinates()];
    let p = vec![1.0e5; arm.body.inputs];
    let mut chambers = Chambers::new(arm.pneumatics.as_ref().unwrap(), &arm.body, &q, &p);
    let held = |p: f64| [vec![p; arm.body.inputs], vec![p; arm.body.inputs]];
    let mut out = p.clone();
    for k in 0..100 {
        let t = 1e-3 * f64::from(k);
        chambers.begin_step(arm.pneumatics.as_ref().unwrap(), &arm.body, (t, t + 1e-3), (&q, &q), &held(2.0e5));
        chambers.pressures(arm.pneumatics.as_ref().unwrap(), &arm.body, t + 5e-4, &q, &mut out);
        assert!((out[0] - (2e5 - 1e5 * (-(t + 5e-4) / 0.03).exp())).abs() < 1e-6);
        chambers.end_step();
    }
    chambers.begin_step(arm.pneumatics.as_ref().unwrap(), &arm.body, (0.1, 0.15), (&q, &q), &held(1.0e5));
    let before = 2e5 - 1e5 * (-0.1_f64 / 0.03).exp();
    chambers.pressures(arm.pneumatics.as_ref().unwrap(), &arm.body, 0.15, &q, &mut out);
    assert!((out[0] - (1e5 + (before - 1e5) * (-1.0_f64).exp())).abs() < 1e-6);
}

proptest! {
    /// What leaves one chamber arrives in the other; nothing is lost on the way.
    #[test]
    fn air_between_two_chambers_is_conserved(p1 in 0.5e5..4e5_f64, p2 in 0.5e5..4e5_f64) {
        let k = nominal();
        let (v1, v2, h) = (&Volume::rigid(3e-4), &Volume::rigid(6e-4), 1e-5);
        let (mut m1, mut m2) = (chamber::mass(&k, p1, v1), chamber::mass(&k, p2, v2));
        let (total, psi) = (m1 + m2, valve::FlowFunction::new(0.3));
        for _ in 0..20_000 {
            let (a, b) = (chamber::pressure(&k, m1, v1), chamber::pressure(&k, m2, v2));
            let flow = valve::mass_flow(valve::choked_flow(5e-8, 293.15), &psi, a, b).0;
            m1 -= h * flow;
            m2 += h * flow;
        }
        prop_assert!((m1 + m2 - total).abs() < 1e-12 * total);
        let (a, b) = (chamber::pressure(&k, m1, v1), chamber::pressure(&k, m2, v2));
        prop_assert!((a - b).abs() < 1e-3 * a, "{a} {b}");
    }

    /// Valves closed by their dead band: the air stays, and its pressure follows p V^n = const through the arm's motion.
    #[test]
    fn closed_chambers_keep_their_air(seed in states(), exponent in 1.0..1.4_f64) {
        let mut arm = (*plant(PneumaticsLevel::Full)).clone();
        let pneumatics = arm.pneumatics.as_mut().unwrap();
        pneumatics.exponent = exponent;
        (pneumatics.dead_band, pneumatics.inverse_travel) = (0.5, 2.0);
        pneumatics.proportional_gain = 0.0;
        pneumatics.integral_gain = 0.0;
        let (q, qd, p) = (seed.lengths(&arm), seed.rates(&arm), seed.pressures(&arm));
        let mut chambers = Chambers::new(arm.pneumatics.as_ref().unwrap(), &arm.body, &q, &p);
        let masses: Vec<f64> = chambers.masses().collect();
        chambers.begin_step(arm.pneumatics.as_ref().unwrap(), &arm.body, (0.0, 1e-3), (&q, &qd), &[p.clone(), p.clone()]);
        chambers.end_step();
        let after: Vec<f64> = q.iter().map(|q| 0.9 * q).collect();
        let mut out = p.clone();
        chambers.pressures(arm.pneumatics.as_ref().unwrap(), &arm.body, 1e-3, &after, &mut out);
        let none = vec![Volume::rigid(0.0); p.len()];
        let (mut before_volume, mut after_volume) = (none.clone(), none);
        chamber::volumes(&arm.body, 1e-4, &q, &mut before_volume);
        chamber::volumes(&arm.body, 1e-4, &after, &mut after_volume);
        for (j, m) in chambers.masses().enumerate() {
            prop_assert!((m - masses[j]).abs() < 1e-14 * m);
            let expected = p[j] * (before_volume[j].at_ambient / after_volume[j].at_ambient).powf(exponent);
            prop_assert!((out[j] - expected).abs() < 1e-11 * expected, "{j}: {} {expected}", out[j]);
        }
    }

    /// The mass taken up is the flow through the valve over the time, by an independent quadrature of the flow.
    #[test]
    fn mass_taken_up_is_the_integral_of_the_flow(target in 0.7e5..2.2e5_f64) {
        let k = nominal();
        let mut x = Input { content: chamber::mass(&k, 1.2e5, &Volume::rigid(5e-4)), spool: 0.0, integral: 0.0 };
        let drive = Drive { reference: target, reference_rate: 0.0, volume: Volume::rigid(5e-4), volume_rate: Volume::rigid(0.0) };
        let (start, mut through, h) = (x.content, 0.0, 1e-5);
        let flow = |x: &Input<f64>| valve::FullFlows::new(&k, chamber::pressure(&k, x.content, &Volume::rigid(5e-4))).at(&k, x.spool).0;
        for _ in 0..5000 {
            let before = flow(&x);
            x = substep(&k, x, &drive, 0.0, h);
            through += 0.5 * h * (before + flow(&x));
        }
        prop_assert!((x.content - start - through).abs() < 2e-5 * start, "{} {through}", x.content - start);
    }
}
