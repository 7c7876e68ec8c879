//! Nothing is allocated in a period of the closed loop: neither by the plant with full pneumatics nor by a controller.

use bha_core::arm::Arm;
use bha_core::body::parameters::ArmParameters;
use bha_core::control::rest::rest_near;
use bha_core::control::{Controller, ControllerParameters, Limits, Target};
use bha_core::run::stepper::Stepper;
use bha_core::run::stepping::{Plan, Stepping};
use serde::Deserialize;
use std::alloc::{GlobalAlloc, Layout, System};
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

struct Counting;

static COUNT: AtomicUsize = AtomicUsize::new(0);

// SAFETY: hands everything to the system's allocator unchanged; counting has no effect on memory.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `GlobalAlloc::alloc`.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: `pointer` came from `System` with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn arm() -> Arc<Arm> {
    #[derive(Deserialize)]
    struct Oracle {
        core_parameters: HashMap<String, ArmParameters>,
    }
    let packed = include_bytes!("data/oracle_cases.json.gz").as_slice();
    let oracle: Oracle = serde_json::from_reader(flate2::read::GzDecoder::new(packed)).unwrap();
    let mut parameters = oracle.core_parameters.into_values().find(|a| a.section.len() == 3).unwrap();
    let pneumatics = serde_json::json!({
        "level": "full", "supply_pressure": 3.5e5, "exhaust_pressure": 101325.0, "vacuum_pressure": 0.5e5,
        "sonic_conductance": 2e-8, "critical_pressure_ratio": 0.35, "air_temperature": 293.15, "dead_volume": 1e-4,
        "polytropic_exponent": 1.2, "spool_time": 2e-3, "spool_dead_band": 0.05, "proportional_gain": 150.0,
        "integral_gain": 1500.0, "feed_forward": 1.0
    });
    parameters.pneumatics = Some(serde_json::from_value(pneumatics).unwrap());
    Arc::new(Arm::new(&parameters).unwrap())
}

// One test: the counter sees every thread of this process.
#[test]
fn a_period_allocates_nothing() {
    let arm = arm();
    let (m, n) = (arm.coordinates(), arm.body.inputs);
    let limits = Limits { low: vec![0.6e5; n], high: vec![3e5; n], preferred: vec![1.2e5; n] };
    let pose = vec![0.19; m];
    let (p, q) = rest_near(&arm, &pose, &limits, &mut || false).unwrap();
    let laws = [
        serde_json::json!({"kind": "pid", "proportional": vec![1e5; n], "integral": vec![1e5; n], "derivative": vec![1e3; n]}),
        serde_json::json!({"kind": "gravity_pd", "proportional": vec![500.0; m], "integral": vec![100.0; m], "derivative": vec![10.0; m]}),
        serde_json::json!({"kind": "static_model", "proportional": 0.0, "integral": 0.5}),
        serde_json::json!({"kind": "feedback_linearization", "proportional": 196.0, "integral": 2.0, "derivative": 28.0,
                           "at_measured": false, "compensate_disturbance": true}),
        serde_json::json!({"kind": "state_feedback", "gain": vec![1e3; 2 * m * n]}),
    ];
    for law in laws {
        let parameters: ControllerParameters = serde_json::from_value(serde_json::json!({
            "period": 1e-3,
            "law": law,
            "observer": {"kind": "kalman", "length_noise": 1e-4, "pressure_noise": 100.0, "acceleration_noise": 2.0,
                         "disturbance_noise": 10.0, "renewal": 0},
            "limits": {"low": limits.low, "high": limits.high, "preferred": limits.preferred},
            "lead_time": 0.01,
        }))
        .unwrap();
        let mut controller = Controller::new(arm.clone(), parameters).unwrap();
        let mut plant = Stepper::new(arm.clone(), Plan { stepping: Stepping::RungeKutta, step: 1e-3 }).unwrap();
        plant.reset(Some(&q), None, &p, &mut || false).unwrap();
        let (mut command, still) = (p.clone(), vec![0.0; m]);
        let mut period = |controller: &mut Controller| {
            let target = Target { q: &pose, qd: &still, qdd: &still };
            controller.step(plant.lengths(), plant.pressures(), target, &mut command).unwrap();
            plant.step(&command, 1e-3, &mut || false).unwrap();
        };
        // The first periods make the observer's gain and fill buffers.
        (0..5).for_each(|_| period(&mut controller));
        let before = COUNT.load(Ordering::Relaxed);
        (0..200).for_each(|_| period(&mut controller));
        assert_eq!(COUNT.load(Ordering::Relaxed) - before, 0, "{law}");
    }
}
