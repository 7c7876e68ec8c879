//! Members of a batch in lanes: those that take the same steps, in the lanes of one instruction set.
//!
//! A lane that diverges is parked (`run::parking`): its member's rows end.

use super::sequences::Sequences;
use super::{Batch, Member, Slot};
use crate::arm::Arm;
use crate::arm::structure::in_lanes;
use crate::effects::poses;
use crate::integrate::{Integrator, System};
use crate::kinematics::link::Link;
use crate::kinematics::section::Pose;
use crate::plant::Plant;
use crate::plant::stiffness::explained;
use crate::real::lanes::AnyLanes;
use crate::real::linear::{Mat3, Vec3};
use crate::real::{Kernel, Real};
use crate::run::parking::Parking;
use crate::run::simulation::initial_state;
use std::marker::PhantomData;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Some members, with where their results go.
pub(super) struct Block<'a, 'b> {
    pub batch: &'a Batch<'a>,
    pub members: Vec<(&'a Member<'a>, Slot<'b>)>,
    pub sequences: &'a Sequences,
    pub stop: &'a AtomicBool,
}

impl AnyLanes for Block<'_, '_> {
    type Output = ();

    fn with<T: Real>(self) {
        let Self { batch, members, sequences, stop } = self;
        // Whoever cannot start, or starts where no simulation may be, says so alone.
        let (mut ready, mut states) = (Vec::new(), Vec::new());
        for (member, slot) in members {
            let (arm, input) = (&batch.arms[member.arm], &batch.inputs[member.input]);
            let state = match member.state {
                Some(x) => Ok(x.to_vec()),
                None => initial_state(arm, input, member.start - input.origin(), None, None),
            };
            match state {
                Ok(x) if T::LANES > 1 && Plant::new(arm.clone(), input.clone()).objection(&x).is_none() => {
                    ready.push((member, slot));
                    states.push(x);
                }
                _ => batch.run_member(member, slot, sequences, stop),
            }
        }
        for (members, states) in in_chunks(ready, T::LANES).zip(states.chunks(T::LANES)) {
            if members.len() == 1 {
                members.into_iter().for_each(|(member, slot)| batch.run_member(member, slot, sequences, stop));
            } else {
                run_in_lanes(PhantomData::<T>, batch, members, states, (sequences, stop));
            }
        }
    }
}

/// `items` in chunks of at most `lanes`.
fn in_chunks<I>(items: Vec<I>, lanes: usize) -> impl Iterator<Item = Vec<I>> {
    let mut items = items.into_iter();
    std::iter::from_fn(move || {
        let chunk: Vec<I> = items.by_ref().take(lanes).collect();
        (!chunk.is_empty()).then_some(chunk)
    })
}

/// Runs at most `T::LANES` members, lane by lane from lane 0 on; lanes that are left repeat the last one.
fn run_in_lanes<'m, T: Real>(
    _lanes: PhantomData<T>,
    batch: &Batch<'_>,
    mut members: Vec<(&'m Member<'m>, Slot<'_>)>,
    states: &[Vec<f64>],
    (sequences, stop): (&Sequences, &AtomicBool),
) {
    let used = members.len();
    let first = members[0].0;
    // When members start, on their inputs' clocks.
    let local = |m: &Member<'_>| m.start - batch.inputs[m.input].origin();
    let same_input = members.iter().all(|(m, _)| m.start == first.start && m.input == first.input);
    let arms: Vec<&Arm> = members.iter().map(|(m, _)| &*batch.arms[m.arm]).collect();
    let arm = Arc::new(if arms.iter().all(|a| std::ptr::eq(*a, arms[0])) { arms[0].lift() } else { in_lanes(&arms) });
    let x0: Vec<T> = (0..states[0].len()).map(|j| T::from_lanes(|k| states[k.min(used - 1)][j])).collect();
    // On the inputs' own clock where all start at the same time, else on one that starts at 0.
    let start = if members.iter().all(|(m, _)| local(m) == local(first)) { local(first) } else { 0.0 };
    let drive = |k: usize| {
        let member = members[k.min(used - 1)].0;
        (batch.inputs[member.input].clone(), local(member) - start)
    };
    let inputs = (0..if same_input { 1 } else { T::LANES }).map(drive).collect();
    let times: Vec<f64> = first.times.iter().map(|t| t - first.start + start).collect();
    let plant = Plant::in_lanes(arm.clone(), inputs);
    let plant = if first.state.is_some() { plant.preceded() } else { plant };
    let plant = plant.with_pneumatics(start, &x0[..arm.coordinates()]);
    let moved = |k: usize, j: usize| members[k.min(used - 1)].0.moved.map_or(0.0, |m| m[j]);
    let plant = if members.iter().any(|(m, _)| m.moved.is_some()) {
        plant.moved((0..arm.bellows()).map(|j| T::from_lanes(|k| moved(k, j))).collect())
    } else {
        plant
    };
    let options = plant.suited(batch.options);
    let system = Parking::new(plant, x0.clone(), members.iter().map(|(m, _)| m.start - start).collect());
    let mut integrator = Integrator::new(options, start, &x0).keeping();
    if let Some(steps) = sequences.of(batch, first, stop) {
        integrator = integrator.following(steps.from(start));
    }
    let run = Run {
        integrator,
        links: vec![Link::base(); arm.body.sections.len()],
        arm: &arm,
        system,
        times: &times,
        members: &mut members,
        measured: batch.channels.measured,
        stop,
    };
    T::enter(run);
    for ((member, slot), x) in members.into_iter().zip(states) {
        if let Some(error) = slot.failure.take() {
            let (arm, input) = (&batch.arms[member.arm], &batch.inputs[member.input]);
            *slot.failure = Some(explained(error, options, arm, input, local(member), x));
        }
    }
}

/// A block's run as a kernel.
struct Run<'a, 'm, 's, T> {
    integrator: Integrator<T>,
    system: Parking<T>,
    arm: &'a Arm<T>,
    links: Vec<Link<T>>,
    times: &'a [f64],
    members: &'a mut [(&'m Member<'m>, Slot<'s>)],
    /// Whether lengths and heads are to be those that the sensors read.
    measured: bool,
    stop: &'a AtomicBool,
}

