//! Stiffness that changes with pressure: of the bellows' springs, and of the section's bending.
//!
//! Source: a bellows under internal pressure loses lateral stiffness, up to buckling ("squirm"; EJMA, *Standards of the
//! Expansion Joint Manufacturers Association*, sec. 4; Haringx 1952), fabric and thin walls gain it under tension.
//! Form: energy a p_j U_spr(q_j) for each bellows and b p_m U_bend(u, v) for the section, p_j the pressure above ambient and
//! p_m its mean over the section's bellows. Sign: positive is stiffer under pressure.
//! Place in the equations: part of tau. The chamber's volume follows, V_j = dG/dp_j of G = -(these energies), so that air
//! that is shut in keeps its energy ([`crate::pneumatics`]); for that the body is told.
//! Springs that are linear: a is the same as `effective_area`'s by_length of -a k / A_P.
//! Validity: first order in pressure.

use crate::body::{Body, Stiffening};
use crate::effects::{Definition, Effect, Instant, Parameter, PlaceKind};
use crate::forces::stiffening;
use crate::real::Real;
use std::ops::Range;

/// Stiffness by pressure.
#[derive(Clone, Debug)]
pub struct PressureStiffness<T> {
    change: Stiffening<T>,
    sections: Range<usize>,
}

impl<T: Real> Effect<T> for PressureStiffness<T> {
    const SUMMARY: &'static str = "stiffness of bellows or of bending that changes with pressure";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section];
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new("axial", "1/Pa", -1e-5..=1e-5, "relative change of the spring force per pressure above ambient")
            .or(0.0),
        Parameter::new("bending", "1/Pa", -1e-4..=1e-4, "the same of the bending moment, mean pressure of the section")
            .or(0.0),
    ];

    const CHANGES_ARM: bool = true;

    fn new(definition: &Definition, values: &[T]) -> Self {
        let change = Stiffening { axial: values[0], bending: values[1] };
        Self { change, sections: definition.target.sections.clone() }
    }

    fn change_arm(&self, body: &mut Body<T>) {
        let none = Stiffening { axial: T::zero(), bending: T::zero() };
        body.stiffening.resize(body.sections.len(), none);
        for stiffening in &mut body.stiffening[self.sections.clone()] {
            stiffening.axial += self.change.axial;
            stiffening.bending += self.change.bending;
        }
    }

    #[inline(always)]
    fn is_actuation(&self) -> bool {
        true
    }

    #[inline(always)]
    fn add_forces(&self, now: &mut Instant<'_, T>, _hidden: &[T]) {
        let mut first = 0;
        for (i, section) in now.body.sections.iter().enumerate() {
            let own = first..first + section.bellows.len();
            first = own.end;
            if !self.sections.contains(&i) {
                continue;
            }
            let mut mean = T::zero();
            for (b, j) in section.bellows.iter().zip(own) {
                let state = &now.bellows[j];
                now.bellows_force[j] += stiffening::force(self.change.axial * state.pressure, b, state.length);
                mean += state.pressure;
            }
            let share = self.change.bending * mean * (1.0 / section.bellows.len() as f64);
            now.loads[i].on_arc += stiffening::on_arc(share, section, now.links[i].arc);
        }
    }
}
