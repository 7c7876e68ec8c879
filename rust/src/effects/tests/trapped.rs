//! Air that closed valves shut in: a spring without delay, whatever effects lie between valves and bellows.

use super::{EffectParameters, arm, effect, parameters};
use crate::arm::Arm;
use crate::body::parameters::{ArmParameters, PneumaticsLevel};
use crate::dynamics::Workspace;
use crate::dynamics::energy::energy;
use crate::dynamics::terms::generalized_force_into;
use crate::forces::ForceSet;
use crate::integrate::{Method, Options};
use crate::plant::input::{Input, Interpolation};
use crate::pneumatics::Chambers;
use crate::pneumatics::chamber::{Volume, volumes};
use crate::run::simulation::{Rows, Simulation};
use std::sync::Arc;

const AMBIENT: f64 = 101_325.0;
const EXPONENT: f64 = 1.3;

/// The nominal arm with valves that stay closed, its bellows damped or not, its air at 1.25 bar where it starts.
fn closed(effects: &[EffectParameters], damped: bool) -> ArmParameters {
    let mut p = parameters(effects);
    p.pneumatics = Some(crate::pneumatics::testing::parameters(PneumaticsLevel::Full));
    if let Some(air) = &mut p.pneumatics {
        air.polytropic_exponent = Some(EXPONENT);
        air.spool_dead_band = Some(0.5);
        (air.proportional_gain, air.integral_gain) = (Some(0.0), Some(0.0));
    }
    if !damped {
        p.section.iter_mut().flat_map(|s| &mut s.bellows).for_each(|b| b.damping = 0.0);
    }
    p
}

fn run(p: &ArmParameters, times: &[f64]) -> Rows {
    let input = Input::new(vec![0.0], (vec![1.25e5; 9], 9), (Vec::new(), 0), Interpolation::Linear).unwrap();
    let q: Vec<f64> = (0..9).map(|k| 0.19 + 0.015 * (1.3 * f64::from(k)).sin()).collect();
    let options = Options { method: Method::Rk4, step: 1e-3, ..Options::default() };
    let arm = Arc::new(Arm::new(p).unwrap());
    let mut simulation = Simulation::new(arm, Arc::new(input), options, 0.0, Some(&q), None).unwrap();
    let (rows, result) = simulation.advance(times, &mut || false);
    result.unwrap();
    rows
}

fn times() -> Vec<f64> {
    (0..=200).map(|k| 0.02 * f64::from(k)).collect()
}

/// Each kind of effect that remembers pressures, for some lags short and long.
fn remembering() -> Vec<EffectParameters> {
    vec![
        effect("pressure_lag", "all", &[("fill", 0.03), ("vent", 0.05)]),
        effect("pressure_lag", "all", &[("fill", 0.1), ("vent", 0.1)]),
        effect("delay", "all", &[("time", 0.04)]),
        effect("valve_dead_band", "all", &[("band", 3e3)]),
    ]
}

#[test]
fn what_delays_air_does_not_delay_the_spring_that_trapped_air_is() {
    let plain = run(&closed(&[], true), &times());
    let off = |rows: &Rows, from: usize| {
        let last = &rows.lengths[9 * 200..];
        rows.lengths[9 * from..]
            .chunks(9)
            .flat_map(|q| q.iter().zip(last))
            .fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()))
    };
    // It swings, and the swing dies out.
    let (early, late) = (off(&plain, 0), off(&plain, 150));
    assert!(early > 5e-3 && late < 0.2 * early, "{early} {late}");
    for effect in remembering() {
        let delayed = run(&closed(std::slice::from_ref(&effect), true), &times());
        let apart = delayed.lengths.iter().zip(&plain.lengths).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(apart < 1e-9, "{effect:?}: {apart:.1e} m apart");
    }
}

/// Energy of the air above its rest at ambient pressure: what it gives by expanding, less what the surroundings take.
fn of_air(p: f64, v: f64) -> f64 {
    p * v / (EXPONENT - 1.0) + AMBIENT * v
}

#[test]
fn trapped_air_keeps_its_energy() {
    // (1 + g) (p - p_amb) + o acts in place of p - p_amb.
    let (gain, offset) = (0.15, -2e3);
    let reading = [
        effect("pressure_gain", "all", &[("gain", gain)]),
        effect("pressure_lag", "all", &[("fill", 0.05), ("vent", 0.08)]),
        effect("pressure_offset", "all", &[("offset", offset)]),
    ];
    let mut cases: Vec<_> = remembering().into_iter().map(|e| (vec![e], 0.0, 0.0)).collect();
    cases.push((reading.to_vec(), gain, offset));
    for (effects, gain, offset) in cases {
        let p = closed(&effects, false);
        let rows = run(&p, &times());
        let arm = Arm::new(&p).unwrap();
        let mut ws = Workspace::new(&arm);
        let total: Vec<f64> = (0..rows.count)
            .map(|k| {
                let row = 9 * k..9 * k + 9;
                let (q, qd, pressures) =
                    (&rows.lengths[row.clone()], &rows.velocities[row.clone()], &rows.pressures[row]);
                let mut v = vec![Volume::rigid(0.0); 9];
                volumes(&arm.body, 1e-4, q, &mut v);
                let air: f64 = pressures
                    .iter()
                    .zip(&v)
                    .map(|(p, v)| (1.0 + gain) * of_air(*p, v.at_ambient) - offset * v.at_ambient)
                    .sum();
                energy(&arm, q, qd, &mut ws).total() + air
            })
            .collect();
        let moved = total.iter().fold(0.0_f64, |m, e| m.max((e - total[0]).abs()));
        let swing = energy(&arm, &rows.lengths[9 * 40..9 * 41], &rows.velocities[9 * 40..9 * 41], &mut ws).kinetic();
        assert!(swing > 1e-3 && moved < 2e-3 * swing, "{effects:?}: {moved:.1e} J of {swing:.1e} J");
    }
}

