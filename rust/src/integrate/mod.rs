//! Runge-Kutta integration, explicit and linearly implicit: tableaux as data, one stepping loop that knows no method.

mod adaptive;
mod implicit;
mod options;
mod runge_kutta;
mod system;
mod tableau;
#[cfg(test)]
mod tests;

pub use options::{Options, Statistics};
pub use runge_kutta::Integrator;
pub use system::System;
pub use tableau::{DORMAND_PRINCE_54, Method, RK4, RODAS4, ROS2, Tableau};

pub(crate) use system::NOT_FINITE;
