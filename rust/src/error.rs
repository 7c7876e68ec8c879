//! Errors of the core. Each says what was found, where and what is allowed; `python/errors.rs` turns them into the
//! exceptions of `bha.errors`, in one place.

use thiserror::Error;

/// Everything that can go wrong in the core.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum Error {
    /// A parameter of an arm is out of its range.
    #[error("{place}: {key} = {found}; {allowed}")]
    Parameter {
        /// The part of the arm, e.g. `section 2, bellows 1`.
        place: String,
        /// The key of the parameter file.
        key: &'static str,
        /// What was found.
        found: String,
        /// What is allowed.
        allowed: &'static str,
    },
    /// An effect of an arm is wrong.
    #[error("{place}: {key}: found {found}; {allowed}")]
    Effect {
        /// Which effect.
        place: String,
        /// The key of its table.
        key: &'static str,
        /// What was found.
        found: String,
        /// What is allowed.
        allowed: String,
    },
    /// An argument has the wrong size or value.
    #[error("{0}")]
    Input(String),
    /// A simulation could not go on.
    #[error("the simulation stopped at t = {time} s: {reason}")]
    Simulation {
        /// Time of the last good state, s.
        time: f64,
        /// What happened and what may help.
        reason: String,
    },
    /// The caller asked to stop.
    #[error("interrupted")]
    Interrupted,
    /// An iteration did not converge.
    #[error("{0}")]
    Convergence(String),
}

impl Error {
    /// The same with its time on a clock that is `ahead` s ahead.
    pub fn on_clock(self, ahead: f64) -> Self {
        match self {
            Self::Simulation { time, reason } => Self::Simulation { time: time + ahead, reason },
            other => other,
        }
    }
}

/// Results of the core.
pub type Result<T> = std::result::Result<T, Error>;
