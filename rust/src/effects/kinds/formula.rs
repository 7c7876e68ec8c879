//! A formula: the user's own force of a bellows, as text.
//!
//! Form: the bellows' force, N, from q (its length, m), qd (its rate, m/s), p (its pressure, Pa absolute), t (time, s) and the
//! numbers named in the table. Sign: as written: a positive force pushes the bellows' ends apart, so a force that resists
//! motion carries a minus, `-c * tanh(qd / v0)`.
//! Place in the equations: part of tau where the formula reads p, else of N. Outside a simulation t = 0.
//! Limits: nothing checks that the formula takes energy from the arm rather than gives it.

use crate::effects::expression::{MAX_DEPTH, Op, parse};
use crate::effects::{Definition, Effect, Instant, Parameter, PlaceKind};
use crate::real::Real;
use std::ops::Range;
use std::sync::Arc;

/// Variables of a formula; the table's numbers follow.
const VARIABLES: [&str; 4] = ["q", "qd", "p", "t"];

/// A parsed formula.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    ops: Vec<Op>,
    uses_pressure: bool,
}

impl Program {
    /// The program of `text`, in which `names` are numbers of the table.
    ///
    /// # Errors
    /// What is wrong, where in the text, and what is allowed.
    pub fn parse(text: &str, names: &[&str]) -> Result<Self, String> {
        if let Some(name) = names.iter().find(|n| VARIABLES.contains(n)) {
            return Err(format!("the parameter {name} has the name of a variable; choose another"));
        }
        let all: Vec<&str> = VARIABLES.iter().chain(names).copied().collect();
        let ops = parse(text, &all)?;
        let reads = |name: usize| ops.contains(&Op::Variable(name));
        if let Some(k) = (4..all.len()).find(|&k| !reads(k)) {
            return Err(format!("the parameter {} does not occur in it", all[k]));
        }
        Ok(Self { uses_pressure: reads(2), ops })
    }
}

/// A formula with its numbers.
#[derive(Clone, Debug)]
pub struct Formula<T> {
    program: Arc<Program>,
    /// q, qd, p, t (filled in when evaluated) and the table's numbers.
    values: Arc<[T]>,
    bellows: Range<usize>,
}

impl<T: Real> Formula<T> {
    #[inline(always)]
    fn value(&self, variables: [T; 4]) -> T {
        let mut stack = [T::zero(); MAX_DEPTH];
        let mut top = 0;
        for op in &self.program.ops {
            match *op {
                Op::Constant(c) => {
                    stack[top] = T::from_f64(c);
                    top += 1;
                }
                Op::Variable(k) => {
                    stack[top] = if k < 4 { variables[k] } else { self.values[k - 4] };
                    top += 1;
                }
                Op::Unary(u) => stack[top - 1] = u.apply(stack[top - 1]),
                Op::Binary(b) => {
                    top -= 1;
                    stack[top - 1] = b.apply(stack[top - 1], stack[top]);
                }
                Op::Power(n) => {
                    let x = stack[top - 1];
                    stack[top - 1] = (1..n).fold(x, |y, _| y * x);
                }
            }
        }
        stack[0]
    }
}

impl<T: Real> Effect<T> for Formula<T> {
    const SUMMARY: &'static str = "force of a bellows by a formula in q, qd, p, t and numbers of the table";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section, PlaceKind::Bellows];
    /// The numbers are those that the table names.
    const PARAMETERS: &'static [Parameter] = &[];
    const SEVERAL: bool = true;

    fn new(definition: &Definition, values: &[T]) -> Self {
        let program = definition.program.clone().expect("a formula's definition has its program");
        Self { program, values: values.into(), bellows: definition.target.bellows.clone() }
    }

    #[inline(always)]
    fn is_actuation(&self) -> bool {
        self.program.uses_pressure
    }

    #[inline(always)]
    fn add_forces(&self, now: &mut Instant<'_, T>, _hidden: &[T]) {
        let t = T::from_f64(now.time);
        for j in self.bellows.clone() {
            let b = &now.bellows[j];
            now.bellows_force[j] += self.value([b.length, b.rate, b.pressure + now.body.ambient_pressure, t]);
        }
    }
}
