//! Forward dynamics per second and core: scalar, fused, lanes of every instruction set, dual numbers; and the processor's
//! peak for comparison. `cargo bench --bench throughput --features lanes`.

mod counting;

use bha_core::arm::Arm;
use bha_core::body::parameters::ArmParameters;
use bha_core::dynamics::Workspace;
use bha_core::dynamics::derivatives::{Point, differentiator};
use bha_core::dynamics::recursion::forward_dynamics_into;
use bha_core::real::lanes::{AnyLanes, InstructionSet, dispatch};
use bha_core::real::{Fused, Kernel, Real};
use counting::{Counting, operations};
use std::collections::HashMap;
use std::hint::black_box;
use std::time::Instant;

fn nominal() -> Arm {
    #[derive(serde::Deserialize)]
    struct Oracle {
        core_parameters: HashMap<String, ArmParameters>,
    }
    let packed = include_bytes!("../../tests/data/oracle_cases.json.gz").as_slice();
    let oracle: Oracle = serde_json::from_reader(flate2::read::GzDecoder::new(packed)).unwrap();
    Arm::new(oracle.core_parameters.values().find(|a| a.section.len() == 3).expect("an arm of three sections")).unwrap()
}

/// Seconds of one call of `f`: the shortest of many short rounds, which other work on the machine disturbs least.
fn shortest(mut f: impl FnMut()) -> f64 {
    let mut round = |calls: u32| {
        let start = Instant::now();
        for _ in 0..calls {
            f();
        }
        start.elapsed().as_secs_f64() / f64::from(calls)
    };
    let once = (0..20).map(|_| round(1)).fold(f64::INFINITY, f64::min);
    let calls = (2e-4 / once).clamp(1.0, 1e6) as u32;
    (0..100).map(|_| round(calls)).fold(f64::INFINITY, f64::min)
}

/// Seconds of one forward dynamics over `T`.
fn forward_dynamics<T: Real>(arm: &Arm) -> f64 {
    let lifted = arm.lift::<T>();
    let n = arm.coordinates();
    let at = |k: usize| T::from_lanes(|j| 0.2 + 0.01 * (k * 5 % 7) as f64 + 0.001 * j as f64);
    let x: Vec<T> = (0..2 * n).map(|k| if k < n { at(k) } else { at(k) - 0.22 }).collect();
    let p: Vec<T> = (0..arm.body.inputs).map(|k| T::from_f64(1.1e5 + 5e3 * k as f64)).collect();
    let (mut ws, mut out) = (Workspace::new(&lifted), vec![T::zero(); n]);
    let (q, qd) = x.split_at(n);
    shortest(|| {
        let (arm, q, qd) = (black_box(&lifted), black_box(q), black_box(qd));
        forward_dynamics_into(arm, q, qd, &p, None, &mut ws, black_box(&mut out));
    })
}

struct Throughput<'a>(&'a Arm);

impl AnyLanes for Throughput<'_> {
    type Output = f64;
    /// Seconds per state.
    fn with<T: Real>(self) -> f64 {
        forward_dynamics::<T>(self.0) / T::LANES as f64
    }
}

/// Seconds of all derivatives by states and inputs.
fn derivatives(arm: &Arm, set: InstructionSet) -> f64 {
    let n = arm.coordinates();
    let q: Vec<f64> = (0..n).map(|k| 0.2 + 0.01 * (k * 5 % 7) as f64).collect();
    let qd: Vec<f64> = (0..n).map(|k| 0.1 - 0.02 * k as f64).collect();
    let p = vec![1.2e5; arm.body.inputs];
    let mut run = differentiator(arm, &[], set);
    let (mut qdd, mut out) = (vec![0.0; n], vec![0.0; n * (2 * n + arm.body.inputs)]);
    shortest(|| run.run(Point { q: black_box(&q), qd: &qd, p: &p, f_ext: None }, &mut qdd, black_box(&mut out)))
}

/// Independent chains of multiply-adds: enough of them to hide the latency of each.
const CHAINS: usize = 12;
const LENGTH: usize = 1000;

/// Multiply-adds and nothing else.
struct Peak<'a, T>(&'a mut [T; CHAINS]);

impl<T: Real> Kernel for Peak<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let (a, b) = (T::from_f64(0.999), T::from_f64(0.001));
        let mut x = *self.0;
        for _ in 0..LENGTH {
            for x in &mut x {
                *x = x.mul_add(a, b);
            }
        }
        *self.0 = x;
    }
}

struct PeakRate;

impl AnyLanes for PeakRate {
    type Output = f64;
    /// Floating-point operations a second.
    fn with<T: Real>(self) -> f64 {
        let mut x = [T::one(); CHAINS];
        let seconds = shortest(|| T::enter(Peak(black_box(&mut x))));
        (2 * CHAINS * LENGTH * T::LANES) as f64 / seconds
    }
}

/// Operations of one forward dynamics.
fn count(arm: &Arm) -> u64 {
    let lifted = arm.lift::<Counting>();
    let n = arm.coordinates();
    let all = |x: f64, n: usize| vec![Counting::from_f64(x); n];
    let (q, qd, p, mut out) = (all(0.2, n), all(0.1, n), all(1.2e5, arm.body.inputs), all(0.0, n));
    let mut ws = Workspace::new(&lifted);
    operations(|| forward_dynamics_into(&lifted, &q, &qd, &p, None, &mut ws, &mut out))
}

fn main() {
    let arm = nominal();
    let flops = count(&arm) as f64;
    println!("forward dynamics of {} sections: {flops} floating-point operations", arm.body.sections.len());
    let scalar = forward_dynamics::<f64>(&arm);
    println!("scalar      {:8.1} ns per state", scalar * 1e9);
    if Fused::is_available() {
        let fused = forward_dynamics::<Fused>(&arm);
        println!("fused       {:8.1} ns per state, {:.2} times the scalar rate", fused * 1e9, scalar / fused);
    }
    for set in InstructionSet::ALL.into_iter().filter(|s| s.is_available()) {
        let state = dispatch(set, Throughput(&arm));
        let peak = dispatch(set, PeakRate);
        println!(
            "{:7} x {} {:8.1} ns per state, {:.2} times the scalar rate; {:.2} of {:.1} Gflop/s, {:.0} % of the peak",
            set.name(),
            set.lanes(),
            state * 1e9,
            scalar / state,
            flops / state * 1e-9,
            peak * 1e-9,
            100.0 * flops / state / peak
        );
    }
    for set in InstructionSet::ALL.into_iter().filter(|s| s.is_available()) {
        println!("all derivatives by states and inputs, {}: {:.2} us", set.name(), derivatives(&arm, set) * 1e6);
    }
}
