//! The class `Input`: what drives arms, checked and copied once, then passed as often as wanted.

use super::arrays::{absolute, any_matrix, any_vector};
use super::errors::{input, to_python};
use super::external::Sampled;
use crate::arm::Arm;
use crate::plant::input::{Input, Interpolation};
use pyo3::prelude::*;
use std::sync::Arc;

/// Pressures (m, inputs), Pa absolute, and external forces (m, 3n), N, or None, at times (m,), s; with `wrenches` anywhere,
/// each constant or with a row a sample.
///
/// `name` goes before the names of the arguments in errors. Equal and hashed as the object that it is.
#[pyclass(name = "Input", module = "bha._core", frozen)]
pub struct PyInput {
    input: Arc<Input>,
    name: String,
}

#[pymethods]
impl PyInput {
    #[new]
    #[pyo3(signature = (time, pressures, forces = None, wrenches = None, *, interpolation = "linear", name = ""))]
    fn new(
        time: &Bound<'_, PyAny>,
        pressures: &Bound<'_, PyAny>,
        forces: Option<&Bound<'_, PyAny>>,
        wrenches: Option<&Bound<'_, PyAny>>,
        interpolation: &str,
        name: &str,
    ) -> PyResult<Self> {
        let py = time.py();
        let interpolation = interpolation_by_name(py, interpolation)?;
        let time = any_vector(time, &format!("{name}time"))?;
        let rows = |value: &Bound<'_, PyAny>, what: &str| -> PyResult<(Vec<f64>, usize)> {
            let (values, rows) = any_matrix(value, &format!("{name}{what}"))?;
            let columns = values.len().checked_div(rows).unwrap_or(0);
            Ok((values, columns))
        };
        let (pressures, count) = rows(pressures, "pressures")?;
        let pressures = absolute(py, &format!("{name}pressures"), pressures)?;
        let forces = forces.map_or(Ok((Vec::new(), 0)), |f| rows(f, "forces"))?;
        let sampled = Sampled::read(forces, wrenches, name, time.len())?;
        let built = Input::new(time, (pressures, count), sampled.rows, interpolation);
        let built = built.and_then(|input| input.with_points(sampled.points)).map_err(|e| to_python(py, &e))?;
        Ok(Self { input: Arc::new(built), name: name.to_owned() })
    }
}

impl PyInput {
    /// The input, if its channels are those of `arm`.
    ///
    /// # Errors
    /// `InputError` says which channels there are and which are needed.
    pub fn of(&self, py: Python<'_>, arm: &Arm) -> PyResult<Arc<Input>> {
        self.with(py, arm.body.inputs, arm.coordinates())
    }

    /// The same for so many pressures and, where there are any, forces.
    ///
    /// # Errors
    /// As [`PyInput::of`].
    pub fn with(&self, py: Python<'_>, pressures: usize, forces: usize) -> PyResult<Arc<Input>> {
        let Self { input: own, name } = self;
        for (what, found, wanted) in
            [("pressures", own.pressure_count(), pressures), ("forces", own.section_force_count(), forces)]
        {
            if found != wanted && (what == "pressures" || found > 0) {
                let text = format!("{name}{what}: expected shape (any, {wanted}), found [{}, {found}]", own.samples());
                return Err(input(py, text));
            }
        }
        let sections = forces / 3;
        if let Some((k, point)) = own.points().iter().enumerate().find(|(_, p)| p.section >= sections) {
            let found = point.section + 1;
            let text = format!("{name}wrenches[{k}].section: {found}; whole numbers from 1 to {sections} are allowed");
            return Err(input(py, text));
        }
        Ok(own.clone())
    }
}

/// By the user's name.
pub fn interpolation_by_name(py: Python<'_>, name: &str) -> PyResult<Interpolation> {
    Interpolation::by_name(name)
        .ok_or_else(|| input(py, format!("interpolation: {name:?}; \"linear\" or \"hold\" are allowed")))
}
