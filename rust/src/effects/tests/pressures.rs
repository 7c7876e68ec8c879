//! The chain of pressures and that of sensors.

use super::*;
use crate::effects::pressures::{PressureChain, Sort, at_rest};
use crate::integrate::{Method, Options};
use crate::plant::drives::Drives;
use crate::plant::input::{Input, Interpolation};
use crate::run::simulation::Simulation;
use std::sync::Arc;

/// An input whose first channel has these samples, the others 1 bar.
fn input(samples: &[(f64, f64)], interpolation: Interpolation) -> Input {
    let rows = samples.iter().flat_map(|&(_, p)| [vec![p], vec![1e5; 8]].concat()).collect();
    Input::new(samples.iter().map(|s| s.0).collect(), (rows, 9), (Vec::new(), 0), interpolation).unwrap()
}

/// The acting pressure of the first channel at `times`, in steps from one to the next that end on jumps.
fn acting(effects: &[EffectParameters], input: &Input, times: &[f64]) -> Vec<f64> {
    let arm = arm(effects);
    let mut drives = Drives::new(vec![(Arc::new(input.clone()), 0.0)]);
    let mut chain = PressureChain::new((&arm.effects, Sort::All), arm.body.inputs, &mut drives, times[0]).unwrap();
    let mut out = vec![0.0; 9];
    let mut found = Vec::new();
    for pair in times.windows(2) {
        let mut t = pair[0];
        while t < pair[1] {
            let jump = input.next_jump(t).min(chain.next_jump(&drives, t));
            let next = pair[1].min(jump);
            chain.begin_step(&arm.effects, &mut drives, t, next);
            // Stages out of order and a step begun again: the chain must not care.
            for share in [0.7, 0.3, 1.0] {
                chain.acting(&arm.effects, &mut drives, t + share * (next - t), &mut out);
            }
            chain.begin_step(&arm.effects, &mut drives, t, next);
            chain.end_step(&arm.effects, &mut drives, next);
            t = next;
        }
        chain.acting(&arm.effects, &mut drives, t, &mut out);
        assert!(out[1..].iter().all(|p| (p - 1e5).abs() < 1e-9));
        found.push(out[0]);
    }
    found
}

fn times(end: f64, count: u32) -> Vec<f64> {
    (0..=count).map(|k| end * f64::from(k) / f64::from(count)).collect()
}

#[test]
fn lag_is_exponential_both_ways() {
    let lag = [effect("pressure_lag", "input p11", &[("fill", 0.6), ("vent", 1.7)])];
    let input = input(&[(0.0, 1e5), (1.0, 2e5), (3.0, 1.2e5)], Interpolation::Hold);
    for count in [5, 10, 50] {
        let times = times(5.0, count);
        for (t, p) in times[1..].iter().zip(acting(&lag, &input, &times)) {
            let filled = |t: f64| 2e5 - 1e5 * (-(t - 1.0) / 0.6).exp();
            let expected = if *t <= 1.0 {
                1e5
            } else if *t <= 3.0 {
                filled(*t)
            } else {
                1.2e5 + (filled(3.0) - 1.2e5) * (-(t - 3.0) / 1.7).exp()
            };
            assert!((p - expected).abs() < 1e-6, "{t}: {p} {expected}");
        }
    }
}

#[test]
fn lag_of_a_triangle_changes_time_constants_where_it_turns() {
    let lag = [effect("pressure_lag", "input p11", &[("fill", 0.05), ("vent", 0.2)])];
    let input = input(&[(0.0, 1e5), (0.5, 2e5), (1.0, 1e5), (1.5, 2e5)], Interpolation::Linear);
    // Explicit Euler with a tiny step, written apart.
    let (mut p, h) = (1e5, 1e-6);
    for k in 0..1_500_000 {
        let t = h * (f64::from(k) + 0.5);
        let u = 1e5
            + 2e5
                * if t < 0.5 {
                    t
                } else if t < 1.0 {
                    1.0 - t
                } else {
                    t - 1.0
                };
        p += h * (u - p) / if u > p { 0.05 } else { 0.2 };
    }
    for count in [3, 15, 150] {
        let found = *acting(&lag, &input, &times(1.5, count)).last().unwrap();
        // Long pieces stretch the Pade form of the meeting time; 50 Pa of 1e5 then, well below 1 Pa at usual samples.
        let tolerance = if count < 10 { 300.0 } else { 2.0 };
        assert!((found - p).abs() < tolerance, "{count}: {found} {p}");
    }
}

