//! Arms of one structure put together number by number: in lanes, or as a value with its derivatives.
//!
//! Two arms have one structure if they differ in numbers alone: the same sections, arcs, masses, bellows, inputs, switches and
//! kinds and places of effects.

use super::Arm;
use crate::body::{Body, Section};
use crate::effects::Definition;
use crate::real::{Dual, Real};
use std::cell::{Cell, RefCell};
use std::sync::Arc;

/// All numbers of an arm, in the order of [`Arm::map`].
fn numbers(arm: &Arm) -> Vec<f64> {
    let found = RefCell::new(Vec::new());
    arm.map(|x| {
        found.borrow_mut().push(x);
        x
    });
    found.into_inner()
}

/// The arm with `build(k)` for its `k`th number.
fn rebuilt<T: Real>(arm: &Arm, build: impl Fn(usize) -> T) -> Arm<T> {
    let index = Cell::new(0);
    arm.map(|_| {
        let k = index.replace(index.get() + 1);
        build(k)
    })
}

/// Whether two arms differ in numbers alone.
pub fn same_structure(a: &Arm, b: &Arm) -> bool {
    let air = |a: &Arm| a.pneumatics.as_ref().map(|p| (p.level, p.has_vacuum, p.walls_give));
    let switches = |a: &Body| (a.force_model, a.rotational_energy, a.coriolis_forces, a.inputs, a.sections.len());
    let section = |(s, t): (&Section<f64>, &Section<f64>)| {
        s.products_of_inertia.is_some() == t.products_of_inertia.is_some()
            && s.taper.is_some() == t.taper.is_some()
            && (s.arcs.len(), s.masses.len()) == (t.arcs.len(), t.masses.len())
            && s.bending_planes.is_some() == t.bending_planes.is_some()
            && s.axial.as_ref().map(|a| a.stiffness_terms) == t.axial.as_ref().map(|a| a.stiffness_terms)
            && s.bellows.len() == t.bellows.len()
            && s.bellows
                .iter()
                .zip(&t.bellows)
                .all(|(b, c)| (b.input, b.stiffness_terms) == (c.input, c.stiffness_terms))
    };
    let (e, f) = (&a.effects, &b.effects);
    switches(&a.body) == switches(&b.body)
        && air(a) == air(b)
        && a.body.sections.iter().zip(&b.body.sections).all(section)
        && a.body.area_changes.len() == b.body.area_changes.len()
        && a.body.stiffening.len() == b.body.stiffening.len()
        && e.list.len() == f.list.len()
        && e.list.iter().zip(&f.list).all(|(e, f)| {
            let program = |d: &Definition| d.program.as_ref().map(Arc::as_ptr);
            e.index == f.index
                && e.definition.place == f.definition.place
                && program(&e.definition) == program(&f.definition)
                && e.values.len() == f.values.len()
        })
}

/// Arms in lanes, `arms[k]` in lane `k` and the last one in those that are left; of one structure.
pub fn in_lanes<T: Real>(arms: &[&Arm]) -> Arm<T> {
    let all: Vec<_> = arms.iter().map(|a| numbers(a)).collect();
    rebuilt(arms[0], |i| T::from_lanes(|k| all[k.min(all.len() - 1)][i]))
}

/// `arm` with the derivatives of its numbers along some directions: `tangents[d]` holds those along direction `d`, in the
/// order of [`Arm::map`]; directions beyond have none.
pub fn with_tangents<const N: usize, T: Real>(arm: &Arm, tangents: &[&[f64]]) -> Arm<Dual<N, T>> {
    let values = numbers(arm);
    rebuilt(arm, |i| Dual::seeded(values[i], |d| tangents.get(d).map_or(0.0, |t| t[i])))
}

/// `sum_i weights[i] arms[i]`, number by number, for weights of differences (they add up to zero): the derivative of an
/// arm's numbers along a path of arms. None if the arms are not of one structure.
///
/// Numbers of an arm are products, quotients and a few sines of its parameters; differences of order 8 give their
/// derivatives to about 1e-12.
pub fn tangent(arms: &[&Arm], weights: &[f64]) -> Option<Vec<f64>> {
    let first = *arms.first()?;
    if !arms.iter().all(|a| same_structure(first, a)) {
        return None;
    }
    // From the first arm's numbers on: the weights add up to zero but for rounding, which must not make numbers move that
    // do not depend on the parameter.
    let origin = numbers(first);
    let mut sum = vec![0.0; origin.len()];
    for (arm, w) in arms.iter().zip(weights) {
        sum.iter_mut().zip(numbers(arm).iter().zip(&origin)).for_each(|(s, (x, x0))| *s += w * (x - x0));
    }
    Some(sum)
}
