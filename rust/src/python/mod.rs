//! The extension module `bha._core`: one file per exposed class or function, one for arrays, one for errors.

mod arm;
mod arrays;
mod batch;
mod closed_loop;
mod control;
mod derivatives;
mod effects;
mod errors;
mod external;
mod held;
mod innovations;
mod input;
mod signals;
mod simulation;
mod stepping;
mod table;
mod virtual_arm;

use pyo3::prelude::*;

/// Compiled core of the package; use it through `bha`.
#[pymodule]
fn _core(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add_class::<arm::PyArm>()?;
    m.add_class::<arm::PyVariants>()?;
    m.add_class::<arm::DynamicsTerms>()?;
    m.add_class::<arm::Energy>()?;
    m.add_class::<input::PyInput>()?;
    m.add_class::<simulation::PySimulation>()?;
    m.add_class::<simulation::SimulationRows>()?;
    m.add_class::<simulation::StepCounts>()?;
    m.add_class::<batch::BatchRows>()?;
    m.add_class::<closed_loop::LoopRows>()?;
    m.add_class::<control::Rest>()?;
    m.add_class::<stepping::StepPlan>()?;
    m.add_class::<derivatives::Differentiated>()?;
    m.add_class::<derivatives::SensitivityRows>()?;
    m.add_class::<virtual_arm::VirtualRows>()?;
    m.add_class::<stepping::PyStepper>()?;
    m.add_class::<control::PyController>()?;
    m.add_class::<stepping::PyFleet>()?;
    m.add_function(wrap_pyfunction!(closed_loop::closed_loop, m)?)?;
    m.add_function(wrap_pyfunction!(control::rest_near, m)?)?;
    m.add_function(wrap_pyfunction!(stepping::plan_steps, m)?)?;
    m.add_function(wrap_pyfunction!(control::resolved_motion, m)?)?;
    m.add_function(wrap_pyfunction!(control::linearize, m)?)?;
    m.add_function(wrap_pyfunction!(control::linear_quadratic_gain, m)?)?;
    m.add_function(wrap_pyfunction!(innovations::innovations, m)?)?;
    m.add_function(wrap_pyfunction!(held::held_poses, m)?)?;
    m.add_function(wrap_pyfunction!(held::moved_poses, m)?)?;
    m.add_class::<virtual_arm::PyVirtualArm>()?;
    m.add_function(wrap_pyfunction!(simulation::check_options, m)?)?;
    m.add_function(wrap_pyfunction!(batch::simulate_batch, m)?)?;
    m.add_function(wrap_pyfunction!(batch::instruction_sets, m)?)?;
    m.add_class::<derivatives::Differentiator>()?;
    m.add_function(wrap_pyfunction!(derivatives::sensitivities, m)?)?;
    m.add_function(wrap_pyfunction!(effects::effect_kinds, m)?)?;
    m.add_function(wrap_pyfunction!(effects::formula_fault, m)?)?;
    table::register(m)
}