impl<T: Real> Kernel for Run<'_, '_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { mut integrator, mut system, arm, mut links, times, members, measured, stop } = self;
        let n = arm.coordinates();
        let mut heads = vec![Pose { rotation: Mat3::identity(), position: Vec3::zero() }; arm.body.sections.len()];
        let wanted = members.iter().any(|(_, slot)| slot.heads());
        // Readings of the sensors, where they are wanted and modelled.
        if measured {
            system.plant.begin(integrator.time(), integrator.state());
        }
        let measured = measured && system.plant.has_sensors();
        let mut read = vec![T::zero(); n];
        let mut result = Ok(());
        for (row, time) in times.iter().enumerate() {
            let mut sink = |_: f64, x: &[T]| {
                if wanted {
                    poses::seen(&arm.body, &arm.effects, &x[..n], &mut links, |i, head| heads[i] = head);
                }
                for (k, (_, slot)) in members.iter_mut().enumerate() {
                    slot.write(row, n, |j| x[j].lane(k), |i| Some(heads[i].lane(k)));
                }
            };
            result = integrator
                .run(&mut system, std::slice::from_ref(time), &mut sink, &mut || stop.load(Ordering::Relaxed));
            if measured && result.is_ok() {
                system.plant.measured_lengths_into(*time, integrator.state(), &mut read);
                let x = integrator.state();
                if wanted && system.plant.changes_heads() {
                    system.plant.measured_heads(*time, x, &mut links, |i, head| heads[i] = head);
                }
                for (k, (_, slot)) in members.iter_mut().enumerate() {
                    let value = |j: usize| if j < n { read[j].lane(k) } else { x[j].lane(k) };
                    slot.write(row, n, value, |i| Some(heads[i].lane(k)));
                }
            }
            // Rows written for a lane that had failed before this row are taken back.
            for ((_, slot), failure) in members.iter_mut().zip(system.failures()) {
                if failure.is_some() && result.is_ok() {
                    slot.write(row, n, |_| f64::NAN, |_| None);
                }
            }
            if result.is_err() {
                break;
            }
        }
        let statistics = integrator.statistics();
        for (k, (_, slot)) in members.iter_mut().enumerate() {
            *slot.failure = system.failure(k, result.as_ref().err());
            *slot.statistics = statistics;
        }
    }
}