/// One section whose three bellows share an input, with areas that change differently.
fn shared(effects: &[EffectParameters]) -> Arm {
    let mut p = closed(effects, true);
    p.section.truncate(1);
    p.inputs.truncate(1);
    for (k, b) in p.section[0].bellows.iter_mut().enumerate() {
        b.input = 0;
        b.terminal_area *= 1.0 + 0.2 * k as f64;
    }
    Arm::new(&p).unwrap()
}

#[test]
fn trapped_air_does_no_work_around_a_closed_path() {
    let effects = [
        effect("effective_area", "bellows 11", &[("by_pressure", 3e-6), ("by_length", 4.0)]),
        effect("effective_area", "bellows 12", &[("by_pressure", -1e-6), ("by_length", -2.0)]),
        effect("effective_area", "all", &[("by_pressure", 5e-7)]),
        effect("pressure_stiffness", "all", &[("axial", 2e-6), ("bending", -8e-6)]),
    ];
    let arm = shared(&effects);
    let pneumatics = arm.pneumatics.as_ref().unwrap();
    let at = |angle: f64| {
        let (sin, cos) = angle.sin_cos();
        let q = [0.2 + 0.05 * cos, 0.18 + 0.04 * sin, 0.21 + 0.03 * (2.0 * angle).sin()];
        let slope = [-0.05 * sin, 0.04 * cos, 0.06 * (2.0 * angle).cos()];
        (q, slope)
    };
    let mut chambers = Chambers::new(pneumatics, &arm.body, &at(0.0).0, &[1.6e5]);
    let mut ws = Workspace::new(&arm);
    // The same loop with pressures of the volume that does not know of the areas.
    let plain = shared(&[]);
    let mut ignorant = Chambers::new(plain.pneumatics.as_ref().unwrap(), &plain.body, &at(0.0).0, &[1.6e5]);
    let actuation = ForceSet { actuation: true, ..ForceSet::NONE };
    let (mut work, mut wrong, mut size, count) = (0.0, 0.0, 0.0, 200);
    for k in 0..count {
        let (q, slope) = at(std::f64::consts::TAU * f64::from(k) / f64::from(count));
        let (mut p, mut force) = ([0.0], [0.0; 3]);
        chambers.pressures(pneumatics, &arm.body, 0.0, &q, &mut p);
        generalized_force_into(&arm, actuation, (&q, &[]), &p, None, &mut ws, &mut force);
        let power = |force: &[f64]| force.iter().zip(slope).map(|(f, s)| f * s).sum::<f64>() / f64::from(count);
        (work, size) = (work + power(&force), size + power(&force).abs());
        ignorant.pressures(plain.pneumatics.as_ref().unwrap(), &plain.body, 0.0, &q, &mut p);
        generalized_force_into(&arm, actuation, (&q, &[]), &p, None, &mut ws, &mut force);
        wrong += power(&force);
    }
    assert!(work.abs() < 1e-11 * size, "{work:.1e} of {size:.1e}");
    assert!(wrong.abs() > 1e-3 * size, "the loop does not see areas: {wrong:.1e} of {size:.1e}");
}

#[test]
fn volumes_belong_to_areas() {
    // dV/dq at held pressure is dF/dp, and rates are derivatives.
    let effects = [
        effect("effective_area", "all", &[("by_pressure", 2e-6), ("by_length", 3.0)]),
        effect("pressure_stiffness", "section 2", &[("axial", -1e-6), ("bending", 5e-6)]),
    ];
    let arm = arm(&effects);
    let (q, qd) = super::state();
    let mut ws = Workspace::new(&arm);
    let actuation = ForceSet { actuation: true, ..ForceSet::NONE };
    let mut force = |gauge: f64| {
        let mut out = vec![0.0; 9];
        generalized_force_into(&arm, actuation, (&q, &[]), &[AMBIENT + gauge; 9], None, &mut ws, &mut out);
        out
    };
    let (gauge, h) = (4e4, 1.0);
    let by_pressure: Vec<f64> =
        force(gauge + h).iter().zip(force(gauge - h)).map(|(a, b)| (a - b) / (2.0 * h)).collect();
    let whole = |q: &[f64]| {
        let mut out = vec![Volume::rigid(0.0); 9];
        volumes(&arm.body, 1e-4, q, &mut out);
        out.iter().map(|v| v.at(gauge)).collect::<Vec<_>>()
    };
    let mut rates = vec![Volume::rigid(0.0); 9];
    crate::pneumatics::chamber::volume_rates(&arm.body, (&q, &qd), &mut rates);
    let mut expected = vec![0.0; 9];
    for k in 0..9 {
        let moved = |s: f64| q.iter().enumerate().map(|(j, x)| x + s * f64::from(j == k)).collect::<Vec<_>>();
        let (more, less) = (whole(&moved(1e-6)), whole(&moved(-1e-6)));
        let slopes: Vec<f64> = more.iter().zip(less).map(|(a, b)| (a - b) / 2e-6).collect();
        let slope: f64 = slopes.iter().sum();
        assert!((slope - by_pressure[k]).abs() < 1e-8 * slope.abs(), "{k}: {slope} {}", by_pressure[k]);
        expected.iter_mut().zip(slopes).for_each(|(rate, slope)| *rate += slope * qd[k]);
    }
    for (rate, expected) in rates.iter().zip(expected) {
        assert!((rate.at(gauge) - expected).abs() < 1e-7 * 2e-3, "{} {expected}", rate.at(gauge));
    }
}
