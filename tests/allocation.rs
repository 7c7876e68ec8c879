//! Nothing is allocated inside a step: counted by an allocator of this test's own.

use bha_core::arm::Arm;
use bha_core::body::parameters::{ArmParameters, BaseParameters, PointMassParameters, SectionArcParameters};
use bha_core::dynamics::derivatives::{Point, differentiator};
use bha_core::integrate::{Integrator, Method, Options};
use bha_core::plant::Plant;
use bha_core::plant::input::{Input, Interpolation};
use bha_core::real::lanes::{AnyLanes, InstructionSet, dispatch};
use bha_core::real::{Kernel, Real};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::collections::HashMap;
use std::sync::Arc;

struct Counting;

thread_local! {
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: hands everything to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // A thread that is ending has no counter any more.
        let _ = COUNT.try_with(|c| c.set(c.get() + 1));
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn count(work: impl FnOnce()) -> u64 {
    let before = COUNT.get();
    work();
    COUNT.get() - before
}

/// An arm as in the paper, and the same somewhere in the world with sections of several arcs and masses along them.
fn arms() -> [Arm; 2] {
    #[derive(serde::Deserialize)]
    struct Oracle {
        core_parameters: HashMap<String, ArmParameters>,
    }
    let packed = include_bytes!("data/oracle_cases.json.gz").as_slice();
    let oracle: Oracle = serde_json::from_reader(flate2::read::GzDecoder::new(packed)).unwrap();
    let plain = oracle.core_parameters.values().find(|a| a.section.len() == 3).unwrap();
    let mut varied = plain.clone();
    varied.base = Some(BaseParameters { position: [0.1, 0.2, 0.3], rotation: [0.1, -0.4, 0.2] });
    for section in &mut varied.section {
        let arc = |length: f64, bending: f64, relative_radius: f64| SectionArcParameters {
            length,
            bending,
            relative_radius,
            relative_area: 1.0,
        };
        section.arcs = vec![arc(0.3, 0.5, 1.1), arc(0.7, 0.5, 0.9)];
        section.masses = vec![PointMassParameters { share: 0.6, mass: 0.1, inertia: [1e-4; 3], offset: [0.0; 3] }];
    }
    [Arm::new(plain).unwrap(), Arm::new(&varied).unwrap()]
}

struct Steps<'a> {
    arm: &'a Arm,
    method: Method,
}

struct Run<T> {
    plant: Plant<T>,
    integrator: Integrator<T>,
}

impl<T: Real> Kernel for Run<T> {
    type Output = u64;
    #[inline(always)]
    fn run(mut self) -> u64 {
        let mut go = |t: f64| self.integrator.run(&mut self.plant, &[t], &mut |_, _| {}, &mut || false).unwrap();
        go(0.01);
        count(|| go(0.05))
    }
}

impl AnyLanes for Steps<'_> {
    type Output = u64;
    fn with<T: Real>(self) -> u64 {
        let lifted = Arc::new(self.arm.lift::<T>());
        let pressures = vec![1.1e5; 2 * self.arm.body.inputs];
        let input =
            Input::new(vec![0.0, 1.0], (pressures, self.arm.body.inputs), (Vec::new(), 0), Interpolation::Linear)
                .unwrap();
        let n = self.arm.coordinates();
        let x: Vec<T> = (0..2 * n).map(|k| T::from_f64(if k < n { 0.2 } else { 0.0 })).collect();
        let options = Options { method: self.method, ..Options::default() };
        let integrator = Integrator::new(options, 0.0, &x);
        T::enter(Run { plant: Plant::new(lifted, Arc::new(input)), integrator })
    }
}

#[test]
fn no_step_allocates() {
    for arm in arms() {
        for set in InstructionSet::ALL.into_iter().filter(|s| s.is_available()) {
            for method in [Method::Rk4, Method::DormandPrince54] {
                assert_eq!(dispatch(set, Steps { arm: &arm, method }), 0, "{set:?} {method:?}");
            }
        }
    }
}

#[test]
fn no_derivative_allocates() {
    for arm in arms() {
        let n = arm.coordinates();
        let (q, qd, p) = (vec![0.2; n], vec![0.1; n], vec![1.1e5; arm.body.inputs]);
        let mut run = differentiator(&arm, &[], InstructionSet::best());
        let (mut qdd, mut out) = (vec![0.0; n], vec![0.0; n * (2 * n + arm.body.inputs)]);
        let point = Point { q: &q, qd: &qd, p: &p, f_ext: None };
        assert_eq!(count(|| run.run(point, &mut qdd, &mut out)), 0);
    }
}

#[test]
fn the_counter_counts() {
    assert!(count(|| drop(std::hint::black_box(vec![1.0; 10]))) > 0);
}
