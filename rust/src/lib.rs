//! Euler-Lagrange dynamics of constant-curvature, pneumatic bellows arms.
//!
//! Source: Falkenhahn, Mahl, Hildebrandt, Neumann, Sawodny, "Dynamic Modeling of Bellows-Actuated Continuum Robots Using the
//! Euler-Lagrange Formalism", IEEE Trans. Robotics 31(6), 2015. Which equation lives where:
//!
//! | paper | here |
//! |---|---|
//! | (3), (7) lengths to arc | [`kinematics::coordinates`] |
//! | (9), (11), (66)-(73) pose of a section and its derivatives | [`kinematics::section`], [`kinematics::arc`] |
//! | (6), (8) a section of several arcs | `kinematics::arcs`, [`body::SectionArc`] |
//! | (12)-(14), (19)-(24) the chain | [`kinematics::link`], [`kinematics::chain`], [`kinematics::point`] |
//! | (25)-(32) bellows and external forces | [`forces`], summed in [`dynamics::applied`] |
//! | (33)-(35) gravity, bending | [`forces`] |
//! | effects the paper leaves out | [`effects`] |
//! | (36)-(39) kinetic energy | [`dynamics::energy`] |
//! | (48) solved for q'' or tau, (58)-(61) | [`dynamics::recursion`] |
//! | (49)-(53) M, C, N, tau | [`dynamics::terms`] |
//! | (62) statics | [`dynamics::statics`] |
//! | (25) pressures, from command to chamber | [`pneumatics`] |
//!
//! # The house
//!
//! Rooms from the top down. A room imports only rooms that its row names, all of which stand below it; a test
//! (`tests/house.rs`) reads this table and every `crate::` path.
//!
//! | room | what | may import |
//! |---|---|---|
//! | `python` | the classes and functions of `bha._core` | every room |
//! | [`virtual_arm`] | no part of the model: what the paper's experiments take for the real arm | plant, arm, body, error |
//! | [`run`] | runs of a plant: simulation, batch, sensitivities, stepper, fleet, closed loop | plant, control, dynamics, arm, pneumatics, effects, forces, kinematics, body, integrate, memory, real, error |
//! | [`plant`] | the differential equation under its inputs | dynamics, arm, pneumatics, effects, forces, kinematics, body, integrate, real, error |
//! | [`control`] | the model the other way round: from a wanted motion to pressures | dynamics, arm, forces, kinematics, real, error |
//! | [`dynamics`] | equations of motion, the one sum of forces, energy, statics, derivatives | arm, effects, forces, kinematics, body, real, error |
//! | [`arm`] | the arm: a body with its pneumatics and effects | pneumatics, effects, body, real, error |
//! | [`pneumatics`] | from commanded to chamber pressures | forces, kinematics, body, real, error |
//! | [`effects`] | what the paper's model leaves out | forces, kinematics, body, real, error |
//! | [`forces`] | the elementary forces | kinematics, body, real |
//! | [`kinematics`] | lengths to arcs to poses, the chain | body, real |
//! | [`body`] | sections and bellows, and what a parameter file says | real, error |
//! | [`integrate`] | methods for differential equations | real, error |
//! | [`real`] | scalars, lanes, dual numbers, small vectors and matrices | |
//! | [`innovations`] | Kalman's filter of what a simulation leaves; knows nothing of arms | |
//! | [`table`] | measured logs and trajectories as text; knows nothing of arms | |
//! | [`memory`] | room for large results | error |
//! | [`error`] | errors | |

pub mod arm;
pub mod body;
pub mod control;
pub mod dynamics;
pub mod effects;
pub mod error;
pub mod forces;
pub mod innovations;
pub mod integrate;
pub mod kinematics;
pub mod memory;
pub mod plant;
pub mod pneumatics;
#[cfg(feature = "python")]
mod python;
pub mod real;
pub mod run;
pub mod table;
pub mod virtual_arm;

/// The examples of the documentation that are Rust.
#[cfg(doctest)]
#[doc = include_str!("../../docs/reference/effects.md")]
struct Documentation;
