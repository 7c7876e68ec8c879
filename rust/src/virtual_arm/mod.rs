//! A measurement without a laboratory: an arm whose mass is spread over its length and whose material creeps.
//!
//! What: the same sections, bellows and head plates as the lumped model of this crate, but every section carries, besides
//! its head plate, discs ("slices") along its arc, and every bellows has Maxwell branches (a spring behind a damper)
//! beside its spring. Experiments take it for the real arm and the lumped model for what is to be judged.
//! Source: mass matrix and velocity products as the sum over rigid bodies of J_v^T m J_v + J_w^T I J_w and
//! J_v^T m a + J_w^T (I alpha + w x I w), with geometric Jacobians (Lynch & Park, *Modern Robotics*, ch. 5 and 8);
//! Maxwell branches: f = k z, z' = b' - z / tau (Ferry, *Viscoelastic Properties of Polymers*, ch. 1).
//! Frame and sign: as everywhere: base frame, z along the straight arm, bellows forces positive where they lengthen.
//! Independence: dense matrices, double precision, its own arc functions, its own forces, its own Runge-Kutta loop. Of the
//! crate it uses the parameters, the sampled input and the errors; nothing of kinematics, forces, dynamics or integrate.
//! With no slices and no creep it must equal the lumped model, which checks both (`tests.rs`).
//! Limits: constant curvature within a section, bending angles up to [`PSI_MAX`].

mod arc;
mod equations;
mod frame;
mod run;
#[cfg(test)]
mod tests;

pub use arc::PSI_MAX;
pub use run::{Rows, State};

use crate::arm::Arm;
use crate::body::BENDING_TERMS;
use crate::body::parameters::{ArmParameters, ForceModel, PneumaticsLevel, SectionParameters};
use crate::error::{Error, Result};
use nalgebra::Vector3;

/// Mass along the arc of one section, besides the head plate that `SectionParameters` describe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distributed {
    /// Number of slices; each sits in the middle of its share of the arc.
    pub slices: usize,
    /// Mass of all slices together, kg.
    pub mass: f64,
    /// Moments of inertia of all slices together, each about its own centre, along its own axes, kg m^2.
    pub inertia: [f64; 3],
}

/// A Maxwell branch beside every bellows' spring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Creep {
    /// Its stiffness as a share of the spring's linear stiffness.
    pub share: f64,
    /// Time constant, s.
    pub time_constant: f64,
}

/// One bellows.
#[derive(Clone, Debug)]
struct Bellows {
    x: f64,
    y: f64,
    terminal_area: f64,
    rest_length: f64,
    stiffness: Vec<f64>,
    damping: f64,
    input: usize,
}

/// One section.
#[derive(Clone, Debug)]
struct Section {
    plate_mass: f64,
    plate_inertia: Vector3<f64>,
    plate_center: Vector3<f64>,
    force_point: Vector3<f64>,
    distributed: Distributed,
    radius: f64,
    base_offset: f64,
    head_offset: f64,
    bending_stiffness: [f64; BENDING_TERMS],
    bellows: Vec<Bellows>,
}

/// The virtual arm. Its coordinates inside are (u, v, l) of each section; lengths outside.
#[derive(Clone, Debug)]
pub struct VirtualArm {
    gravity: Vector3<f64>,
    ambient_pressure: f64,
    force_model: ForceModel,
    inputs: usize,
    sections: Vec<Section>,
    creep: Vec<Creep>,
}

