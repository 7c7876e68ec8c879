//! The class `VirtualArm`: what the paper's experiments measure instead of a real arm.

use super::arrays::{any_vector, finite, matrix, pressures, shaped, small, vector};
use super::errors::{input, to_python};
use super::input::PyInput;
use super::signals::Signals;
use crate::body::parameters::ArmParameters;
use crate::virtual_arm::{Creep, Distributed, State, VirtualArm};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;

/// An arm with mass along its length and creep in its material.
///
/// `parameters_json` describes it with the masses of the head plates; `distributed` is (slices, mass, (Jx, Jy, Jz)) for
/// each section; `creep` is (share of the linear stiffness, time constant) for each Maxwell branch.
#[pyclass(name = "VirtualArm", module = "bha._core", frozen)]
pub struct PyVirtualArm {
    arm: VirtualArm,
}

type Vector<'py> = Bound<'py, PyArray1<f64>>;

/// Rows of a run, one at each time.
#[pyclass(module = "bha._core", frozen, get_all)]
pub struct VirtualRows {
    /// Lengths (m, 3n), m.
    lengths: Py<PyArray2<f64>>,
    /// Rates (m, 3n), m/s.
    velocities: Py<PyArray2<f64>>,
    /// Creep states (m, branches times bellows), m.
    creep: Py<PyArray2<f64>>,
}

#[pymethods]
impl PyVirtualArm {
    #[new]
    fn new(
        py: Python<'_>,
        parameters_json: &str,
        distributed: Vec<(usize, f64, [f64; 3])>,
        creep: Vec<(f64, f64)>,
    ) -> PyResult<Self> {
        let parameters: ArmParameters =
            serde_json::from_str(parameters_json).map_err(|e| input(py, format!("parameters: {e}")))?;
        let distributed: Vec<_> =
            distributed.into_iter().map(|(slices, mass, inertia)| Distributed { slices, mass, inertia }).collect();
        let creep: Vec<_> = creep.into_iter().map(|(share, time_constant)| Creep { share, time_constant }).collect();
        let arm = VirtualArm::new(&parameters, &distributed, &creep).map_err(|e| to_python(py, &e))?;
        Ok(Self { arm })
    }

    /// Number of creep states: branches times bellows.
    #[getter]
    fn creep_states(&self) -> usize {
        self.arm.creep_states()
    }

    /// Lengths (3n,) at rest under constant pressures (inputs,) and forces (n, 3) at the head plates, creep relaxed.
    #[pyo3(signature = (p, f_ext = None))]
    fn rest<'py>(&self, p: &Bound<'py, PyAny>, f_ext: Option<&Bound<'py, PyAny>>) -> PyResult<Vector<'py>> {
        let (py, sections) = (p.py(), self.arm.coordinates() / 3);
        let p = pressures(p, "p", self.arm.inputs())?;
        let f = f_ext.map(|f| matrix(f, "f_ext", (sections, 3))).transpose()?;
        let f: Vec<[f64; 3]> = f.unwrap_or_default().chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
        let state = py.detach(|| self.arm.rest(&p, &f)).map_err(|e| to_python(py, &e))?;
        Ok(small(py, &state.lengths))
    }

    /// Rows at `output_times` under `drive`, from lengths `q` with rates `qd` and creep states `creep` at the first of them;
    /// integrated with steps of at most `step`.
    #[pyo3(signature = (drive, output_times, q, qd, creep, step))]
    #[allow(clippy::too_many_arguments)]
    fn run<'py>(
        &self,
        py: Python<'py>,
        drive: &Bound<'py, PyInput>,
        output_times: &Bound<'py, PyAny>,
        q: &Bound<'py, PyAny>,
        qd: &Bound<'py, PyAny>,
        creep: &Bound<'py, PyAny>,
        step: f64,
    ) -> PyResult<VirtualRows> {
        let n = self.arm.coordinates();
        if step.is_nan() || step <= 0.0 {
            return Err(input(py, format!("step: {step}; a positive number is needed")));
        }
        let drive = drive.get().with(py, self.arm.inputs(), n)?;
        let outputs = any_vector(output_times, "output_times")?;
        if outputs.windows(2).any(|w| w[1] < w[0]) {
            return Err(input(py, "output_times: they must ascend".to_owned()));
        }
        let start = State {
            lengths: vector(q, "q", n)?,
            velocities: vector(qd, "qd", n)?,
            creep: vector(creep, "creep", self.arm.creep_states())?,
        };
        let mut signals = Signals::new();
        let result = py.detach(|| self.arm.run(&drive, &outputs, &start, step, &mut || signals.stop()));
        signals.result()?;
        let (out, m) = (result.map_err(|e| to_python(py, &e))?, outputs.len());
        Ok(VirtualRows {
            lengths: shaped(py, out.lengths, [m, n])?.unbind(),
            velocities: shaped(py, out.velocities, [m, n])?.unbind(),
            creep: shaped(py, out.creep, [m, self.arm.creep_states()])?.unbind(),
        })
    }

    /// (kinetic, potential) energy at a state, J.
    fn energy(&self, q: &Bound<'_, PyAny>, qd: &Bound<'_, PyAny>, creep: &Bound<'_, PyAny>) -> PyResult<(f64, f64)> {
        let (py, n) = (q.py(), self.arm.coordinates());
        let (q, qd) = (vector(q, "q", n)?, vector(qd, "qd", n)?);
        let creep = vector(creep, "creep", self.arm.creep_states())?;
        let [kinetic, potential] = finite(py, "energy", self.arm.energy(&q, &qd, &creep))?;
        Ok((kinetic, potential))
    }
}
