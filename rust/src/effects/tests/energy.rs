//! Passive effects give no energy to the arm.

use super::*;
use crate::dynamics::energy::energy;
use crate::integrate::{Integrator, Options};
use crate::plant::Plant;
use crate::plant::input::{Input, Interpolation};
use proptest::prelude::*;
use std::sync::Arc;

/// The effect alone, at a strength from 0 to 1, with a part of its time scale or length from 0 to 1.
fn passive(which: usize, strength: f64, scale: f64) -> EffectParameters {
    let length = 2e-4 * 50.0_f64.powf(scale);
    match which {
        0 => effect("creep", "all", &[("stiffness", 500.0 * strength), ("tau", 1e-3 * 1e3_f64.powf(scale))]),
        1 => effect("hysteresis", "all", &[("amplitude", 5.0 * strength), ("yield", length)]),
        7 => effect(
            "hysteresis",
            "all",
            &[("amplitude", 5.0 * strength), ("yield", length), ("sharpness", (7.0 * scale).fract())],
        ),
        2 => effect(
            "friction",
            "all",
            &[("coulomb_force", 2.0 * strength), ("presliding", length), ("static_ratio", 1.5)],
        ),
        3 => effect("quadratic_damping", "all", &[("damping", 100.0 * strength)]),
        4 => effect("bending_damping", "all", &[("damping", 0.1 * strength)]),
        5 => effect("tool_drag", "section 3", &[("damping", 2.0 * strength), ("drag", 3.0 * scale)]),
        // The wall stands 2 to 5 cm beyond the head's height at the start.
        _ => effect(
            "contact",
            "section 3",
            &[
                ("stiffness", 2000.0 * strength),
                ("damping", 30.0 * scale),
                ("wall_z", 0.74),
                ("normal_z", -1.0),
                ("rounding", 1e-5),
            ],
        ),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// The undamped arm let go under ambient pressure: kinetic and potential energy never exceed those of the start,
    /// since every hidden state starts empty and stores no less than nothing.
    #[test]
    fn passive_effects_never_add_energy(which in 0..8_usize, strength in 0.0..1.0_f64, scale in 0.0..1.0_f64, bend in -0.02..0.02_f64) {
        let mut p = parameters(&[passive(which, strength, scale)]);
        for b in p.section.iter_mut().flat_map(|s| &mut s.bellows) {
            b.damping = 0.0;
        }
        let arm = Arc::new(Arm::new(&p).unwrap());
        let input = Input::new(vec![0.0], (vec![101_325.0; 9], 9), (Vec::new(), 0), Interpolation::Linear).unwrap();
        let mut x: Vec<f64> = (0..9).map(|k| 0.17 + bend * (1.3 * f64::from(k)).sin()).collect();
        x.extend([0.0; 9]);
        let mut plant = Plant::new(arm.clone(), Arc::new(input));
        let mut integrator = Integrator::new(Options { rtol: 1e-8, atol: 1e-10, ..Options::default() }, 0.0, &x);
        let mut ws = Workspace::new(&arm);
        let mut total = |x: &[f64]| energy(&arm, &x[..9], &x[9..], &mut ws).total();
        let start = total(&x);
        let mut most = f64::NEG_INFINITY;
        let times: Vec<f64> = (1..60).map(|k| 0.01 * f64::from(k)).collect();
        integrator.run(&mut plant, &times, &mut |_, x| most = most.max(total(x)), &mut || false).unwrap();
        prop_assert!(most - start < 2e-6, "{:?}: {:.2e} J appeared", p.effect, most - start);
    }
}
