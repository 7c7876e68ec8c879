//! Equations of motion M q'' + C q' + N = tau, paper (48): terms, recursion, energy, statics.

pub mod derivatives;
pub mod energy;
#[cfg(test)]
mod identities;
pub mod recursion;
pub mod statics;
pub mod terms;
#[cfg(test)]
pub(crate) mod testing;
mod workspace;

pub use workspace::Workspace;
