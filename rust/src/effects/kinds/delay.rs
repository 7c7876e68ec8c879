//! Dead time of inputs or of sensors.
//!
//! Form: p(t - time) acts; or, of sensors, q(t - time) is measured. Places: `all` and `input p13` delay inputs; `sensors`,
//! `section 2` and `bellows 32` delay length sensors; `sensors` and `section 2` delay the measured poses of the heads with
//! them; `heads` delays these alone, as the latency of a camera beside wires does. A run without feedback cannot tell a delay common to all inputs from one common to all sensors.
//! Limits: before the first sample the first one holds; a held (not interpolated) input has no derivative by the delay, so
//! dual numbers see none there.

use crate::effects::{Definition, Effect, Parameter, Place, PlaceKind};
use crate::real::Real;
use std::ops::Range;

/// Dead time.
#[derive(Clone, Debug)]
pub struct Delay<T> {
    time: T,
    inputs: Range<usize>,
    lengths: Range<usize>,
    heads: Range<usize>,
}

impl<T: Real> Effect<T> for Delay<T> {
    const SUMMARY: &'static str = "dead time of inputs, or of sensors of lengths and heads";
    const PLACES: &'static [PlaceKind] = &[
        PlaceKind::All,
        PlaceKind::Input,
        PlaceKind::Sensors,
        PlaceKind::Section,
        PlaceKind::Bellows,
        PlaceKind::Heads,
    ];
    const PARAMETERS: &'static [Parameter] = &[Parameter::new("time", "s", 0.0..=10.0, "dead time")];

    fn new(definition: &Definition, values: &[T]) -> Self {
        let target = &definition.target;
        let (inputs, lengths, heads) = match definition.place {
            Place::All | Place::Input(_) => (target.inputs.clone(), 0..0, 0..0),
            Place::Sensors | Place::Section(_) => (0..0, target.lengths.clone(), target.sections.clone()),
            Place::Bellows(..) => (0..0, target.lengths.clone(), 0..0),
            Place::Heads => (0..0, 0..0, target.sections.clone()),
        };
        Self { time: values[0], inputs, lengths, heads }
    }

    fn input_delay(&self, input: usize) -> Option<T> {
        self.inputs.contains(&input).then_some(self.time)
    }

    fn sensor_delay(&self, coordinate: usize) -> Option<T> {
        self.lengths.contains(&coordinate).then_some(self.time)
    }

    fn head_delay(&self, section: usize) -> Option<T> {
        self.heads.contains(&section).then_some(self.time)
    }
}
