//! Hidden states against closed forms, and their order of convergence, alone and with the arm.

use super::*;
use crate::effects::EffectState;
use crate::integrate::{Integrator, Method, Options};
use crate::plant::Plant;
use crate::plant::input::{Input, Interpolation};
use std::sync::Arc;

/// Hidden states of an effect on bellows 11 after a prescribed motion of its length in `steps` equal steps; the closure
/// gives length and rate. `each` sees time, length and the state.
fn follow(
    effects: &[EffectParameters],
    end: f64,
    steps: u32,
    motion: impl Fn(f64) -> (f64, f64),
    mut each: impl FnMut(f64, f64, &[f64]),
) -> Vec<f64> {
    let arm = arm(effects);
    let mut state = EffectState::new(&arm.body, &arm.effects);
    // All nine lengths move alike, so that each bellows of a section has the coordinate's length.
    let x = |t: f64| {
        let (q, qd) = motion(t);
        [vec![q; 9], vec![qd; 9]].concat()
    };
    for k in 0..steps {
        let (t0, t1) = (end * f64::from(k) / f64::from(steps), end * f64::from(k + 1) / f64::from(steps));
        state.begin_step(&arm.body, t0, &x(t0));
        state.end_step(&arm.body, &arm.effects, t1, &x(t1));
        each(t1, motion(t1).0, state.hidden());
    }
    state.hidden().to_vec()
}

const AMPLITUDE: f64 = 0.03;
const OMEGA: f64 = 9.0;

fn swing(t: f64) -> (f64, f64) {
    (0.2 + AMPLITUDE * (OMEGA * t).sin(), AMPLITUDE * OMEGA * (OMEGA * t).cos())
}

#[test]
fn creep_follows_its_closed_form() {
    let creep = |tau: f64| [effect("creep", "bellows 11", &[("stiffness", 100.0), ("tau", tau)])];
    // A ramp, in steps longer than tau and shorter.
    for (tau, steps) in [(0.01, 3), (0.3, 7), (100.0, 2)] {
        let z = follow(&creep(tau), 1.0, steps, |t| (0.1 + 0.05 * t, 0.05), |_, _, _| ())[0];
        assert!((z - 0.05 * tau * (1.0 - (-1.0 / tau).exp())).abs() < 1e-14, "{z}");
    }
    // z' = q' - z / tau under a sine, from rest.
    let (tau, end) = (0.08, 1.3);
    let x = OMEGA * tau;
    let scale = AMPLITUDE * x / (1.0 + x * x);
    let exact = scale * ((OMEGA * end).cos() + x * (OMEGA * end).sin() - (-end / tau).exp());
    let error = |steps| (follow(&creep(tau), end, steps, swing, |_, _, _| ())[0] - exact).abs();
    let (coarse, fine) = (error(40), error(80));
    assert!(coarse < 1e-6 && (coarse / fine).log2() > 3.5, "order {}", (coarse / fine).log2());
}

#[test]
fn hidden_states_start_where_they_are_told() {
    let still = |_: f64| (0.15, 0.0);
    let creep = [effect("creep", "section 1", &[("stiffness", 100.0), ("tau", 0.4), ("strain", 0.02)])];
    for z in follow(&creep, 0.3, 3, still, |_, _, _| ()) {
        assert!((z - 0.02 * (-0.3_f64 / 0.4).exp()).abs() < 1e-16);
    }
    let stop =
        effect("hysteresis", "section 1", &[("amplitude", 1.0), ("yield", 0.01), ("sharpness", 1.0), ("start", -0.6)]);
    let ramp = |t: f64| (0.15 + 0.1 * t, 0.1);
    for w in follow(&[stop], 0.12, 3, ramp, |_, _, _| ()) {
        assert!((w - 0.6).abs() < 1e-12);
    }
}

#[test]
fn hysteresis_loop_has_the_area_of_the_closed_form() {
    let (force, reach) = (3.0, 0.01);
    let effects = [effect("hysteresis", "bellows 11", &[("amplitude", force), ("yield", reach)])];
    for speed in [1.0, 5.0] {
        // Triangles of amplitude A at two speeds: the same loop.
        let period = 0.4 / speed;
        let (mut area, mut last) = (0.0, (0.2, 0.0));
        let triangle = |t: f64| {
            let phase = (t / period).fract();
            let q = if phase < 0.25 {
                phase
            } else if phase < 0.75 {
                0.5 - phase
            } else {
                phase - 1.0
            };
            (0.2 + 4.0 * AMPLITUDE * q, 0.0)
        };
        follow(&effects, 3.0 * period, 2400, triangle, |t, q, w| {
            if t > 2.0 * period + 1e-9 {
                area += 0.5 * (w[0] + last.1) * force * (q - last.0);
            }
            last = (q, w[0]);
        });
        let e = (-2.0 * AMPLITUDE / reach).exp();
        let greatest = (1.0 - e) / (1.0 + e);
        let expected = 2.0 * force * (2.0 * AMPLITUDE - (1.0 + greatest) * reach * (1.0 - e));
        assert!((area - expected).abs() < 2e-4 * expected, "{area} {expected}");
    }
}

