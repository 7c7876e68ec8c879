//! The body of an arm: its sections with their bellows, and what holds for all of them, over any scalar.
//!
//! Validated and immutable: [`parameters`] is what a file says, [`Body`] what the equations read. Pneumatics and effects are
//! no part of it; `arm::Arm` puts them beside it.

mod check;
pub mod parameters;
mod section;

pub use parameters::ForceModel;
pub use section::{BELLOWS_PER_SECTION, Bellows, STIFFNESS_TERMS, Section};

use self::check::{finite, not_negative};
use self::parameters::ArmParameters;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::real::linear::Vec3;

/// Most sections: rest and linearization take time with the cube of their number, about a second for these.
pub const MOST_SECTIONS: usize = 256;

/// Sections, and what holds for all of them.
#[derive(Clone, Debug)]
pub struct Body<T = f64> {
    /// Gravity in the base frame, m/s^2.
    pub gravity: Vec3<T>,
    /// Ambient pressure, Pa.
    pub ambient_pressure: T,
    /// How bellows forces act.
    pub force_model: ForceModel,
    /// Whether rotational energy counts.
    pub rotational_energy: bool,
    /// Whether Coriolis forces count.
    pub coriolis_forces: bool,
    /// Number of pressure inputs.
    pub inputs: usize,
    /// The sections from the base on.
    pub sections: Vec<Section<T>>,
}

impl Body<f64> {
    /// The body that `parameters` describe.
    ///
    /// # Errors
    /// [`Error::Parameter`] names the section or bellows, the key, what was found and what is allowed.
    pub fn new(parameters: &ArmParameters) -> Result<Self> {
        if !(1..=MOST_SECTIONS).contains(&parameters.section.len()) {
            return Err(Error::Parameter {
                place: parameters.name.clone(),
                key: "number of sections",
                found: parameters.section.len().to_string(),
                allowed: "1 to 256 are allowed",
            });
        }
        for g in parameters.gravity {
            finite("arm", "gravity", g)?;
        }
        let mut radius_below = parameters.section[0].bellows_radius;
        let mut sections = Vec::with_capacity(parameters.section.len());
        for (i, p) in parameters.section.iter().enumerate() {
            sections.push(Section::new(i, p, radius_below, parameters.inputs.len())?);
            radius_below = p.bellows_radius;
        }
        Ok(Self {
            gravity: Vec3(parameters.gravity),
            ambient_pressure: not_negative("arm", "ambient_pressure", parameters.ambient_pressure)?,
            force_model: parameters.force_model,
            rotational_energy: parameters.rotational_energy,
            coriolis_forces: parameters.coriolis_forces,
            inputs: parameters.inputs.len(),
            sections,
        })
    }

    /// The body with `c` of every number, which are visited in a fixed order.
    pub fn map<T: Real>(&self, c: impl Fn(f64) -> T + Copy) -> Body<T> {
        Body {
            gravity: Vec3(self.gravity.0.map(c)),
            ambient_pressure: c(self.ambient_pressure),
            force_model: self.force_model,
            rotational_energy: self.rotational_energy,
            coriolis_forces: self.coriolis_forces,
            inputs: self.inputs,
            sections: self.sections.iter().map(|s| s.map(c)).collect(),
        }
    }
}

impl<T> Body<T> {
    /// Number of coordinates, three a section.
    #[inline(always)]
    pub fn coordinates(&self) -> usize {
        3 * self.sections.len()
    }
}
