//! Poses that pressures hold, row by row of a log, and where other arms that are nearly the same are held.
//!
//! Source: static coupled, paper (62), as in [`super::statics`]. How a pose moves with the arm follows from the implicit
//! function theorem: with r(q, arm) the force left over, `dq = -(dr/dq)^-1 (r(q, other) - r(q, arm))`, to first order.
//! Limits: where an arm holds a row's pressures in several poses, the one near the row before (or near where the caller
//! says) is found.

use super::statics::Equations;
use crate::arm::Arm;
use crate::effects;
use crate::error::{Error, Result};
use crate::forces::External;
use crate::real::linear::Vec3;
use nalgebra::DVector;

/// What acts, row by row.
#[derive(Clone, Copy)]
pub struct Rows<'a> {
    /// Pressures as logged, Pa, one an input and row.
    pub pressures: &'a [f64],
    /// Forces on the sections, N, one a section and row; None for none.
    pub forces: Option<&'a [Vec3<f64>]>,
}

impl<'a> Rows<'a> {
    fn count(&self, arm: &Arm<f64>) -> usize {
        self.pressures.len() / arm.body.inputs.max(1)
    }

    /// Puts a row's pressures, behind the arm's effects on them, and forces into the equations of an arm.
    fn act(&self, row: usize, arm: &Arm<f64>, acting: &mut [f64], equations: &mut Equations<'a>) {
        let (inputs, n) = (arm.body.inputs, arm.body.sections.len());
        acting.copy_from_slice(&self.pressures[row * inputs..(row + 1) * inputs]);
        effects::pressures::at_rest(&arm.effects, acting);
        let forces = self.forces.map(|f| External { forces: &f[row * n..(row + 1) * n], wrenches: &[] });
        equations.set(acting, forces);
    }
}

/// Lengths that hold each row, one row after the other; NaN where none are found.
///
/// Each search begins at that row of `near` where it is finite, else at the pose of the row before.
///
/// # Errors
/// [`Error::Interrupted`] if `stop` said so.
pub fn held_poses<'a>(
    arm: &'a Arm<f64>,
    rows: Rows<'a>,
    near: Option<&[f64]>,
    stop: &mut impl FnMut() -> bool,
) -> Result<Vec<f64>> {
    let size = arm.coordinates();
    let mut equations = Equations::new(arm);
    let mut acting = vec![0.0; arm.body.inputs];
    let mut poses = vec![f64::NAN; rows.count(arm) * size];
    let mut before: Option<Vec<f64>> = None;
    for (row, pose) in poses.chunks_exact_mut(size).enumerate() {
        rows.act(row, arm, &mut acting, &mut equations);
        let start = near.map(|q| &q[row * size..(row + 1) * size]).filter(|q| q.iter().all(|x| x.is_finite()));
        before = match equations.rest(start.or(before.as_deref()), stop) {
            Ok(q) => {
                pose.copy_from_slice(&q);
                Some(q)
            }
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            Err(_) => None,
        };
    }
    Ok(poses)
}

/// Lengths that hold each row in arms that are nearly `arm`, one table an arm, to first order from the `held` ones of `arm`;
/// NaN where those are.
///
/// # Errors
/// [`Error::Interrupted`] if `stop` said so.
pub fn moved_poses<'a>(
    arm: &'a Arm<f64>,
    others: &[&'a Arm<f64>],
    rows: Rows<'a>,
    held: &[f64],
    stop: &mut impl FnMut() -> bool,
) -> Result<Vec<f64>> {
    let size = arm.coordinates();
    let mut equations = Equations::new(arm);
    let mut moved: Vec<_> = others.iter().map(|other| Equations::new(other)).collect();
    let mut acting = vec![0.0; arm.body.inputs];
    let mut found = vec![f64::NAN; others.len() * held.len()];
    for (row, pose) in held.chunks_exact(size).enumerate() {
        if !pose.iter().all(|x| x.is_finite()) {
            continue;
        }
        let q = DVector::from_column_slice(pose);
        rows.act(row, arm, &mut acting, &mut equations);
        let left = equations.residual(&q);
        let factors = equations.jacobian(&q, stop).ok_or(Error::Interrupted)?.lu();
        for (k, (other, equations)) in others.iter().zip(&mut moved).enumerate() {
            rows.act(row, other, &mut acting, equations);
            let change = &left - equations.residual(&q);
            if let Some(step) = factors.solve(&change) {
                let at = k * held.len() + row * size;
                found[at..at + size].copy_from_slice((&q + step).as_slice());
            }
        }
    }
    Ok(found)
}