#[test]
fn slip_converges_at_second_order_through_turns() {
    for effects in [
        [effect("hysteresis", "bellows 11", &[("amplitude", 3.0), ("yield", 0.01)])],
        [effect("hysteresis", "bellows 11", &[("amplitude", 3.0), ("yield", 0.01), ("sharpness", 0.6)])],
        [effect(
            "friction",
            "bellows 11",
            &[("coulomb_force", 1.0), ("presliding", 4e-3), ("static_ratio", 1.6), ("stribeck_velocity", 0.05)],
        )],
    ] {
        // Ends just after the third turn, where the error of a turn has not been forgotten.
        let run = |steps| follow(&effects, 0.9, steps, swing, |_, _, _| ())[0];
        let exact = run(400_000);
        let error = |steps: u32| (run(steps) - exact).abs();
        // The place of the turn within its step makes single ratios scatter; the mean over many is the order.
        let coarse: f64 = (0..40).map(|k| error(100 + k)).sum();
        let fine: f64 = (0..40).map(|k| error(800 + 8 * k)).sum();
        let order = (coarse / fine).log2() / 3.0;
        assert!(coarse < 0.4 && order > 1.8, "order {order}, {coarse} {fine}");
        assert!(exact.abs() > 0.1);
    }
}

#[test]
fn friction_tends_to_coulomb_and_breaks_away_at_its_ratio() {
    let effects = [effect(
        "friction",
        "bellows 11",
        &[("coulomb_force", 2.0), ("presliding", 1e-4), ("static_ratio", 1.5), ("stribeck_velocity", 0.01)],
    )];
    let at = |v: f64| follow(&effects, 0.01 / v, 50, |t| (0.15 + v * t, v), |_, _, _| ())[0];
    for v in [1e-4, 0.01, 0.5] {
        assert!((at(v) - (1.0 + 0.5 / (1.0 + (v / 0.01).powi(2)))).abs() < 1e-12);
    }
}

fn options(step: f64) -> Options {
    Options { method: Method::Rk4, step, ..Options::default() }
}

fn simulate(effects: &[EffectParameters], options: Options, end: f64) -> Vec<f64> {
    let arm = Arc::new(arm(effects));
    let input = Input::new(vec![0.0], (pressures(), 9), (Vec::new(), 0), Interpolation::Linear).unwrap();
    let (q, qd) = state();
    let x = [q, qd.iter().map(|v| 0.3 * v).collect()].concat();
    let mut plant = Plant::new(arm, Arc::new(input));
    let mut integrator = Integrator::new(options, 0.0, &x);
    let mut out = Vec::new();
    let mut sink = |_: f64, x: &[f64]| out = x[..9].to_vec();
    integrator.run(&mut plant, &[end], &mut sink, &mut || false).unwrap();
    out
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |m, (a, b)| m.max((a - b).abs()))
}

/// The whole arm with each stateful kind on every bellows, stiff ones among them, against a tiny step.
#[test]
fn the_arm_converges_with_its_hidden_states() {
    let cases = [
        (effect("creep", "all", &[("stiffness", 300.0), ("tau", 0.1)]), 3.5),
        (effect("creep", "all", &[("stiffness", 300.0), ("tau", 2e-3)]), 3.0),
        (effect("hysteresis", "all", &[("amplitude", 3.0), ("yield", 5e-3)]), 1.6),
        (effect("friction", "all", &[("coulomb_force", 0.5), ("presliding", 1e-3), ("static_ratio", 1.3)]), 1.6),
    ];
    for (case, order) in cases {
        let effects = [case];
        let exact = simulate(&effects, options(2.5e-5), 0.3);
        let (coarse, fine) = (
            apart(&simulate(&effects, options(4e-3), 0.3), &exact),
            apart(&simulate(&effects, options(1e-3), 0.3), &exact),
        );
        let found = (coarse / fine).log2() / 2.0;
        assert!(coarse < 5e-5 && (found > order || fine < 1e-10), "{effects:?}: {coarse:.1e} {fine:.1e} order {found}");
        // The adaptive method agrees, and steps that were rejected leave no trace.
        let adaptive = simulate(&effects, Options { rtol: 1e-8, atol: 1e-10, ..Options::default() }, 0.3);
        assert!(apart(&adaptive, &exact) < 2e-6, "{effects:?}: {:.1e}", apart(&adaptive, &exact));
    }
}

#[test]
fn stiffness_of_hidden_states_does_not_limit_the_step() {
    // Time constants of 0.1 ms and a presliding of 1 um at steps of 2 ms: explicit integration of these states would blow up.
    let effects = [
        effect("creep", "all", &[("stiffness", 50.0), ("tau", 1e-4)]),
        effect("hysteresis", "all", &[("amplitude", 0.1), ("yield", 1e-4)]),
    ];
    let (coarse, fine) = (simulate(&effects, options(2e-3), 0.5), simulate(&effects, options(5e-5), 0.5));
    assert!(apart(&coarse, &fine) < 1e-4, "{:.1e}", apart(&coarse, &fine));
}

#[test]
fn two_branches_add_up_and_rest_exerts_nothing() {
    let a = effect("creep", "all", &[("stiffness", 100.0), ("tau", 0.1)]);
    let b = effect("creep", "section 2", &[("stiffness", 40.0), ("tau", 3.0)]);
    let ramp = |t: f64| (0.15 + 0.1 * t, 0.1);
    let both = follow(&[a.clone(), b.clone()], 0.5, 10, ramp, |_, _, _| ());
    let alone =
        [follow(std::slice::from_ref(&a), 0.5, 10, ramp, |_, _, _| ()), follow(&[b], 0.5, 10, ramp, |_, _, _| ())];
    assert_eq!(both, alone.concat());
    assert_eq!((alone[0].len(), alone[1].len()), (9, 3));
    // Twice half the stiffness is the whole.
    let half = effect("creep", "all", &[("stiffness", 50.0), ("tau", 0.1)]);
    let other = effect("creep", "all", &[("stiffness", 50.0), ("tau", 0.100_000_000_1)]);
    assert!(
        apart(&simulate(&[half, other], options(1e-3), 0.3), &simulate(std::slice::from_ref(&a), options(1e-3), 0.3))
            < 1e-9
    );
    assert!(force(&arm(&[a]), EFFECTS).iter().all(|f| *f == 0.0));
}
