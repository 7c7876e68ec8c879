//! Everything computed for an arm, allocated once.

use super::recursion::{Inertial, Joint};
use crate::arm::Arm;
use crate::effects::EffectState;
use crate::forces::{Load, PointWrench, Wrench};
use crate::kinematics::link::Link;
use crate::real::Real;
use crate::real::linear::Vec3;

/// Work space of one arm: nothing inside a step allocates.
#[derive(Clone, Debug)]
pub struct Workspace<T = f64> {
    /// Kinematics of each section.
    pub links: Vec<Link<T>>,
    /// Kinematics of each mass along the sections, section by section.
    pub masses: Vec<Link<T>>,
    /// Forces on each section.
    pub loads: Vec<Load<T>>,
    /// Articulated-body quantities of each section.
    pub(crate) joints: Vec<Joint<T>>,
    /// Inertia forces of each section.
    pub(crate) inertial: Vec<Inertial<T>>,
    /// Inertia forces of each mass along the sections.
    pub(crate) mass_wrenches: Vec<Wrench<T>>,
    /// A force for each section, for callers that assemble what acts from outside.
    pub external: Vec<Vec3<T>>,
    /// Wrenches, likewise.
    pub wrenches: Vec<PointWrench<T>>,
    /// Work space and hidden states of the effects.
    pub effects: EffectState<T>,
}

impl<T: Real> Workspace<T> {
    /// Work space for `arm`.
    pub fn new(arm: &Arm<T>) -> Self {
        let (n, masses) = (arm.body.sections.len(), arm.body.masses());
        Self {
            links: vec![Link::base(); n],
            masses: vec![Link::base(); masses],
            loads: vec![Load::zero(); n],
            joints: vec![Joint::zero(); n],
            inertial: vec![Inertial::zero(); n],
            mass_wrenches: vec![Wrench::zero(); masses],
            external: vec![Vec3::zero(); n],
            wrenches: Vec::new(),
            effects: EffectState::new(&arm.body, &arm.effects),
        }
    }
}
