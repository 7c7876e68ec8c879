//! Heads as they are measured: a delay moves them, gains and offsets of lengths do not.

use super::{arm, effect};
use crate::arm::Arm;
use crate::body::parameters::EffectParameters;
use crate::integrate::{Method, Options};
use crate::plant::input::{Input, Interpolation};
use crate::real::lanes::InstructionSet;
use crate::run::batch::{Batch, Channels, Member};
use crate::run::simulation::{Rows, Simulation};
use std::sync::Arc;

/// Two seconds of smooth pressures on nine inputs, Pa.
fn swing() -> Arc<Input> {
    let times: Vec<f64> = (0..=200).map(|k| 0.01 * f64::from(k)).collect();
    let pressure = |t: f64, j: usize| 1.2e5 + 2e4 * (3.0 * t + j as f64).sin() * (1.0 - (-4.0 * t).exp());
    let pressures = times.iter().flat_map(|t| (0..9).map(move |j| pressure(*t, j))).collect();
    Arc::new(Input::new(times, (pressures, 9), (Vec::new(), 0), Interpolation::Linear).unwrap())
}

fn options() -> Options {
    Options { method: Method::Rk4, step: 1e-3, ..Options::default() }
}

fn run(arm: Arm, times: &[f64]) -> Rows {
    let mut simulation = Simulation::new(Arc::new(arm), swing(), options(), 0.0, None, None).unwrap();
    let (rows, result) = simulation.advance(times, &mut || false);
    result.unwrap();
    rows
}

/// Positions and orientations of head `i`, row by row, as measured or as they are.
fn head(rows: &Rows, i: usize, measured: bool) -> Vec<f64> {
    let (positions, orientations) = if measured {
        (&rows.measured_head_positions, &rows.measured_head_orientations)
    } else {
        (&rows.head_positions, &rows.head_orientations)
    };
    let (n, count) = (3, rows.count);
    assert_eq!((positions.len(), orientations.len()), (3 * n * count, 4 * n * count));
    (0..count)
        .flat_map(|r| {
            let (p, o) = (3 * (n * r + i), 4 * (n * r + i));
            [&positions[p..p + 3], &orientations[o..o + 4]].concat()
        })
        .collect()
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).fold(0.0, |m, (a, b)| (a - b).abs().max(m))
}

/// Effects of poses, which belong to what is measured.
fn poses() -> Vec<EffectParameters> {
    vec![effect("torsion", "section 3", &[("stiffness", 20.0)]), effect("torsion", "section 1", &[("stiffness", 35.0)])]
}

#[test]
fn delayed_heads_are_earlier_ones() {
    let times: Vec<f64> = (0..60).map(|k| 0.1 + 0.03 * f64::from(k)).collect();
    let plain = arm(&poses());
    let earlier = |by: f64| run(plain.clone(), &times.iter().map(|t| (t - by).max(0.0)).collect::<Vec<_>>());
    let now = earlier(0.0);
    assert!(now.measured_head_positions.is_empty() && now.measured_head_orientations.is_empty());
    let delays = [
        effect("delay", "sensors", &[("time", 0.0123)]),
        effect("delay", "section 2", &[("time", 0.05)]),
        // Neither of these moves a head.
        effect("delay", "bellows 31", &[("time", 0.02)]),
        effect("length_offset", "section 1", &[("offset", 2e-3)]),
        effect("length_gain", "bellows 12", &[("gain", 0.05)]),
    ];
    let delayed = run(arm(&[poses().as_slice(), &delays].concat()), &times);
    let (late, later) = (earlier(0.0123), earlier(0.0623));
    for (i, expected) in [(0, &late), (1, &later), (2, &late)] {
        // Where the heads truly are, a delay of their measurement does not show; where they are seen it does.
        assert!(largest_difference(&head(&delayed, i, false), &head(&now, i, false)) < 1e-12);
        assert!(largest_difference(&head(&delayed, i, true), &head(expected, i, false)) < 1e-6);
        assert!(largest_difference(&head(&delayed, i, true), &head(&now, i, false)) > 1e-4);
    }
    let lengths_only = run(arm(&delays[2..]), &times);
    assert!(lengths_only.measured_head_positions.is_empty() && !lengths_only.measured_lengths.is_empty());
}

#[test]
fn a_delay_of_a_section_is_one_of_its_sensors() {
    let delayed = run(arm(&[effect("delay", "section 1", &[("time", 0.3)])]), &[0.5, 1.0]);
    let plain = run(arm(&[]), &[0.5, 1.0]);
    // The pressures come when they come.
    assert!(largest_difference(&delayed.lengths, &plain.lengths) < 1e-12);
    let earlier = run(arm(&[]), &[0.2, 0.7]);
    for row in 0..2 {
        let (measured, lengths) = (&delayed.measured_lengths[9 * row..], &plain.lengths[9 * row..]);
        assert!(largest_difference(&measured[..3], &earlier.lengths[9 * row..9 * row + 3]) < 1e-6);
        assert!(largest_difference(&measured[3..9], &lengths[3..9]) < 1e-15);
    }
}

#[test]
fn a_delay_of_heads_moves_no_length() {
    let times = [0.5, 0.9, 1.3];
    let late = run(arm(&[effect("delay", "heads", &[("time", 0.08)])]), &times);
    let earlier = run(arm(&[]), &times.map(|t| t - 0.08));
    assert!(largest_difference(&late.measured_lengths, &late.lengths) < 1e-15);
    for i in 0..3 {
        assert!(largest_difference(&head(&late, i, true), &head(&earlier, i, false)) < 1e-6);
    }
}

