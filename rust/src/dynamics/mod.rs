//! Equations of motion M q'' + C q' + N = tau, paper (48): terms, recursion, energy, statics.

pub mod applied;
pub mod derivatives;
pub mod energy;
pub mod held;
#[cfg(test)]
mod identities;
pub mod recursion;
pub mod statics;
pub mod terms;
mod workspace;

pub use workspace::Workspace;
