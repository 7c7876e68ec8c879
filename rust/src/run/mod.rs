//! Runs of a plant: one or many, to the end or step by step, open or closed.
//!
//! | what | where |
//! |---|---|
//! | one run, rows of output | [`simulation`] |
//! | many runs, in lanes and over threads | [`batch`] |
//! | derivatives of a run | [`sensitivity`] |
//! | a plant that is stepped from outside | [`stepper`] |
//! | a controller around it | [`closed_loop`] |
//! | many plants that are stepped together and reset one by one | [`fleet`] |
//! | which steps an arm can be taken in | [`stepping`] |
//! | the caller asked now and then whether to stop | [`watch`] |

pub mod batch;
pub mod closed_loop;
pub mod fleet;
mod parking;
pub mod sensitivity;
pub mod simulation;
pub mod stepper;
pub mod stepping;
pub mod watch;