#[test]
fn a_marker_is_another_point_of_its_head() {
    let times = [0.4, 0.8, 1.2];
    let (x, y, z) = (0.02, -0.01, 0.05);
    let marked = run(arm(&[effect("marker_offset", "section 2", &[("x", x), ("y", y), ("z", z)])]), &times);
    let plain = run(arm(&[]), &times);
    assert!(largest_difference(&marked.lengths, &plain.lengths) < 1e-15);
    for i in [0, 2] {
        assert!(largest_difference(&head(&marked, i, true), &head(&plain, i, false)) < 1e-15);
    }
    for (seen, own) in head(&marked, 1, true).chunks(7).zip(head(&plain, 1, false).chunks(7)) {
        assert!(largest_difference(&seen[3..], &own[3..]) < 1e-15);
        // v + 2 w (q x v) + 2 q x (q x v) for the unit quaternion (w, q).
        let (w, q) = (own[3], [own[4], own[5], own[6]]);
        let cross = |a: [f64; 3], b: [f64; 3]| {
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        };
        let once = cross(q, [x, y, z]);
        let twice = cross(q, once);
        let expected: Vec<f64> = (0..3).map(|k| own[k] + [x, y, z][k] + 2.0 * (w * once[k] + twice[k])).collect();
        assert!(largest_difference(&seen[..3], &expected) < 1e-12);
    }
}

#[test]
fn a_wire_with_play_follows_when_it_is_used_up() {
    let times: Vec<f64> = (0..=1500).map(|k| 1e-3 * f64::from(k)).collect();
    let plain = run(arm(&[]), &times);
    let effects = [
        effect("wire_backlash", "all", &[("play", 5e-4)]),
        effect("wire_backlash", "bellows 12", &[("play", 3e-4)]),
        effect("length_offset", "bellows 13", &[("offset", 1e-3)]),
    ];
    let measured = run(arm(&effects), &times);
    // The play operator over the true lengths, which the rows show at the end of every step.
    for (j, play, offset) in [(0, 5e-4, 0.0), (1, 8e-4, 0.0), (2, 5e-4, 1e-3), (8, 5e-4, 0.0)] {
        let (mut reading, mut most) = (plain.lengths[j], 0.0_f64);
        for row in 0..times.len() {
            let length = plain.lengths[9 * row + j];
            reading = f64::max(length - play, f64::min(reading, length + play));
            let found = measured.measured_lengths[9 * row + j];
            most = most.max((found - length).abs());
            assert!((found - reading - offset).abs() < 1e-12, "{j} {row}: {found} {reading}");
        }
        assert!(most > 0.99 * play);
    }
    // A simulation that goes on from another's memory reads on.
    let mut first = Simulation::new(Arc::new(arm(&effects)), swing(), options(), 0.0, None, None).unwrap();
    let (begun, ok) = first.advance(&times[..400], &mut || false);
    ok.unwrap();
    let (rest, ok) = first.advance(&times[400..], &mut || false);
    ok.unwrap();
    let parts = [begun.measured_lengths, rest.measured_lengths].concat();
    assert!(largest_difference(&parts, &measured.measured_lengths) < 1e-15);
}

#[test]
fn members_in_lanes_measure_as_they_do_alone() {
    let times: Vec<f64> = (0..25).map(|k| 0.02 * f64::from(k)).collect();
    let delays = |k: usize| {
        let own = [
            effect("delay", "sensors", &[("time", 0.003 * k as f64)]),
            effect("delay", "section 3", &[("time", 0.02 - 0.004 * k as f64)]),
            effect("marker_offset", "section 2", &[("x", 0.01 * k as f64), ("z", 0.03)]),
            effect("wire_backlash", "section 1", &[("play", 1e-4 * k as f64)]),
        ];
        [poses().as_slice(), &own].concat()
    };
    let arms: Vec<_> = (0..5).map(|k| Arc::new(arm(&delays(k)))).collect();
    let inputs = [swing()];
    let members: Vec<_> =
        (0..5).map(|k| Member { arm: k, input: 0, start: 0.0, state: None, moved: None, times: &times }).collect();
    for measured in [true, false] {
        let channels = Channels { head_positions: true, orientations: true, measured, ..Channels::default() };
        let instruction_set = InstructionSet::best();
        let batch = Batch {
            arms: &arms,
            inputs: &inputs,
            members: &members,
            options: options(),
            channels,
            shared_steps: false,
            instruction_set,
        };
        let rows = batch.run(1, &mut |_| false).unwrap();
        assert!(rows.failures.iter().all(Option::is_none));
        for k in 0..5 {
            let alone = run((*arms[k]).clone(), &times);
            let (positions, orientations) = if measured {
                (&alone.measured_head_positions, &alone.measured_head_orientations)
            } else {
                (&alone.head_positions, &alone.head_orientations)
            };
            let (p, o) = (positions.len(), orientations.len());
            assert!(largest_difference(&rows.head_positions[k * p..(k + 1) * p], positions) < 1e-10, "{k}");
            assert!(largest_difference(&rows.head_orientations[k * o..(k + 1) * o], orientations) < 1e-10, "{k}");
        }
    }
}