#[test]
fn dead_band_is_a_play() {
    let band = [effect("valve_dead_band", "input p11", &[("band", 1e4)])];
    let input = input(&[(0.0, 1e5), (1.0, 2e5), (2.0, 1.5e5)], Interpolation::Linear);
    let found = acting(&band, &input, &[0.0, 0.05, 1.0, 1.1, 1.4, 2.0, 3.0]);
    assert!(close(&found, &[1e5, 1.9e5, 1.9e5, 1.9e5, 1.6e5, 1.6e5], 1e-9), "{found:?}");
}

#[test]
fn what_a_leak_takes_goes_with_the_root() {
    let arm = arm(&[effect("leak", "section 1", &[("drop", 4e3)])]);
    for above in [-3e4, -50.0, 0.0, 10.0, 2e4, 1e5, 1.8e5] {
        let (mut u, mut p) = (vec![AMBIENT; 9], vec![AMBIENT + above; 9]);
        u.copy_from_slice(&p);
        at_rest(&arm.effects, &mut p);
        // Along the tube falls what an orifice lets out.
        let fall = 4e3 * ((p[1] - AMBIENT).abs() / 1e5).sqrt() * above.signum();
        assert!((u[1] - p[1] - fall).abs() < 1e-6, "{above}: {}", u[1] - p[1]);
        assert_eq!(p[4], u[4]);
    }
}

#[test]
fn chambers_that_fill_together_fill_more_slowly() {
    // Three chambers by Euler's method with a tiny step and the sag by bisection, written apart: one rises, one falls, one
    // wants less than the sag.
    let (share, tau) = (0.8, 0.1);
    let arm = arm(&[effect("supply_sag", "section 1", &[("share", share), ("tau", tau)])]);
    let kind = &arm.effects.list[0].kind;
    let line = |t: f64| [1.6e5 + 2e4 * t, 1.3e5 - 1e5 * t, 1.22e5 + 4e4 * t];
    let begin = [1.2e5, 1.3e5, 1.2e5];
    let (mut p, h) = (begin, 1e-6);
    for k in 0..300_000 {
        let u = line(h * f64::from(k));
        let (mut low, mut high) = (0.0, 1e5);
        for _ in 0..60 {
            let sag = 0.5 * (low + high);
            let drawn: f64 = u.iter().zip(p).map(|(u, p)| (u - p - sag).max(0.0)).sum();
            if share * drawn > sag { low = sag } else { high = sag }
        }
        for (p, u) in p.iter_mut().zip(u) {
            let e = u - *p;
            *p += h / tau * if e > 0.0 { (e - low).max(0.0) } else { e };
        }
    }
    let found = |pieces: u32| {
        let (mut out, length) = (begin, 0.3 / f64::from(pieces));
        for k in 0..pieces {
            let pad = |x: [f64; 3]| [x.as_slice(), &[1e5; 6]].concat();
            let (t0, t1) = (length * f64::from(k), length * f64::from(k + 1));
            let mut next = pad(line(t1));
            kind.pressures(length, &pad(line(t0)), &pad(out), &mut next);
            assert!(next[3..].iter().all(|p| *p == 1e5));
            out.copy_from_slice(&next[..3]);
        }
        out
    };
    let error = |pieces| found(pieces).iter().zip(p).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
    let (coarse, fine) = (error(15), error(60));
    assert!(fine < 30.0 && fine < 0.2 * coarse, "{coarse} {fine}");
    // The supply alone is what tells it from a lag: without its resistance it is one.
    let free = super::arm(&[effect("supply_sag", "section 1", &[("share", 0.0), ("tau", tau)])]);
    let lag = super::arm(&[effect("pressure_lag", "section 1", &[("fill", tau), ("vent", tau)])]);
    let after = |arm: &Arm| {
        let mut next = [line(0.02).as_slice(), &[1e5; 6]].concat();
        let (from, last) = ([line(0.0).as_slice(), &[1e5; 6]].concat(), [begin.as_slice(), &[1e5; 6]].concat());
        arm.effects.list[0].kind.pressures(0.02, &from, &last, &mut next);
        next
    };
    assert!(close(&after(&free), &after(&lag), 1e-12));
}

