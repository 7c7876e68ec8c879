//! Effects that the paper's model leaves out: one file each in [`kinds`], all behind one trait, [`Effect`]; the registry
//! is the one macro call in `kinds/mod.rs`, one line a kind. Hooks see the arm's body, not its effects.
//!
//! An effect has a kind, a place and named numbers (`EffectParameters`, the `[[effect]]` tables of a parameter file).
//! Kind and place are structure; the numbers are of the model's scalar, so that lanes and dual numbers can vary them.
//! A kind acts through the hooks of [`Effect`], each of which does nothing unless a kind defines it:
//!
//! | hook | acts on | when |
//! |---|---|---|
//! | [`Effect::change_arm`] | the arm's parameters | once; free at run time |
//! | [`Effect::add_forces`] | bellows forces, bending torques, wrenches on heads | in the one sum, `dynamics::applied` |
//! | [`Effect::pressures`] | pressures between the logged (or commanded) and the acting ones | as time goes on ([`pressures`]) |
//! | [`Effect::measure`], [`Effect::sensor_delay`], [`Effect::play`] | lengths between the true and the measured ones | at output ([`sensors`]) |
//! | [`Effect::see`], [`Effect::head_delay`] | poses of heads between the true and the measured ones | at output ([`sensors`]) |
//! | [`Effect::twist`] | poses of the heads | at output ([`poses`]) |
//!
//! Hidden states (creep, hysteresis, lag) are not integrated with the arm: [`state::EffectState`] keeps their values at a step's
//! start, a hook computes the value at a stage by an exact update from there, and a step's end commits it. However stiff
//! they are, the arm's step does not see it. They start where [`Effect::start`] says, at rest unless a kind has it otherwise.

mod exponential;
pub mod expression;
pub mod kinds;
mod list;
mod place;
pub mod poses;
pub mod pressures;
mod registry;
pub mod sensors;
mod slip;
pub mod state;
#[cfg(test)]
mod tests;
pub mod upstream;

pub use kinds::{KINDS, Kind, KindInfo};
pub use list::{Effects, Entry};
pub use place::{Place, Target};
pub use state::{BellowsState, EffectState, Instant};

use self::kinds::formula;
use crate::body::Body;
use crate::kinematics::section::Pose;
use crate::real::Real;
use std::fmt::Debug;
use std::ops::RangeInclusive;
use std::sync::Arc;

/// What the registry knows of a parameter of a kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Its name.
    pub name: &'static str,
    /// Its unit, empty for a plain number.
    pub unit: &'static str,
    /// The values allowed.
    pub range: RangeInclusive<f64>,
    /// The value where it is left out; none: it must be given.
    pub default: Option<f64>,
    /// What it is.
    pub meaning: &'static str,
}

impl Parameter {
    /// A parameter that must be given.
    pub const fn new(
        name: &'static str,
        unit: &'static str,
        range: RangeInclusive<f64>,
        meaning: &'static str,
    ) -> Self {
        Self { name, unit, range, default: None, meaning }
    }

    /// The same with a default.
    pub const fn or(self, default: f64) -> Self {
        Self { default: Some(default), ..self }
    }
}

/// Where a kind may act.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlaceKind {
    /// The whole arm.
    All,
    /// One section.
    Section,
    /// One bellows; for sensors one length.
    Bellows,
    /// One pressure input.
    Input,
    /// All sensors, where `all` means the inputs.
    Sensors,
    /// What measures the heads: a camera.
    Heads,
}

/// How an effect is defined but for its numbers.
#[derive(Clone, Debug)]
pub struct Definition {
    /// Where it acts, as the file says.
    pub place: Place,
    /// The parts of the arm that this means.
    pub target: Target,
    /// Ambient pressure of the arm, Pa.
    pub ambient_pressure: f64,
    /// The program of a formula.
    pub program: Option<Arc<formula::Program>>,
}

/// A kind of effect.
pub trait Effect<T: Real>: Clone + Debug + Send + Sync {
    /// One line that says what it is.
    const SUMMARY: &'static str;
    /// Where it may act.
    const PLACES: &'static [PlaceKind];
    /// Its numbers, in the order in which [`Effect::new`] takes them.
    const PARAMETERS: &'static [Parameter];
    /// Whether several of this kind in the same place make sense.
    const SEVERAL: bool = false;
    /// Whether it is observable only where poses of heads are measured.
    const NEEDS_POSES: bool = false;

