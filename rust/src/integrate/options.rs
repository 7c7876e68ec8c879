//! How to integrate, and what it cost.

use super::tableau::Method;

/// How to step.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// The method.
    pub method: Method,
    /// Longest step of a fixed-step method, s.
    pub step: f64,
    /// Relative tolerance of an adaptive method.
    pub rtol: f64,
    /// Absolute tolerance of an adaptive method (in the state's units: m, m/s; Rodas4 allows rates 100 times as much).
    pub atol: f64,
    /// Shortest step of an adaptive method, s; a shorter one needed is an error.
    pub min_step: f64,
    /// Longest step of an adaptive method, s.
    pub max_step: f64,
    /// Most steps in all, rejected ones included.
    pub max_steps: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            method: Method::DormandPrince54,
            step: 1e-3,
            rtol: 1e-6,
            atol: 1e-8,
            min_step: 1e-10,
            max_step: f64::INFINITY,
            max_steps: u64::MAX,
        }
    }
}

/// What a run cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Accepted steps.
    pub steps: u64,
    /// Rejected steps.
    pub rejected_steps: u64,
    /// Evaluations of the right-hand side.
    pub evaluations: u64,
}
