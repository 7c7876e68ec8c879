//! Kinematics: lengths to arc, arcs to pose, poses stacked into the chain.

pub mod arc;
mod arcs;
pub mod chain;
pub mod coordinates;
pub mod link;
pub mod point;
pub mod quaternion;
pub mod section;
