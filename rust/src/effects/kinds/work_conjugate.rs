//! The other force model: bellows forces as `work_conjugate` where the file says `end_force`, and the reverse.
//!
//! Source: `docs/explanation/model.md`, force models; paper (27)-(32) for `end_force`. Acts by changing the arm.

use crate::body::Body;
use crate::body::parameters::ForceModel;
use crate::effects::{Definition, Effect, Parameter, PlaceKind};
use crate::real::Real;
use std::marker::PhantomData;

/// The other force model.
#[derive(Clone, Debug)]
pub struct WorkConjugate<T>(PhantomData<T>);

impl<T: Real> Effect<T> for WorkConjugate<T> {
    const SUMMARY: &'static str = "the force model is the other one";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All];
    const PARAMETERS: &'static [Parameter] = &[];
    const CHANGES_ARM: bool = true;

    fn new(_definition: &Definition, _values: &[T]) -> Self {
        Self(PhantomData)
    }

    fn change_arm(&self, body: &mut Body<T>) {
        body.force_model = match body.force_model {
            ForceModel::EndForce => ForceModel::WorkConjugate,
            ForceModel::WorkConjugate => ForceModel::EndForce,
        };
    }
}
