//! Arms of one structure put together number by number: abreast in lanes, or as a value with its derivatives.
//!
//! Two arms have one structure if they differ in numbers alone: the same sections, bellows, inputs, switches and kinds and
//! places of effects.

use crate::arm::Arm;
use crate::real::{Dual, Real};
use std::cell::{Cell, RefCell};

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
    let switches = |a: &Arm| (a.force_model, a.rotational_energy, a.coriolis_forces, a.inputs, a.sections.len());
    let section = |(s, t): (&crate::arm::Section<f64>, &crate::arm::Section<f64>)| {
        s.products_of_inertia.is_some() == t.products_of_inertia.is_some()
            && s.bellows.len() == t.bellows.len()
            && s.bellows
                .iter()
                .zip(&t.bellows)
                .all(|(b, c)| (b.input, b.stiffness_terms) == (c.input, c.stiffness_terms))
    };
    let (e, f) = (&a.effects, &b.effects);
    switches(a) == switches(b)
        && a.sections.iter().zip(&b.sections).all(section)
        && e.list.len() == f.list.len()
        && e.list.iter().zip(&f.list).all(|(e, f)| {
            let program = |d: &crate::effects::Definition| d.program.as_ref().map(std::sync::Arc::as_ptr);
            e.index == f.index
                && e.definition.place == f.definition.place
                && program(&e.definition) == program(&f.definition)
                && e.values.len() == f.values.len()
        })
}

/// Arms abreast, `arms[k]` in lane `k` and the last one in those that are left; of one structure.
pub fn abreast<T: Real>(arms: &[&Arm]) -> Arm<T> {
    let all: Vec<_> = arms.iter().map(|a| numbers(a)).collect();
    rebuilt(arms[0], |i| T::from_lanes(|k| all[k.min(all.len() - 1)][i]))
}

/// `arm` with the derivatives of its numbers along some directions: `tangents[d]` holds those along direction `d`, in the
/// order of [`Arm::map`]; directions beyond have none.
pub fn with_tangents<const N: usize, T: Real>(arm: &Arm, tangents: &[&[f64]]) -> Arm<Dual<N, T>> {
    let values = numbers(arm);
    rebuilt(arm, |i| Dual::seeded(values[i], |d| tangents.get(d).map_or(0.0, |t| t[i])))
}

/// The derivative of all numbers along a path of arms of one structure: `at(x)` is the arm at `x`, `reach` the distance in
/// which it is smooth. None if some arm on the way does not exist.
///
/// Differences of order 8 of a map that takes parameters to numbers (products, quotients, a few sines): good to about
/// 1e-12 of the largest number's own size over `reach`.
pub fn tangent(at: impl Fn(f64) -> Option<Arm>, x: f64, reach: f64) -> Option<Vec<f64>> {
    const WEIGHTS: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
    let mut sum: Vec<f64> = Vec::new();
    for (k, w) in WEIGHTS.into_iter().enumerate() {
        let step = reach * (k as f64 + 1.0);
        let (above, below) = (at(x + step)?, at(x - step)?);
        let difference = numbers(&above).into_iter().zip(numbers(&below)).map(|(a, b)| w * (a - b) / reach);
        if sum.is_empty() {
            sum = difference.collect();
        } else {
            sum.iter_mut().zip(difference).for_each(|(s, d)| *s += d);
        }
    }
    Some(sum)
}
