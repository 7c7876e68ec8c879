//! The arm: a body with its pneumatics and its effects, over any scalar.

pub mod structure;
#[cfg(test)]
pub(crate) mod testing;
pub mod variants;

use crate::body::Body;
use crate::body::parameters::{ArmParameters, PneumaticsLevel};
use crate::effects::Effects;
use crate::error::Result;
use crate::pneumatics::Pneumatics;
use crate::real::Real;

/// A bellows arm.
#[derive(Clone, Debug)]
pub struct Arm<T = f64> {
    /// Its sections, and what holds for all of them.
    pub body: Body<T>,
    /// From commanded to acting pressure; the command acts as it is without.
    pub pneumatics: Option<Pneumatics<T>>,
    /// The effects that the paper's model leaves out.
    pub effects: Effects<T>,
}

/// Volume of the bellows of each input at the middle of their range of lengths, m^3.
fn middle_volumes(parameters: &ArmParameters) -> Vec<f64> {
    let mut out = vec![0.0; parameters.inputs.len()];
    for section in &parameters.section {
        let [shortest, longest] = section.length_range;
        for b in &section.bellows {
            out[b.input] += b.terminal_area * 0.5 * (shortest + longest);
        }
    }
    out
}

impl Arm<f64> {
    /// The arm that `parameters` describe.
    ///
    /// # Errors
    /// [`crate::error::Error::Parameter`] names the section or bellows, the key, what was found and what is allowed.
    pub fn new(parameters: &ArmParameters) -> Result<Self> {
        Ok(Self::unapplied(parameters)?.applied())
    }

    /// The same, but effects that change the arm's own parameters have not done so yet: numbers of effects can be set
    /// (after [`Arm::lift`], as lanes or dual numbers) with [`Effects::set`] before [`Arm::applied`].
    ///
    /// # Errors
    /// As for [`Arm::new`].
    pub fn unapplied(parameters: &ArmParameters) -> Result<Self> {
        let body = Body::new(parameters)?;
        let pneumatics = parameters.pneumatics.as_ref();
        let pneumatics = pneumatics
            .map(|p| Pneumatics::new(p, parameters.ambient_pressure, &middle_volumes(parameters)))
            .transpose()?
            .filter(|x| x.level != PneumaticsLevel::Ideal);
        let effects = Effects::new(&parameters.effect, &body, &parameters.inputs)?;
        Ok(Self { body, pneumatics, effects })
    }

    /// The same arm over another scalar.
    pub fn lift<T: Real>(&self) -> Arm<T> {
        self.map(T::from_f64)
    }

    /// The arm with `c` of every number, which are visited in a fixed order.
    pub fn map<T: Real>(&self, c: impl Fn(f64) -> T + Copy) -> Arm<T> {
        Arm {
            body: self.body.map(c),
            pneumatics: self.pneumatics.as_ref().map(|p| p.map(c)),
            effects: self.effects.map(c),
        }
    }
}

impl<T: Real> Arm<T> {
    /// The arm with its parameters changed by those effects that do so (payload, tilt, a weak bellows, ...); once, a second
    /// call changes nothing.
    pub fn applied(mut self) -> Self {
        self.effects.apply(&mut self.body);
        if let Some(pneumatics) = &mut self.pneumatics {
            pneumatics.walls_give = !self.body.area_changes.is_empty();
        }
        self
    }
}

impl<T> Arm<T> {
    /// Number of coordinates, three a section.
    #[inline(always)]
    pub fn coordinates(&self) -> usize {
        self.body.coordinates()
    }

    /// Number of bellows, of all sections.
    pub fn bellows(&self) -> usize {
        self.body.sections.iter().map(|s| s.bellows.len()).sum()
    }
}