impl VirtualArm {
    /// The arm of `parameters`, whose masses and inertias are those of the head plates, with `distributed` mass in each
    /// section and the Maxwell branches `creep` in each bellows.
    ///
    /// # Errors
    /// [`Error::Parameter`] and [`Error::Input`] for values that are not allowed.
    pub fn new(parameters: &ArmParameters, distributed: &[Distributed], creep: &[Creep]) -> Result<Self> {
        Arm::new(parameters)?;
        let ideal = parameters.pneumatics.as_ref().is_none_or(|p| p.level == PneumaticsLevel::Ideal);
        if !parameters.effect.is_empty() || !ideal {
            let text = "a virtual arm takes no effects and no pneumatics of the model; it has its own";
            return Err(Error::Input(text.to_owned()));
        }
        let along = |s: &SectionParameters| !s.arcs.is_empty() || !s.masses.is_empty();
        if parameters.base.is_some() || parameters.section.iter().any(along) {
            let text = "a virtual arm stands at the world's origin and takes no arcs and masses of the model's sections; \
                        its own mass along a section is `distributed`";
            return Err(Error::Input(text.to_owned()));
        }
        if !(parameters.rotational_energy && parameters.coriolis_forces) {
            let text =
                "a virtual arm cannot leave out rotational energy or Coriolis forces; it stands for the real arm";
            return Err(Error::Input(text.to_owned()));
        }
        if distributed.len() != parameters.section.len() {
            return Err(Error::Input(format!(
                "distributed: {} entries; one for each of the {} sections is needed",
                distributed.len(),
                parameters.section.len()
            )));
        }
        for (i, d) in distributed.iter().enumerate() {
            let finite = std::iter::once(d.mass).chain(d.inertia).all(|x| x.is_finite() && x >= 0.0);
            if !finite || (d.slices == 0 && d.mass > 0.0) {
                return Err(Error::Input(format!(
                    "distributed, section {}: {d:?}; finite values not below zero, and slices for a mass, are needed",
                    i + 1
                )));
            }
        }
        if let Some(c) = creep.iter().find(|c| !(c.share >= 0.0 && c.share.is_finite() && c.time_constant > 0.0)) {
            return Err(Error::Input(format!("creep: {c:?}; a share not below zero and a positive time are needed")));
        }
        if let Some(i) =
            parameters.section.iter().position(|s| s.cross_bending_stiffness.is_some() || s.axial.is_some())
        {
            return Err(Error::Input(format!(
                "a virtual arm has one bending stiffness for all planes and no axial stiffness; section {} states \
                 cross_bending_stiffness, axial_stiffness or axial_damping",
                i + 1
            )));
        }
        let sections = parameters.section.iter().zip(distributed).map(|(p, d)| Section {
            plate_mass: p.mass,
            plate_inertia: Vector3::from(p.inertia),
            plate_center: Vector3::from(p.center_of_mass),
            force_point: Vector3::from(p.force_point.unwrap_or(p.center_of_mass)),
            distributed: *d,
            radius: p.bellows_radius,
            base_offset: p.base_offset,
            head_offset: p.head_offset,
            bending_stiffness: p.bending_stiffness,
            bellows: p
                .bellows
                .iter()
                .map(|b| Bellows {
                    x: b.radius * b.angle.cos(),
                    y: b.radius * b.angle.sin(),
                    terminal_area: b.terminal_area,
                    rest_length: b.rest_length,
                    stiffness: b.stiffness.clone(),
                    damping: b.damping,
                    input: b.input,
                })
                .collect(),
        });
        Ok(Self {
            gravity: Vector3::from(parameters.gravity),
            ambient_pressure: parameters.ambient_pressure,
            force_model: parameters.force_model,
            inputs: parameters.inputs.len(),
            sections: sections.collect(),
            creep: creep.to_vec(),
        })
    }

    /// Number of coordinates.
    pub fn coordinates(&self) -> usize {
        3 * self.sections.len()
    }

    /// Number of pressure inputs.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Number of creep states: branches times bellows.
    pub fn creep_states(&self) -> usize {
        self.creep.len() * self.sections.iter().map(|s| s.bellows.len()).sum::<usize>()
    }

    /// (u, v, l) of every section from the lengths, by (7) without its singularity; rates alike.
    fn arcs(&self, lengths: &[f64]) -> Vec<f64> {
        let each = lengths.chunks_exact(3).zip(&self.sections);
        each.flat_map(|(q, s)| {
            let u = (q[1] + q[2] - 2.0 * q[0]) / (3.0 * s.radius);
            let v = (q[2] - q[1]) / (3.0_f64.sqrt() * s.radius);
            [u, v, (q[0] + q[1] + q[2]) / 3.0]
        })
        .collect()
    }

    /// Lengths from (u, v, l).
    fn lengths(&self, arcs: &[f64]) -> Vec<f64> {
        let h = 0.75_f64.sqrt();
        let each = arcs.chunks_exact(3).zip(&self.sections);
        each.flat_map(|(x, s)| {
            let (u, v, l) = (s.radius * x[0], s.radius * x[1], x[2]);
            [l - u, l + 0.5 * u - h * v, l + 0.5 * u + h * v]
        })
        .collect()
    }
}
