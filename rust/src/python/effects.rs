//! The registry of effects, for the schema of parameter files.

use crate::effects::kinds::formula::Program;
use crate::effects::{KINDS, PlaceKind};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

fn place_name(place: PlaceKind) -> &'static str {
    match place {
        PlaceKind::All => "all",
        PlaceKind::Section => "section",
        PlaceKind::Bellows => "bellows",
        PlaceKind::Input => "input",
        PlaceKind::Sensors => "sensors",
        PlaceKind::Heads => "heads",
    }
}

/// All kinds of effects: for each a dict of kind, summary, places, parameters (name, unit, low, high, default, meaning),
/// several, needs_poses, changes_arm.
#[pyfunction]
pub fn effect_kinds(py: Python<'_>) -> PyResult<Bound<'_, PyList>> {
    let out = PyList::empty(py);
    for info in KINDS {
        let parameters = PyList::empty(py);
        for p in info.parameters {
            let entry = PyDict::new(py);
            entry.set_item("name", p.name)?;
            entry.set_item("unit", p.unit)?;
            entry.set_item("low", *p.range.start())?;
            entry.set_item("high", *p.range.end())?;
            entry.set_item("default", p.default)?;
            entry.set_item("meaning", p.meaning)?;
            parameters.append(entry)?;
        }
        let kind = PyDict::new(py);
        kind.set_item("kind", info.name)?;
        kind.set_item("summary", info.summary)?;
        kind.set_item("places", info.places.iter().map(|p| place_name(*p)).collect::<Vec<_>>())?;
        kind.set_item("parameters", parameters)?;
        kind.set_item("several", info.several)?;
        kind.set_item("needs_poses", info.needs_poses)?;
        kind.set_item("changes_arm", info.changes_arm)?;
        out.append(kind)?;
    }
    Ok(out)
}

/// What is wrong with a formula whose table names the numbers `names`; None if nothing is.
#[pyfunction]
pub fn formula_fault(text: &str, names: Vec<String>) -> Option<String> {
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    Program::parse(text, &names).err()
}
