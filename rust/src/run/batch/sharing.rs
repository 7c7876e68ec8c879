//! Which members of a batch may share lanes and steps.

use super::{Batch, Member};
use crate::arm::Arm;
use crate::arm::structure::same_structure;
use crate::kinematics::point::Point;

/// Whether two members take the same steps and can so share lanes: the same output times after their start, and jumps of
/// the input, where there are any, at the same times. Those that begin at rest have no past, others may.
pub(super) fn can_share(batch: &Batch<'_>, a: &Member<'_>, b: &Member<'_>) -> bool {
    let (arms, inputs) = ((&batch.arms[a.arm], &batch.arms[b.arm]), (&batch.inputs[a.input], &batch.inputs[b.input]));
    let same_times = (std::ptr::eq(a.times, b.times) && a.start == b.start)
        || a.times.len() == b.times.len()
            && a.times.iter().zip(b.times).all(|(s, t)| {
                let (s, t) = (s - a.start, t - b.start);
                (s - t).abs() <= 1e-12 * (s.abs() + a.start.abs() + b.start.abs())
            });
    // Where starts differ, the block's clock is nobody's: nothing may ask what time it is.
    let timeless = |arm: &Arm| arm.effects.list.iter().all(|e| e.definition.program.is_none());
    let same_clock = a.start == b.start && inputs.0.origin() == inputs.1.origin()
        || timeless(arms.0) && timeless(arms.1) && inputs.0.jumps().is_empty() && inputs.1.jumps().is_empty();
    let same_points = |a: &[Point<f64>], b: &[Point<f64>]| {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a.section, a.fraction) == (b.section, b.fraction))
    };
    let same_input = a.input == b.input
        || inputs.0.force_count() == inputs.1.force_count()
            && same_points(inputs.0.points(), inputs.1.points())
            && inputs.0.jumps() == inputs.1.jumps();
    same_times
        && a.state.is_some() == b.state.is_some()
        && same_clock
        && same_input
        && (a.arm == b.arm || same_structure(arms.0, arms.1) && delays(arms.0).eq(delays(arms.1)))
}

/// How much later jumps and samples of the inputs come to an arm, delay by delay and input by input.
fn delays(arm: &Arm) -> impl Iterator<Item = Option<f64>> {
    arm.effects.list.iter().flat_map(|e| (0..arm.body.inputs).map(|j| e.kind.input_delay(j)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::testing::fixed_parameters;
    use crate::body::parameters::EffectParameters;
    use crate::integrate::Options;
    use crate::plant::input::{Input, Interpolation};
    use crate::real::InstructionSet;
    use crate::run::batch::Channels;
    use std::sync::Arc;

    fn input(times: &[f64], first: f64, interpolation: Interpolation) -> Arc<Input> {
        let pressures = (0..3 * times.len()).map(|k| 1e5 + 1e3 * (first + k as f64)).collect();
        Arc::new(Input::new(times.to_vec(), (pressures, 3), (Vec::new(), 0), interpolation).unwrap())
    }

    #[test]
    fn members_share_a_block_unless_steps_or_clocks_differ() {
        let parameters = fixed_parameters(1);
        let effect = |kind: &str, numbers: &[(&str, f64)], force: Option<&str>| {
            let parameters = numbers.iter().map(|(n, v)| ((*n).to_owned(), *v)).collect();
            let (kind, place) = (kind.to_owned(), "all".to_owned());
            vec![EffectParameters { kind, place, parameters, force: force.map(str::to_owned) }]
        };
        let arm = |effect| {
            Arc::new(Arm::new(&crate::body::parameters::ArmParameters { effect, ..parameters.clone() }).unwrap())
        };
        let delay = |time| arm(effect("delay", &[("time", time)], None));
        let mut heavier = parameters.clone();
        heavier.section[0].mass *= 1.1;
        heavier.effect = effect("delay", &[("time", 0.01)], None);
        let arms = [
            arm(Vec::new()),
            arm(effect("pressure_lag", &[("fill", 0.1), ("vent", 0.2)], None)),
            arm(effect("formula", &[], Some("0.1 * t"))),
            delay(0.01),
            delay(0.02),
            Arc::new(Arm::new(&heavier).unwrap()),
        ];
        let inputs = [
            input(&[0.0, 1.0], 0.0, Interpolation::Linear),
            input(&[0.0, 0.3, 1.0], 3.0, Interpolation::Linear),
            input(&[0.0, 0.5], 0.0, Interpolation::Hold),
            input(&[0.0, 0.5], 5.0, Interpolation::Hold),
            input(&[0.0, 0.6], 0.0, Interpolation::Hold),
        ];
        const NOW: &[f64] = &[0.0, 0.1];
        const LATER: &[f64] = &[0.2, 0.3];
        let batch = Batch {
            arms: &arms,
            inputs: &inputs,
            members: &[],
            options: Options::default(),
            channels: Channels::default(),
            shared_steps: false,
            instruction_set: InstructionSet::Scalar,
        };
        let member =
            |arm, input, times: &'static [f64]| Member { arm, input, start: times[0], state: None, moved: None, times };
        let share = |a: Member<'_>, b: Member<'_>| can_share(&batch, &a, &b) && can_share(&batch, &b, &a);
        for arm in 0..arms.len() {
            // Other inputs; formulas of time and jumps allow no other clock.
            assert!(share(member(arm, 0, NOW), member(arm, 1, NOW)), "{arm}");
            assert_eq!(share(member(arm, 0, NOW), member(arm, 1, LATER)), arm != 2, "{arm}");
            assert!(share(member(arm, 2, NOW), member(arm, 3, NOW)), "{arm}");
            assert!(!share(member(arm, 2, NOW), member(arm, 2, LATER)), "{arm}");
            assert!(!share(member(arm, 2, NOW), member(arm, 4, NOW)), "{arm}");
        }
        // Delays put jumps and samples at times of their own; other structures never go together.
        assert!(!share(member(3, 0, NOW), member(4, 0, NOW)));
        // Arms that differ in other numbers and have the same delay do.
        assert!(share(member(3, 0, NOW), member(5, 0, NOW)));
        assert!(!share(member(0, 0, NOW), member(1, 0, NOW)));
        assert!(!share(member(0, 0, NOW), member(0, 0, &LATER[..1])));
    }
}
