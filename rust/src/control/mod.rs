//! Control of the arm at a fixed period, no Python in the loop.
//!
//! One file a subject: [`allocation`] (pressures within limits from a wanted tau), [`law`] (from lengths, rates and a
//! target to a wanted tau or pressure), [`observer`] (rates from length sensors), [`linearization`], [`modes`] and
//! [`riccati`] (what Kalman filter and linear-quadratic regulator are made from), [`task_space`] (lengths from a wanted tip),
//! [`rest`] (pressures under which the arm rests near wanted lengths),
//! [`controller`] (all of these as one thing that takes measurements and gives pressures).
//!
//! A controller holds a model of its own: an [`crate::arm::Arm`] that need not be the plant's.

pub mod allocation;
pub mod controller;
mod dense;
pub mod law;
pub mod linearization;
pub mod modes;
pub mod observer;
pub mod rest;
pub mod riccati;
pub mod task_space;

pub use allocation::Allocation;
pub use controller::{Controller, ControllerParameters, Limits, Target};