    /// Whether it acts by [`Effect::change_arm`].
    const CHANGES_ARM: bool = false;

    /// The effect; `values` as in [`Effect::PARAMETERS`].
    fn new(definition: &Definition, values: &[T]) -> Self;

    /// What is wrong with these values that their ranges do not say, if anything.
    fn objection(_values: &[f64], _definition: &Definition, _body: &Body<f64>) -> Option<String> {
        None
    }

    /// Changes the arm's parameters, once.
    fn change_arm(&self, _body: &mut Body<T>) {}

    /// Whether its force belongs to tau, since it depends on pressure, and not to N.
    #[inline(always)]
    fn is_actuation(&self) -> bool {
        false
    }

    /// Number of hidden states.
    fn hidden(&self) -> usize {
        0
    }

    /// Where its hidden states start in a simulation; they come as zero, which is no force.
    fn start(&self, _hidden: &mut [T]) {}

    /// The same of an arm that has moved before: `moved` says of each bellows where between the ends of what it can
    /// remember it stands, -1 to 1; 0 changes nothing.
    fn moved(&self, _moved: &[T], _hidden: &mut [T]) {}

    /// Adds its forces at an instant; `hidden` are its states at the step's start.
    #[inline(always)]
    fn add_forces(&self, _now: &mut Instant<'_, T>, _hidden: &[T]) {}

    /// Takes its hidden states from the step's start to an instant.
    #[inline(always)]
    fn advance(&self, _now: &Instant<'_, T>, _hidden: &mut [T]) {}

    /// Whether it acts on pressures.
    fn shapes_pressures(&self) -> bool {
        false
    }

    /// Whether what it makes of a pressure depends on earlier ones: it acts on the air that arrives and leaves then, and
    /// not on air that is shut in.
    #[inline(always)]
    fn remembers(&self) -> bool {
        true
    }

    /// Turns what comes in into what goes out, in place: `p` holds one pressure an input. Over `elapsed` seconds what comes
    /// in has gone from `from` to `p` in a straight line; `last` went out at the start. No time may have passed, in some lanes or in all.
    #[inline(always)]
    fn pressures(&self, _elapsed: T, _from: &[T], _last: &[T], _p: &mut [T]) {}

    /// What comes out when everything rests at the pressures in `p`, in place.
    #[inline(always)]
    fn pressures_at_rest(&self, _p: &mut [T]) {}

    /// By how much what comes out differs where pressures have moved before, Pa, added to what comes in differs; `moved`
    /// says of each input where between the ends of what it can remember it stands, -1 to 1.
    fn moved_pressures(&self, _moved: &[T], _by: &mut [T]) {}

    /// By how much it delays an input, s.
    fn input_delay(&self, _input: usize) -> Option<T> {
        None
    }

    /// By how much it delays the sensor of a length, s.
    fn sensor_delay(&self, _coordinate: usize) -> Option<T> {
        None
    }

    /// By how much it delays what measures the pose of a section's head, s.
    fn head_delay(&self, _section: usize) -> Option<T> {
        None
    }

    /// Half the play of the sensor of a length, m.
    fn play(&self, _coordinate: usize) -> Option<T> {
        None
    }

    /// Whether it acts on measured poses of heads beside delaying them.
    fn shapes_heads(&self) -> bool {
        false
    }

    /// What is seen of the pose of a section's head, in place.
    fn see(&self, _section: usize, _head: &mut Pose<T>) {}

    /// Whether it acts on measured lengths.
    fn shapes_lengths(&self) -> bool {
        false
    }

    /// What the sensor of a coordinate makes of a length.
    #[inline(always)]
    fn measure(&self, _coordinate: usize, length: T) -> T {
        length
    }

    /// By how much a section twists about its head's z axis under the torque about it, N m, and stretched by so much, m; rad.
    fn twist(&self, _section: usize, _torque: T, _stretch: T) -> Option<T> {
        None
    }
}
