//! The body of an arm: its sections with their bellows, and what holds for all of them, over any scalar.
//!
//! Validated and immutable: [`parameters`] is what a file says, [`Body`] what the equations read. Pneumatics and effects are
//! no part of it; `arm::Arm` puts them beside it.

mod along;
mod base;
mod check;
mod holding;
pub mod parameters;
mod section;
mod springs;

pub use along::{MOST_ALONG, PointMass, SectionArc, Taper};
pub use base::Base;
pub use holding::{Axial, BENDING_TERMS, BendingPlanes};
pub use parameters::ForceModel;
pub use section::{BELLOWS_PER_SECTION, Bellows, Section};
pub use springs::STIFFNESS_TERMS;

use self::along::normalized;
use self::check::{finite, not_negative};
use self::parameters::ArmParameters;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::real::linear::Vec3;

/// Most sections: rest and linearization take time with the cube of their number, about a second for these.
pub const MOST_SECTIONS: usize = 256;

/// How the terminal area of a bellows changes: A = A_P (1 + a (p - p_amb) + b (q - q_rest)).
#[derive(Clone, Copy, Debug)]
pub struct AreaChange<T> {
    /// a, 1/Pa.
    pub by_pressure: T,
    /// b, 1/m.
    pub by_length: T,
}

/// How stiffness changes for each pascal above ambient.
#[derive(Clone, Copy, Debug)]
pub struct Stiffening<T> {
    /// That of the bellows' springs, relative, 1/Pa.
    pub axial: T,
    /// That of bending, relative, 1/Pa.
    pub bending: T,
}

/// Sections, and what holds for all of them.
#[derive(Clone, Debug)]
pub struct Body<T = f64> {
    /// Where the base stands in the world.
    pub base: Base<T>,
    /// Gravity in the world, m/s^2.
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
    /// Changes of the terminal areas, one a bellows, section by section; empty where none changes.
    pub area_changes: Vec<AreaChange<T>>,
    /// Changes of stiffness by pressure, one a section; empty where none changes.
    pub stiffening: Vec<Stiffening<T>>,
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
            radius_below = p.bellows_radius * sections[i].taper.as_ref().map_or(1.0, |t| t.head_radius);
        }
        for (i, section) in sections.iter().enumerate() {
            if parameters.force_model == ForceModel::EndForce && section.has_several_areas() {
                return Err(Error::Parameter {
                    place: format!("section {}", i + 1),
                    key: "relative_area",
                    found: "areas that differ along the section".to_owned(),
                    allowed: "with end_force a bellows pushes both ends with one force, (27); work_conjugate is needed",
                });
            }
        }
        Ok(Self {
            base: Base::new(parameters.base.as_ref())?,
            gravity: Vec3(parameters.gravity),
            ambient_pressure: not_negative("arm", "ambient_pressure", parameters.ambient_pressure)?,
            force_model: parameters.force_model,
            rotational_energy: parameters.rotational_energy,
            coriolis_forces: parameters.coriolis_forces,
            inputs: parameters.inputs.len(),
            sections,
            area_changes: Vec::new(),
            stiffening: Vec::new(),
        })
    }

    /// The body with `c` of every number, which are visited in a fixed order.
    pub fn map<T: Real>(&self, c: impl Fn(f64) -> T + Copy) -> Body<T> {
        Body {
            base: self.base.map(c),
            gravity: Vec3(self.gravity.0.map(c)),
            ambient_pressure: c(self.ambient_pressure),
            force_model: self.force_model,
            rotational_energy: self.rotational_energy,
            coriolis_forces: self.coriolis_forces,
            inputs: self.inputs,
            sections: self.sections.iter().map(|s| s.map(c)).collect(),
            area_changes: self
                .area_changes
                .iter()
                .map(|x| AreaChange { by_pressure: c(x.by_pressure), by_length: c(x.by_length) })
                .collect(),
            stiffening: self
                .stiffening
                .iter()
                .map(|x| Stiffening { axial: c(x.axial), bending: c(x.bending) })
                .collect(),
        }
    }
}

impl<T: Real> Body<T> {
    /// Gives section `i` other arcs, whose shares are taken by their sums and whose radii and areas by their means.
    pub fn set_arcs(&mut self, i: usize, arcs: Vec<SectionArc<T>>) {
        let (arcs, taper) = normalized(arcs);
        let section = &mut self.sections[i];
        section.arcs = arcs;
        if let Some(old) = section.taper.replace(Box::new(taper)) {
            if let Some(above) = self.sections.get_mut(i + 1) {
                above.reaction_scale *= taper.head_radius / old.head_radius;
            }
        } else {
            section.taper = None;
        }
    }
}

impl<T> Body<T> {
    /// Number of masses along the sections, besides those at the heads.
    #[inline(always)]
    pub fn masses(&self) -> usize {
        self.sections.iter().map(|s| s.masses.len()).sum()
    }

    /// Number of coordinates, three a section.
    #[inline(always)]
    pub fn coordinates(&self) -> usize {
        3 * self.sections.len()
    }
}
