//! Orders, stiffness, breaks, dense output.

use super::{Integrator, Method, Options, RODAS4, System};

/// Prothero and Robinson's problem: x' = -rate (x - sin t) + cos t, solved by sin t, beside a free oscillation.
struct Stiff(f64);

impl System<f64> for Stiff {
    fn derivative(&mut self, t: f64, x: &[f64], dx: &mut [f64]) {
        dx[0] = -self.0 * (x[0] - t.sin()) + t.cos();
        dx[1] = x[2];
        dx[2] = -4.0 * x[1] - x[1] * x[1] * x[1];
    }
}

fn ros2(step: f64) -> Integrator<f64> {
    Integrator::new(Options { method: Method::Ros2, step, ..Options::default() }, 0.0, &[0.0, 0.3, 0.0])
}

fn ended(mut integrator: Integrator<f64>, rate: f64) -> (Vec<f64>, u64) {
    integrator.run(&mut Stiff(rate), &[2.0], &mut |_, _| (), &mut || false).unwrap();
    (integrator.state().to_vec(), integrator.statistics().evaluations)
}

fn end(rate: f64, step: f64) -> Vec<f64> {
    ended(ros2(step), rate).0
}

#[test]
fn stiff_modes_do_not_limit_the_step() {
    // An explicit method would need steps below 2.8e-6 s. Without df/dt the error would be of first order, 1e-2 here.
    let error = |step| (end(1e6, step)[0] - 2.0_f64.sin()).abs();
    let (coarse, fine) = (error(0.05), error(0.025));
    assert!(coarse < 1e-3, "{coarse}");
    assert!((3.3..4.8).contains(&(coarse / fine)), "{coarse} {fine}");
}

#[test]
fn the_order_of_ros2_is_two() {
    let exact = end(10.0, 1e-4);
    let error = |step| {
        let x = end(10.0, step);
        (0..3).map(|k| (x[k] - exact[k]).abs()).fold(0.0, f64::max)
    };
    let ratio = error(0.04) / error(0.02);
    assert!((3.3..4.8).contains(&ratio), "{ratio}");
}

#[test]
fn a_kept_jacobian_costs_less_and_no_order() {
    let exact = end(10.0, 1e-4);
    let error = |integrator| {
        let (x, _) = ended(integrator, 10.0);
        (0..3).map(|k| (x[k] - exact[k]).abs()).fold(0.0, f64::max)
    };
    let ratio = error(ros2(0.04).keeping()) / error(ros2(0.02).keeping());
    assert!((3.3..4.8).contains(&ratio), "{ratio}");
    assert!(error(ros2(0.02).keeping()) < 1.2 * error(ros2(0.02)));
    let (kept, anew) = (ended(ros2(2.5e-3).keeping(), 1e6), ended(ros2(2.5e-3), 1e6));
    // All steps of the first 0.1 s and then one of 8 have 3 evaluations more than the 4 of all.
    let (all, more) = (800 * 4, 40 + 760 / 8);
    assert!((all + 3 * more..=all + 3 * (more + 2)).contains(&kept.1), "{}", kept.1);
    assert_eq!(anew.1, 800 * 7);
    assert!((kept.0[0] - 2.0_f64.sin()).abs() < 1e-5);
}

/// Errors of Rodas4 in equal steps of `h` to 2 s: at the end, and the greatest halfway between steps.
fn rodas4(rate: f64, h: f64, exact: &dyn Fn(f64) -> Vec<f64>) -> (f64, f64) {
    let steps = (2.0 / h).round() as usize;
    let ends: Vec<f64> = (1..=steps).map(|k| h * k as f64).collect();
    let outputs: Vec<f64> = (0..steps).map(|k| h * (k as f64 + 0.5)).chain([2.0]).collect();
    let options = Options { method: Method::Rodas4, ..Options::default() };
    let mut integrator = Integrator::new(options, 0.0, &exact(0.0)).following(ends.into());
    let (mut between, mut last) = (0.0_f64, 0.0);
    let mut sink = |t: f64, x: &[f64]| {
        last = x.iter().zip(exact(t)).fold(0.0, |m: f64, (x, e)| m.max((x - e).abs()));
        if t < 2.0 {
            between = between.max(last);
        }
    };
    integrator.run(&mut Stiff(rate), &outputs, &mut sink, &mut || false).unwrap();
    assert_eq!(integrator.statistics().steps, steps as u64);
    (last, between)
}

/// sin t and the oscillation by Dormand-Prince at a tolerance that leaves 1e-12.
fn exact() -> impl Fn(f64) -> Vec<f64> {
    |t: f64| {
        let options = Options { rtol: 1e-12, atol: 1e-13, ..Options::default() };
        let mut integrator = Integrator::new(options, 0.0, &[0.0, 0.3, 0.0]);
        let mut out = vec![0.0, 0.3, 0.0];
        let mut sink = |_: f64, x: &[f64]| out.copy_from_slice(x);
        integrator.run(&mut Stiff(1.0), &[t], &mut sink, &mut || false).unwrap();
        out[0] = t.sin();
        out
    }
}

#[test]
fn the_order_of_rodas4_is_four_and_three_between_steps() {
    let exact = exact();
    let ((coarse, between), (fine, fine_between)) = (rodas4(2.0, 0.1, &exact), rodas4(2.0, 0.05, &exact));
    assert!(coarse < 1e-4 && (14.0..40.0).contains(&(coarse / fine)), "{coarse} {fine}");
    assert!((12.0..40.0).contains(&(between / fine_between)), "{between} {fine_between}");
}

