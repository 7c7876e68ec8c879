//! Euler-Lagrange dynamics of constant-curvature, pneumatic bellows arms.
//!
//! Source: Falkenhahn, Mahl, Hildebrandt, Neumann, Sawodny, "Dynamic Modeling of Bellows-Actuated Continuum Robots Using the
//! Euler-Lagrange Formalism", IEEE Trans. Robotics 31(6), 2015. Which equation lives where:
//!
//! | paper | here |
//! |---|---|
//! | (3), (7) lengths to arc | [`kinematics::coordinates`] |
//! | (9), (11), (66)-(73) pose of a section and its derivatives | [`kinematics::section`], [`kinematics::arc`] |
//! | (12)-(14), (19)-(24) the chain | [`kinematics::chain`], [`kinematics::point`] |
//! | (25)-(32) bellows and external forces | [`forces`] |
//! | (33)-(35) gravity, bending | [`forces`] |
//! | effects the paper leaves out | [`effects`] |
//! | (36)-(39) kinetic energy | [`dynamics::energy`] |
//! | (48) solved for q'' or tau, (58)-(61) | [`dynamics::recursion`] |
//! | (49)-(53) M, C, N, tau | [`dynamics::terms`] |
//! | (62) statics | [`dynamics::statics`] |
//! | (25) pressures, from command to chamber | [`pneumatics`] |
//!
//! Measured logs and trajectories as text are read and written by [`table`], which knows nothing of arms.
//!
//! [`virtual_arm`] is no part of the model: it is what the paper's experiments take for the real arm.
//!
//! [`control`] and [`closed_loop`] use the model the other way round: from a wanted motion to pressures.
//!
//! Arrows: batch, closed_loop -> control, simulate -> integrate -> dynamics -> forces, effects, pneumatics -> kinematics
//! -> arm -> real; nothing points back.

pub mod abreast;
pub mod arm;
pub mod batch;
pub mod closed_loop;
pub mod control;
pub mod drives;
pub mod dynamics;
pub mod effects;
pub mod error;
pub mod fleet;
pub mod forces;
pub mod input;
pub mod integrate;
pub mod kinematics;
pub mod linear;
pub mod memory;
pub mod parameters;
pub mod plant;
pub mod pneumatics;
#[cfg(feature = "python")]
mod python;
pub mod real;
pub mod sensitivity;
pub mod simulate;
pub mod stepping;
pub mod stiffness;
pub mod table;
pub mod virtual_arm;

/// The examples of the documentation that are Rust.
#[cfg(doctest)]
#[doc = include_str!("../../docs/effects.md")]
struct Documentation;
pub mod watch;