/// Gains act on gauge pressure.
const AMBIENT: f64 = 101_325.0;

#[test]
fn delay_gain_and_offset() {
    let effects = [
        effect("delay", "input p11", &[("time", 0.013)]),
        effect("delay", "all", &[("time", 0.007)]),
        effect("pressure_gain", "input p11", &[("gain", 0.02)]),
        effect("pressure_offset", "input p11", &[("offset", -300.0)]),
    ];
    let ramp = input(&[(0.0, 1e5), (0.5, 2e5), (1.0, 1.3e5)], Interpolation::Linear);
    let times = times(1.0, 40);
    for (t, p) in times[1..].iter().zip(acting(&effects, &ramp, &times)) {
        let s = (t - 0.02).max(0.0);
        let u = if s < 0.5 { 1e5 + 2e5 * s } else { 2e5 - 1.4e5 * (s - 0.5) };
        // What comes in is read a nanosecond within the step.
        assert!((p - (1.02 * (u - AMBIENT) + AMBIENT - 300.0)).abs() < 1e-3, "{t}: {p} {u}");
    }
    // A jump arrives later, and a step ends on it.
    let jump = input(&[(0.0, 1e5), (0.5, 2e5)], Interpolation::Hold);
    let found = acting(&effects[..1], &jump, &[0.0, 0.512, 0.514, 0.6]);
    assert_eq!(found, [1e5, 2e5, 2e5]);
    let mut p = vec![1e5; 9];
    at_rest(&arm(&effects).effects, &mut p);
    assert!(close(&p, &[[1.02 * (1e5 - AMBIENT) + AMBIENT - 300.0].as_slice(), &[1e5; 8]].concat(), 1e-14));
}

#[test]
fn measured_lengths_are_those_of_the_sensors() {
    let effects = [
        effect("delay", "sensors", &[("time", 0.0123)]),
        effect("delay", "bellows 11", &[("time", 0.01)]),
        effect("length_gain", "bellows 12", &[("gain", 0.01)]),
        effect("length_offset", "section 1", &[("offset", 2e-3)]),
    ];
    let input = Arc::new(Input::new(vec![0.0], (pressures(), 9), (Vec::new(), 0), Interpolation::Linear).unwrap());
    let (q, _) = state();
    for method in [Method::Rk4, Method::DormandPrince54] {
        let options = Options { method, step: 1e-3, rtol: 1e-9, atol: 1e-11, ..Options::default() };
        let run = |effects: &[EffectParameters], times: &[f64], split: usize| {
            let mut simulation =
                Simulation::new(Arc::new(arm(effects)), input.clone(), options, 0.0, Some(&q), None).unwrap();
            let (a, ok) = simulation.advance(&times[..split], &mut || false);
            ok.unwrap();
            let (b, ok) = simulation.advance(&times[split..], &mut || false);
            ok.unwrap();
            ([a.lengths, b.lengths].concat(), [a.measured_lengths, b.measured_lengths].concat())
        };
        let times: Vec<f64> = (0..40).map(|k| 5e-3 * f64::from(k)).collect();
        let (true_lengths, measured) = run(&effects, &times, 13);
        let (plain, none) = run(&[], &times, 13);
        // The adaptive rows are dense output; the sensors do not act on the arm.
        assert!(close(&true_lengths, &plain, 1e-12) && none.is_empty());
        let earlier = |delay: f64| run(&[], &times.iter().map(|t| (t - delay).max(0.0)).collect::<Vec<_>>(), 1).0;
        let (late, later) = (earlier(0.0123), earlier(0.0223));
        for k in 0..times.len() {
            let row = &measured[9 * k..9 * k + 9];
            let (a, b) = (&late[9 * k..9 * k + 9], &later[9 * k..9 * k + 9]);
            let mut expected = a.to_vec();
            expected[0] = b[0] + 2e-3;
            expected[1] = a[1] * 1.01 + 2e-3;
            expected[2] += 2e-3;
            assert!(close(row, &expected, 2e-7), "{method:?} {k}: {row:?} {expected:?}");
        }
    }
}
