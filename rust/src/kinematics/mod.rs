//! Kinematics: lengths to arc, arc to pose, poses stacked into the chain.

pub mod arc;
pub mod chain;
pub mod coordinates;
pub mod point;
pub mod quaternion;
pub mod section;
