//! The core alone: forward and inverse dynamics, terms, by number of sections. `cargo bench --bench dynamics`.

use bha_core::arm::Arm;
use bha_core::body::parameters::{ArmParameters, BellowsParameters, ForceModel, SectionParameters};
use bha_core::dynamics::Workspace;
use bha_core::dynamics::recursion::{forward_dynamics_into, inverse_dynamics_into};
use bha_core::dynamics::terms::{coriolis_matrix_into, inertia_matrix_into};
use divan::{Bencher, black_box};

fn main() {
    divan::main();
}

/// A nominal section, `sections` times.
fn arm(sections: usize) -> Arm {
    let section = |i: usize| SectionParameters {
        mass: 0.6,
        inertia: [0.004, 0.004, 0.0043],
        center_of_mass: [0.0; 3],
        force_point: None,
        bellows_radius: 0.093,
        base_offset: 0.0,
        head_offset: 0.0,
        bending_stiffness: [3.0, 0.0, 0.0],
        cross_bending_stiffness: None,
        bending_plane: 0.0,
        axial: None,
        length_range: [0.1, 0.3],
        bellows: (0..3)
            .map(|k| BellowsParameters {
                angle: (120.0 * k as f64).to_radians(),
                radius: 0.093,
                terminal_area: 0.0021,
                rest_length: 0.15,
                stiffness: vec![1050.0, 1200.0, 10_000.0],
                damping: 14.0,
                input: 3 * i + k,
            })
            .collect(),
        arcs: Vec::new(),
        masses: Vec::new(),
    };
    Arm::new(&ArmParameters {
        name: "chain".to_owned(),
        base: None,
        gravity: [0.0, 0.0, 9.81],
        ambient_pressure: 101_325.0,
        force_model: ForceModel::EndForce,
        rotational_energy: true,
        coriolis_forces: true,
        inputs: (0..3 * sections).map(|k| format!("p{k}")).collect(),
        section: (0..sections).map(section).collect(),
        pneumatics: None,
        effect: Vec::new(),
    })
    .expect("the parameters are valid")
}

struct State {
    arm: Arm,
    ws: Workspace,
    q: Vec<f64>,
    qd: Vec<f64>,
    p: Vec<f64>,
    out: Vec<f64>,
}

fn state(sections: usize, change: impl Fn(&mut Arm)) -> State {
    let mut arm = arm(sections);
    change(&mut arm);
    let n = arm.coordinates();
    let wave = |k: usize, f: f64| (f * k as f64).sin();
    State {
        ws: Workspace::new(&arm),
        q: (0..n).map(|k| 0.2 + 0.05 * wave(k, 1.3)).collect(),
        qd: (0..n).map(|k| 0.3 * wave(k, 2.1)).collect(),
        p: (0..n).map(|k| 1.2e5 + 2e4 * wave(k, 0.7)).collect(),
        out: vec![0.0; n * n],
        arm,
    }
}

fn forward(bencher: Bencher, mut s: State) {
    bencher.bench_local(|| {
        let n = s.q.len();
        forward_dynamics_into(&s.arm, black_box(&s.q), black_box(&s.qd), &s.p, None, &mut s.ws, &mut s.out[..n]);
        black_box(&s.out);
    });
}

#[divan::bench(args = [1, 3, 10, 30])]
fn forward_dynamics(bencher: Bencher, sections: usize) {
    forward(bencher, state(sections, |_| ()));
}

#[divan::bench]
fn forward_dynamics_without_rotational_energy(bencher: Bencher) {
    forward(bencher, state(3, |a| a.body.rotational_energy = false));
}

#[divan::bench]
fn forward_dynamics_without_coriolis_forces(bencher: Bencher) {
    forward(bencher, state(3, |a| a.body.coriolis_forces = false));
}

#[divan::bench]
fn forward_dynamics_without_both(bencher: Bencher) {
    forward(
        bencher,
        state(3, |a| {
            a.body.rotational_energy = false;
            a.body.coriolis_forces = false;
        }),
    );
}

#[divan::bench]
fn inverse_dynamics(bencher: Bencher) {
    let mut s = state(3, |_| ());
    bencher.bench_local(|| {
        let n = s.q.len();
        inverse_dynamics_into(&s.arm, black_box(&s.q), &s.qd, &s.p, None, &mut s.ws, &mut s.out[..n]);
        black_box(&s.out);
    });
}

#[divan::bench]
fn inertia_matrix(bencher: Bencher) {
    let mut s = state(3, |_| ());
    bencher.bench_local(|| {
        inertia_matrix_into(&s.arm, black_box(&s.q), &mut s.ws, &mut s.out);
        black_box(&s.out);
    });
}

#[divan::bench]
fn coriolis_matrix(bencher: Bencher) {
    let mut s = state(3, |_| ());
    bencher.bench_local(|| {
        coriolis_matrix_into(&s.arm, black_box(&s.q), &s.qd, &mut s.ws, &mut s.out);
        black_box(&s.out);
    });
}
