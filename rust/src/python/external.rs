//! Forces and wrenches from outside, as Python gives them: arrays `f_ext` and objects like `bha.Wrench`.

use super::arrays::{matrix, vector, vector_or_rows, whole};
use super::errors::input;
use crate::body::MOST_SECTIONS;
use crate::forces::{External, PointWrench};
use crate::kinematics::point::Point;
use crate::real::linear::Vec3;
use pyo3::prelude::*;

/// What acts from outside at one instant.
pub struct Outside {
    forces: Vec<Vec3<f64>>,
    wrenches: Vec<PointWrench<f64>>,
}

impl Outside {
    /// Forces, one row a section, and wrenches on an arm of so many sections.
    pub fn read(
        f_ext: Option<&Bound<'_, PyAny>>,
        wrenches: Option<&Bound<'_, PyAny>>,
        sections: usize,
    ) -> PyResult<Self> {
        let f = f_ext.map_or(Ok(Vec::new()), |f| matrix(f, "f_ext", (sections, 3)))?;
        let one = |(name, wrench): &(String, Bound<'_, PyAny>)| {
            let three = |what: &str| -> PyResult<Vec3<f64>> {
                let v = vector(&attribute(wrench, name, what)?, &format!("{name}.{what}"), 3)?;
                Ok(Vec3([v[0], v[1], v[2]]))
            };
            Ok(PointWrench { point: point(wrench, name, sections)?, force: three("force")?, moment: three("moment")? })
        };
        Ok(Self {
            forces: f.chunks_exact(3).map(|c| Vec3([c[0], c[1], c[2]])).collect(),
            wrenches: named(wrenches)?.iter().map(one).collect::<PyResult<_>>()?,
        })
    }

    /// The same for the core, if there is anything.
    pub fn get(&self) -> Option<External<'_, f64>> {
        let given = !self.forces.is_empty() || !self.wrenches.is_empty();
        given.then_some(External { forces: &self.forces, wrenches: &self.wrenches })
    }
}

/// Force channels of an input and where its wrenches act.
pub struct Sampled {
    /// Row by row, and how many a row.
    pub rows: (Vec<f64>, usize),
    /// Points of the wrenches, whose channels are the last, six each.
    pub points: Vec<Point<f64>>,
}

impl Sampled {
    /// Of `count` samples: forces, so many a row, and wrenches, whose force and moment are constant (3,) or sampled
    /// (count, 3). `name` goes before the names of the arguments in errors.
    pub fn read(
        (forces, columns): (Vec<f64>, usize),
        wrenches: Option<&Bound<'_, PyAny>>,
        name: &str,
        count: usize,
    ) -> PyResult<Self> {
        let wrenches = named(wrenches)?;
        if wrenches.is_empty() {
            return Ok(Self { rows: (forces, columns), points: Vec::new() });
        }
        let (mut points, mut sampled) = (Vec::new(), Vec::new());
        for (which, wrench) in &wrenches {
            points.push(point(wrench, &format!("{name}{which}"), MOST_SECTIONS)?);
            for what in ["force", "moment"] {
                let value = attribute(wrench, which, what)?;
                let (values, rows) = vector_or_rows(&value, &format!("{name}{which}.{what}"), 3)?;
                if let Some(rows) = rows
                    && rows != count
                {
                    let text = format!(
                        "{name}{which}.{what}: {rows} rows; one, or one for each of {count} samples, is needed"
                    );
                    return Err(input(wrench.py(), text));
                }
                sampled.push((values, rows.is_some()));
            }
        }
        let width = columns + 6 * points.len();
        let mut out = Vec::with_capacity(count * width);
        for row in 0..count {
            // Wrong sizes are the input's to find.
            out.extend_from_slice(forces.get(row * columns..(row + 1) * columns).unwrap_or_default());
            for (values, each) in &sampled {
                let first = if *each { 3 * row } else { 0 };
                out.extend_from_slice(&values[first..first + 3]);
            }
        }
        Ok(Self { rows: (out, width), points })
    }
}

/// Each wrench with the name that errors call it by.
fn named<'py>(wrenches: Option<&Bound<'py, PyAny>>) -> PyResult<Vec<(String, Bound<'py, PyAny>)>> {
    let Some(wrenches) = wrenches else { return Ok(Vec::new()) };
    let wrong = || {
        let found = wrenches.get_type().name().map_or("something else".to_owned(), |n| n.to_string());
        input(wrenches.py(), format!("wrenches: {found}; a list of bha.Wrench is needed"))
    };
    let each = wrenches.try_iter().map_err(|_| wrong())?;
    each.enumerate().map(|(k, w)| Ok((format!("wrenches[{k}]"), w?))).collect()
}

fn attribute<'py>(wrench: &Bound<'py, PyAny>, name: &str, what: &str) -> PyResult<Bound<'py, PyAny>> {
    wrench.getattr(what).map_err(|_| {
        let found = wrench.get_type().name().map_or("something else".to_owned(), |n| n.to_string());
        input(wrench.py(), format!("{name}: {found}; a bha.Wrench is needed"))
    })
}

fn point(wrench: &Bound<'_, PyAny>, name: &str, sections: usize) -> PyResult<Point<f64>> {
    let section = whole(&attribute(wrench, name, "section")?, &format!("{name}.section"), (1, sections))?;
    let fraction = attribute(wrench, name, "fraction")?;
    let fraction =
        fraction.extract::<f64>().ok().filter(|f| (0.0..=1.0).contains(f)).ok_or_else(|| {
            input(wrench.py(), format!("{name}.fraction: {fraction}; a number from 0 to 1 is needed"))
        })?;
    let offset = vector(&attribute(wrench, name, "offset")?, &format!("{name}.offset"), 3)?;
    Ok(Point { section: section - 1, fraction, offset: Vec3([offset[0], offset[1], offset[2]]) })
}
