//! Forward dynamics per second and core: scalar, fused, lanes of every instruction set, dual numbers; and the processor's
//! peak for comparison. `cargo bench --bench throughput`.

use bha_core::arm::Arm;
use bha_core::dynamics::Workspace;
use bha_core::dynamics::recursion::forward_dynamics_into;
use bha_core::parameters::ArmParameters;
use bha_core::real::lanes::{AnyLanes, InstructionSet, dispatch};
use bha_core::real::{Dual, Fused, Kernel, Real};
use std::collections::HashMap;
use std::hint::black_box;
use std::time::Instant;

fn nominal() -> Arm {
    #[derive(serde::Deserialize)]
    struct Oracle {
        arms: HashMap<String, ArmParameters>,
    }
    let oracle: Oracle = serde_json::from_str(include_str!("../tests/data/oracle.json")).unwrap();
    Arm::new(oracle.arms.values().find(|a| a.section.len() == 3).expect("an arm of three sections")).unwrap()
}

/// Median seconds of one call of `f`, over `rounds` rounds of `calls` calls.
fn median(rounds: usize, calls: usize, mut f: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..rounds)
        .map(|_| {
            let start = Instant::now();
            for _ in 0..calls {
                f();
            }
            start.elapsed().as_secs_f64() / calls as f64
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[rounds / 2]
}

struct Step<'a, T> {
    arm: &'a Arm<T>,
    x: &'a [T],
    p: &'a [T],
    ws: &'a mut Workspace<T>,
    out: &'a mut [T],
}

impl<T: Real> Kernel for Step<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let (q, qd) = self.x.split_at(self.x.len() / 2);
        forward_dynamics_into(self.arm, q, qd, self.p, None, self.ws, self.out);
    }
}

/// Seconds of one forward dynamics over `T`.
fn forward_dynamics<T: Real>(arm: &Arm) -> f64 {
    let lifted = arm.lift::<T>();
    let n = arm.coordinates();
    let at = |k: usize| T::from_lanes(|j| 0.2 + 0.01 * (k * 5 % 7) as f64 + 0.001 * j as f64);
    let x: Vec<T> = (0..2 * n).map(|k| if k < n { at(k) } else { at(k) - 0.22 }).collect();
    let p: Vec<T> = (0..arm.inputs).map(|k| T::from_f64(1.1e5 + 5e3 * k as f64)).collect();
    let (mut ws, mut out) = (Workspace::new(&lifted), vec![T::zero(); n]);
    median(25, 2000, || {
        T::enter(Step { arm: black_box(&lifted), x: black_box(&x), p: &p, ws: &mut ws, out: black_box(&mut out) });
    })
}

struct Throughput<'a>(&'a Arm);

impl AnyLanes for Throughput<'_> {
    type Output = (f64, f64, f64);
    /// Seconds per state; per state and direction with one dual direction a lane; the same with two.
    fn with<T: Real>(self) -> (f64, f64, f64) {
        let lanes = T::LANES as f64;
        let dual = forward_dynamics::<Dual<1, T>>(self.0) / lanes;
        let dual2 = forward_dynamics::<Dual<2, T>>(self.0) / (2.0 * lanes);
        (forward_dynamics::<T>(self.0) / lanes, dual, dual2)
    }
}

fn main() {
    let arm = nominal();
    let scalar = forward_dynamics::<f64>(&arm);
    println!("scalar            {:8.1} ns per state", scalar * 1e9);
    if Fused::is_available() {
        let fused = forward_dynamics::<Fused>(&arm);
        println!("fused             {:8.1} ns per state, {:.2} times the scalar rate", fused * 1e9, scalar / fused);
    }
    for set in InstructionSet::ALL.into_iter().filter(|s| s.is_available()) {
        let (state, dual, dual2) = dispatch(set, Throughput(&arm));
        println!(
            "{:8} x {}      {:8.1} ns per state, {:.2} times the scalar rate; derivatives {:.1} (2: {:.1}) ns a direction",
            set.name(),
            set.lanes(),
            state * 1e9,
            scalar / state,
            dual * 1e9,
            dual2 * 1e9
        );
    }
}