/// Of classical methods the order drops to that of the stages here; this one is made for it.
#[test]
fn rodas4_keeps_its_order_on_stiff_problems() {
    let exact = exact();
    for rate in [1e3, 1e6] {
        let (coarse, fine) = (rodas4(rate, 0.1, &exact).0, rodas4(rate, 0.05, &exact).0);
        assert!(coarse < 1e-4 && coarse / fine > 11.0, "{rate} {coarse} {fine}");
    }
}

/// What a mistyped digit would break: sums of the rows in the form (alpha_ij, gamma_ij) and the ends of dense output.
#[test]
fn the_coefficients_of_rodas4_fit_together() {
    let t = &RODAS4;
    let n = t.c.len();
    // k = (1 - C)^-1 of the form's stages turns rows of a and c into those of the published alpha and gamma: with all f = 1
    // and J = 0 every k_i is 1 + sum c_ij k_j, and the stages are at c_i.
    let mut k = vec![1.0; n];
    for i in 1..n {
        k[i] = 1.0 + t.coupling[i - 1].iter().zip(&k).map(|(c, k)| c * k).sum::<f64>();
        let at: f64 = t.a[i - 1].iter().zip(&k).map(|(a, k)| a * k).sum();
        assert!((at - t.c[i]).abs() < 1e-13, "{i}: {at}");
    }
    let sum = |w: &[f64]| w.iter().zip(&k).map(|(w, k)| w * k).sum::<f64>();
    assert!((sum(t.b) - 1.0).abs() < 1e-13);
    assert!(sum(t.error).abs() < 1e-13);
    for (row, b) in t.dense.iter().zip(t.b) {
        assert!((row.iter().sum::<f64>() - b).abs() < 1e-13);
    }
}

/// A force that jumps at 1/3 s and bends at 2/3 s drives a stiff follower; the number is the end of the step.
struct Driven(f64);

impl System<f64> for Driven {
    fn begin_step(&mut self, _t0: f64, t1: f64, _x0: &[f64]) {
        self.0 = t1;
    }
    fn derivative(&mut self, t: f64, x: &[f64], dx: &mut [f64]) {
        // At a step's end the limit from the left belongs to it.
        let before = t < 1.0 / 3.0 || t == 1.0 / 3.0 && self.0 == t;
        dx[0] = 1e4 * (if before { 0.0 } else { 1.0 + 3.0 * (t - 2.0 / 3.0).max(0.0) } - x[0]);
    }
    fn next_break(&mut self, t: f64) -> f64 {
        if t < 1.0 / 3.0 { 1.0 / 3.0 } else { f64::INFINITY }
    }
    fn next_bend(&mut self, t: f64) -> f64 {
        if t < 2.0 / 3.0 { 2.0 / 3.0 } else { f64::INFINITY }
    }
}

#[test]
fn steps_end_where_the_input_jumps_or_bends() {
    let options = Options { method: Method::Rodas4, ..Options::default() };
    let mut integrator = Integrator::new(options, 0.0, &[0.0]).noting();
    integrator.run(&mut Driven(0.0), &[1.0 / 3.0], &mut |_, _| (), &mut || false).unwrap();
    assert_eq!(integrator.time(), 1.0 / 3.0);
    assert!(integrator.state()[0].abs() < 1e-12);
    integrator.run(&mut Driven(0.0), &[1.0], &mut |_, _| (), &mut || false).unwrap();
    // Behind a ramp of slope 3 by the follower's time, where the last step ended.
    let (t, x) = (integrator.time(), integrator.state()[0]);
    assert!(t >= 1.0 && (x - (3.0 * t - 1.0 - 3e-4)).abs() < 1e-5 * t, "{t} {x}");
    let (rejected, ends) = (integrator.statistics().rejected_steps, integrator.noted());
    assert!(ends.contains(&(1.0 / 3.0)) && ends.contains(&(2.0 / 3.0)), "{ends:?}");
    assert!(ends.len() < 150 && rejected < 30, "{} {rejected}", ends.len());
}

#[test]
fn a_step_that_does_not_move_the_time_is_an_error() {
    for method in [Method::Rk4, Method::Ros2, Method::DormandPrince54, Method::Rodas4] {
        let options = Options { method, max_step: 1e-3, ..Options::default() };
        let mut integrator = Integrator::new(options, 1.7e15, &[0.0, 0.3, 0.0]);
        let end = [1.7e15 + 1.0];
        let error = integrator.run(&mut Stiff(1.0), &end, &mut |_, _| (), &mut || false).unwrap_err().to_string();
        assert!(error.contains("does not move the time") && error.contains("unit"), "{method:?}: {error}");
    }
}

#[test]
fn a_run_is_stopped_within_few_steps() {
    for method in [Method::Rk4, Method::Ros2, Method::DormandPrince54, Method::Rodas4] {
        let options = Options { method, step: 1e-6, max_step: 1e-6, ..Options::default() };
        let mut integrator = Integrator::new(options, 0.0, &[0.0, 0.3, 0.0]);
        let mut asked = 0;
        let mut stop = || {
            asked += 1;
            asked == 3
        };
        assert!(integrator.run(&mut Stiff(1.0), &[1e3], &mut |_, _| (), &mut stop).is_err());
        assert!(integrator.statistics().evaluations < 200_000);
    }
}
