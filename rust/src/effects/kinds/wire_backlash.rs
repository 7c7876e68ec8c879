//! Play of a wire sensor: what it reads follows the length only when the play is used up.
//!
//! Source: play operator (Krasnosel'skii & Pokrovskii, *Systems with Hysteresis*, 1989): the reading y stays while |q - y| <= play
//! and is dragged along at that distance beyond: a wire that lies slack in its guide, a drum with lost motion.
//! Place: `bellows 32` is the sensor of q32. Hidden: y; at first the length. After the sensor's delay, before gains and
//! offsets; several in one place are one with the sum of their plays, as plays one behind the other are.
//! Update: exact along a motion that does not turn back within a step, second order at turns.

use crate::effects::{Definition, Effect, Parameter, PlaceKind};
use crate::real::Real;
use std::ops::Range;

/// Play of a sensor.
#[derive(Clone, Debug)]
pub struct WireBacklash<T> {
    play: T,
    lengths: Range<usize>,
}

impl<T: Real> Effect<T> for WireBacklash<T> {
    const SUMMARY: &'static str = "play of a length sensor: it follows only beyond it";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section, PlaceKind::Bellows];
    const PARAMETERS: &'static [Parameter] =
        &[Parameter::new("play", "m", 0.0..=0.05, "half the width of the play: reading and length differ by up to it")];

    fn new(definition: &Definition, values: &[T]) -> Self {
        Self { play: values[0], lengths: definition.target.lengths.clone() }
    }

    fn play(&self, coordinate: usize) -> Option<T> {
        self.lengths.contains(&coordinate).then_some(self.play)
    }
}
