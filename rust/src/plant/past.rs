//! The past of a plant: what its inputs say before a run begins, which pressures that lag behind still know then.

use super::Plant;
use crate::effects::Effect;
use crate::effects::kinds::pressure_lag::PressureLag;
use crate::real::Real;

/// `next`, or a moment after `now`: on another clock a sample may round to where it has been reached, again and again.
fn beyond(now: f64, next: f64) -> f64 {
    next.max(now + 1e-9)
}

impl<T: Real> Plant<T> {
    /// The same plant, whose run begins in the middle of its inputs: pressures that lag behind are at first what the inputs
    /// before have led to, from their first samples on, at which they were at rest. Not so behind valves and chambers
    /// (`full`), which depend on how the arm moved.
    pub fn preceded(self) -> Self {
        Self { preceded: true, ..self }
    }

    /// The same plant, whose run begins in a motion: of each bellows, where between the ends of what effects on it, on its
    /// input and on its sensor remember these stand, -1 to 1 and no further; 0 where they would be without.
    pub fn moved(self, moved: Vec<T>) -> Self {
        let within = moved.into_iter().map(|m| m.max(-T::one()).min(T::one())).collect();
        Self { moved: Some(within), ..self }
    }

    /// Puts what is remembered where [`Plant::moved`] has it.
    pub(super) fn move_memories(&mut self) {
        let Some(moved) = &self.moved else { return };
        let (body, effects) = (&self.arm.body, &self.arm.effects);
        let hidden = self.ws.effects.hidden_mut();
        hidden.copy_from_slice(&effects.start());
        for entry in &effects.list {
            entry.kind.moved(moved, &mut hidden[entry.hidden.clone()]);
        }
        if let Some(chain) = &mut self.chain {
            let mut of_inputs = vec![T::zero(); body.inputs];
            // Bellows that share an input share its past.
            for (bellows, own) in body.sections.iter().flat_map(|s| &s.bellows).zip(moved) {
                of_inputs[bellows.input] = *own;
            }
            chain.moved(effects, &of_inputs);
        }
        if let Some(sensors) = &mut self.sensors {
            sensors.moved(moved);
        }
    }

    /// From when on the inputs are followed in a run that begins at `t`: from there, or from their first sample.
    pub(super) fn since(&self, t: f64) -> f64 {
        if self.preceded { self.drives.first_sample().min(t) } else { t }
    }

    /// Pressures behind the lag at `t` as the inputs have led to them, into `out`.
    pub(super) fn lagged_into(&mut self, t: f64, out: &mut [T]) {
        let Some(p) = &self.arm.pneumatics else { return };
        let lag = PressureLag::of_all(p.fill_time, p.vent_time, self.arm.body.inputs);
        let (mut from, mut to) = (out.to_vec(), out.to_vec());
        let mut now = self.drives.first_sample().min(t);
        self.drives.pressures(now, false, out);
        while now < t {
            let next = beyond(now, self.drives.next_jump(now).min(self.drives.next_bend(now))).min(t);
            self.drives.pressures(now, false, &mut from);
            self.drives.pressures(next, true, &mut to);
            lag.pressures(T::from_f64(next - now), &from, out, &mut to);
            out.copy_from_slice(&to);
            now = next;
        }
    }

    /// The chain over what the inputs say from `since`, where it stands, to `t`.
    pub(super) fn follow(&mut self, since: f64, t: f64) {
        let Some(chain) = &mut self.chain else { return };
        let mut now = since;
        while now < t {
            let next = beyond(now, self.drives.next_jump(now).min(chain.next_jump(&self.drives, now))).min(t);
            chain.begin_step(&self.arm.effects, &mut self.drives, now, next);
            // As alone: an input that begins later bends nothing before.
            chain.skip(self.drives.first_samples().min(T::from_f64(next)));
            chain.end_step(&self.arm.effects, &mut self.drives, next);
            now = next;
        }
    }
}
