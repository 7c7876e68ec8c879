//! The functions `held_poses` and `moved_poses`.

use super::arm::PyArm;
use super::arrays::{absolute, matrix, rows, shaped, table};
use super::errors::{input, to_python};
use super::signals::Signals;
use crate::arm::Arm;
use crate::dynamics::held::{self as poses, Rows};
use crate::real::linear::Vec3;
use numpy::{PyArray2, PyArray3};
use pyo3::prelude::*;

/// Pressures (g, inputs) and forces (g, 3n), with their number of rows.
struct Given {
    pressures: Vec<f64>,
    forces: Option<Vec<Vec3<f64>>>,
    count: usize,
}

impl Given {
    fn read(arm: &Arm, pressures: &Bound<'_, PyAny>, forces: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let (inputs, n) = (arm.body.inputs, arm.body.sections.len());
        let pressures = absolute(pressures.py(), "pressures", rows(pressures, "pressures", inputs)?)?;
        let count = pressures.len() / inputs.max(1);
        let forces = forces.map(|f| matrix(f, "forces", (count, 3 * n))).transpose()?;
        let forces = forces.map(|f| f.chunks_exact(3).map(|c| Vec3([c[0], c[1], c[2]])).collect());
        Ok(Self { pressures, forces, count })
    }

    fn rows(&self) -> Rows<'_> {
        Rows { pressures: &self.pressures, forces: self.forces.as_deref() }
    }
}

/// Lengths (g, 3n) that hold pressures (g, inputs) under forces (g, 3n), row by row; NaN where none are found. Each search
/// begins at its row of `near` (g, 3n), where that is finite, else at the row before.
#[pyfunction]
#[pyo3(signature = (arm, pressures, forces = None, near = None))]
pub fn held_poses<'py>(
    arm: &Bound<'py, PyArm>,
    pressures: &Bound<'py, PyAny>,
    forces: Option<&Bound<'py, PyAny>>,
    near: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (py, arm) = (arm.py(), &*arm.get().arm);
    let given = Given::read(arm, pressures, forces)?;
    let size = arm.coordinates();
    let near = near.map(|near| table(near, "near", (given.count, size))).transpose()?;
    let mut signals = Signals::new();
    let found = py.detach(|| poses::held_poses(arm, given.rows(), near.as_deref(), &mut || signals.stop()));
    signals.result()?;
    shaped(py, found.map_err(|e| to_python(py, &e))?, [given.count, size])
}

/// Lengths (k, g, 3n) that hold the same in `others`, k arms nearly like `arm`, to first order from its own `held` (g, 3n).
#[pyfunction]
#[pyo3(signature = (arm, others, pressures, held, forces = None))]
pub fn moved_poses<'py>(
    arm: &Bound<'py, PyArm>,
    others: Vec<Bound<'py, PyArm>>,
    pressures: &Bound<'py, PyAny>,
    held: &Bound<'py, PyAny>,
    forces: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let (py, arm) = (arm.py(), &*arm.get().arm);
    let given = Given::read(arm, pressures, forces)?;
    let size = arm.coordinates();
    let held = table(held, "held", (given.count, size))?;
    let others: Vec<&Arm> = others.iter().map(|other| &*other.get().arm).collect();
    if others.iter().any(|o| o.coordinates() != size || o.body.inputs != arm.body.inputs) {
        return Err(input(py, "others: arms with as many sections and inputs are needed".to_owned()));
    }
    let mut signals = Signals::new();
    let found = py.detach(|| poses::moved_poses(arm, &others, given.rows(), &held, &mut || signals.stop()));
    signals.result()?;
    shaped(py, found.map_err(|e| to_python(py, &e))?, [others.len(), given.count, size])
}
