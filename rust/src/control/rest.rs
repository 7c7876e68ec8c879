//! A rest of the arm near wanted lengths.

use super::{Allocation, Limits, law};
use crate::arm::Arm;
use crate::dynamics::Workspace;
use crate::dynamics::statics::rest;
use crate::error::Result;

/// Pressures under which `arm` rests nearest to lengths `q` within limits, and the lengths at which it then rests.
///
/// # Errors
/// [`Error::Convergence`] if there is no rest, [`Error::Interrupted`] if `stop` said so.
pub fn rest_near(
    arm: &Arm,
    q: &[f64],
    limits: &Limits,
    stop: &mut impl FnMut() -> bool,
) -> Result<(Vec<f64>, Vec<f64>)> {
    limits.check(arm.body.inputs)?;
    let mut ws = Workspace::new(arm);
    let (mut tau, mut p) = (vec![0.0; q.len()], vec![0.0; arm.body.inputs]);
    law::static_force(arm, q, &vec![0.0; q.len()], &mut ws, &mut tau);
    Allocation::new(arm, &limits.low, &limits.high, &limits.preferred).solve(arm, q, &tau, &mut ws, &mut p);
    let lengths = rest(arm, &p, Some(q), stop)?;
    Ok((p, lengths))
}
