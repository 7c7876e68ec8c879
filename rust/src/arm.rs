//! The arm: validated, immutable parameters, over any scalar.

use crate::effects::Effects;
use crate::error::{Error, Result};
use crate::linear::Vec3;
use crate::parameters::{ArmParameters, BellowsParameters, ForceModel, PneumaticsLevel, SectionParameters};
use crate::pneumatics::Pneumatics;
use crate::real::Real;

/// Highest power of the spring polynomial.
pub const STIFFNESS_TERMS: usize = 8;
/// Most sections: rest and linearization take time with the cube of their number, about a second for these.
pub const MOST_SECTIONS: usize = 256;
/// Most bellows in a section.
pub const BELLOWS_PER_SECTION: usize = 12;

/// One bellows.
#[derive(Clone, Debug)]
pub struct Bellows<T> {
    /// `radius cos(angle)`, m.
    pub x: T,
    /// `radius sin(angle)`, m.
    pub y: T,
    /// Terminal area A_P, m^2.
    pub terminal_area: T,
    /// Length without spring force, m.
    pub rest_length: T,
    /// Spring polynomial, from the first power.
    pub stiffness: [T; STIFFNESS_TERMS],
    /// How many terms of `stiffness` are used.
    pub stiffness_terms: usize,
    /// Viscous damping, N s/m.
    pub damping: T,
    /// Index of its pressure input.
    pub input: usize,
}

/// One section.
#[derive(Clone, Debug)]
pub struct Section<T> {
    /// Lumped mass, kg.
    pub mass: T,
    /// Principal moments of inertia along the head frame's axes, kg m^2.
    pub inertia: Vec3<T>,
    /// Products of inertia J_xy, J_xz, J_yz, kg m^2, where a payload beside the axes makes some.
    pub products_of_inertia: Option<Vec3<T>>,
    /// Centre of mass in the head frame, m.
    pub center_of_mass: Vec3<T>,
    /// Where external forces act, in the head frame, m. A property of where the force was measured: it stays where it is
    /// when a payload moves the centre of mass.
    pub force_point: Vec3<T>,
    /// Radius of the coordinate lengths, m.
    pub bellows_radius: T,
    /// `1 / bellows_radius`.
    pub inverse_radius: T,
    /// Rigid piece before the arc, m.
    pub base_offset: T,
    /// Rigid piece after the arc, m.
    pub head_offset: T,
    /// k1, k3 of the bending moment.
    pub bending_stiffness: [T; 2],
    /// `bellows_radius of the section below / bellows_radius`: where the bellows' reactions act on the head below.
    pub reaction_scale: T,
    /// The bellows.
    pub bellows: Vec<Bellows<T>>,
}

/// A bellows arm.
#[derive(Clone, Debug)]
pub struct Arm<T = f64> {
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
    /// From commanded to acting pressure; the command acts as it is without.
    pub pneumatics: Option<Pneumatics<T>>,
    /// The sections from the base on.
    pub sections: Vec<Section<T>>,
    /// The effects that the paper's model leaves out.
    pub effects: Effects<T>,
}

fn check(place: &str, key: &'static str, value: f64, ok: bool, allowed: &'static str) -> Result<f64> {
    if value.is_finite() && ok {
        return Ok(value);
    }
    Err(Error::Parameter { place: place.to_owned(), key, found: value.to_string(), allowed })
}

fn positive(place: &str, key: &'static str, value: f64) -> Result<f64> {
    check(place, key, value, value > 0.0, "a positive, finite number is needed")
}

fn not_negative(place: &str, key: &'static str, value: f64) -> Result<f64> {
    check(place, key, value, value >= 0.0, "a finite number not below zero is needed")
}

fn finite(place: &str, key: &'static str, value: f64) -> Result<f64> {
    check(place, key, value, true, "a finite number is needed")
}

impl Bellows<f64> {
    fn new(place: &str, p: &BellowsParameters, inputs: usize) -> Result<Self> {
        let wrong = |key, found: usize, allowed| {
            Err(Error::Parameter { place: place.to_owned(), key, found: found.to_string(), allowed })
        };
        if p.stiffness.is_empty() || p.stiffness.len() > STIFFNESS_TERMS {
            return wrong("number of stiffness terms", p.stiffness.len(), "1 to 8 are allowed");
        }
        if p.input >= inputs {
            return wrong("input", p.input, "the index of one of the arm's inputs is needed");
        }
        let radius = not_negative(place, "radius", p.radius)?;
        let angle = finite(place, "angle", p.angle)?;
        let mut stiffness = [0.0; STIFFNESS_TERMS];
        for (k, &s) in stiffness.iter_mut().zip(&p.stiffness) {
            *k = finite(place, "stiffness", s)?;
        }
        let (cos, sin) = cos_sin(angle);
        Ok(Self {
            x: radius * cos,
            y: radius * sin,
            terminal_area: not_negative(place, "terminal_area", p.terminal_area)?,
            rest_length: finite(place, "rest_length", p.rest_length)?,
            stiffness,
            stiffness_terms: p.stiffness.len(),
            damping: finite(place, "damping", p.damping)?,
            input: p.input,
        })
    }
}

/// Cosine and sine, exact at the multiples of 30 degrees where bellows usually sit, so that symmetric arms stay so.
fn cos_sin(angle: f64) -> (f64, f64) {
    let steps = angle / (std::f64::consts::PI / 6.0);
    let nearest = steps.round();
    if (steps - nearest).abs() > 1e-12 {
        return (angle.cos(), angle.sin());
    }
    let h = 0.75_f64.sqrt();
    let cos = [1.0, h, 0.5, 0.0, -0.5, -h, -1.0, -h, -0.5, 0.0, 0.5, h];
    let k = nearest.rem_euclid(12.0) as usize;
    (cos[k], cos[(k + 9) % 12])
}

impl Section<f64> {
    fn new(index: usize, p: &SectionParameters, radius_below: f64, inputs: usize) -> Result<Self> {
        let place = format!("section {}", index + 1);
        if p.bellows.is_empty() || p.bellows.len() > BELLOWS_PER_SECTION {
            let found = p.bellows.len().to_string();
            return Err(Error::Parameter { place, key: "number of bellows", found, allowed: "1 to 12 are allowed" });
        }
        let bellows_radius = positive(&place, "bellows_radius", p.bellows_radius)?;
        let mut inertia = [0.0; 3];
        let mut center_of_mass = [0.0; 3];
        let mut force_point = p.force_point.unwrap_or(p.center_of_mass);
        for k in 0..3 {
            inertia[k] = not_negative(&place, "inertia", p.inertia[k])?;
            center_of_mass[k] = finite(&place, "center_of_mass", p.center_of_mass[k])?;
            force_point[k] = finite(&place, "force_point", force_point[k])?;
        }
        let bellows = p
            .bellows
            .iter()
            .enumerate()
            .map(|(k, b)| Bellows::new(&format!("{place}, bellows {}", k + 1), b, inputs))
            .collect::<Result<_>>()?;
        Ok(Self {
            mass: positive(&place, "mass", p.mass)?,
            inertia: Vec3(inertia),
            products_of_inertia: None,
            center_of_mass: Vec3(center_of_mass),
            force_point: Vec3(force_point),
            bellows_radius,
            inverse_radius: 1.0 / bellows_radius,
            base_offset: finite(&place, "base_offset", p.base_offset)?,
            head_offset: finite(&place, "head_offset", p.head_offset)?,
            bending_stiffness: [
                finite(&place, "bending_stiffness", p.bending_stiffness[0])?,
                finite(&place, "bending_stiffness", p.bending_stiffness[1])?,
            ],
            reaction_scale: radius_below / bellows_radius,
            bellows,
        })
    }
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
    /// [`Error::Parameter`] names the section or bellows, the key, what was found and what is allowed.
    pub fn new(parameters: &ArmParameters) -> Result<Self> {
        Ok(Self::unapplied(parameters)?.applied())
    }

    /// The same, but effects that change the arm's own parameters have not done so yet: numbers of effects can be set
    /// (after [`Arm::lift`], as lanes or dual numbers) with [`Effects::set`] before [`Arm::applied`].
    ///
    /// # Errors
    /// As for [`Arm::new`].
    pub fn unapplied(parameters: &ArmParameters) -> Result<Self> {
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
        let pneumatics = parameters.pneumatics.as_ref();
        let pneumatics = pneumatics
            .map(|p| Pneumatics::new(p, parameters.ambient_pressure, &middle_volumes(parameters)))
            .transpose()?
            .filter(|x| x.level != PneumaticsLevel::Ideal);
        let mut arm = Self {
            gravity: Vec3(parameters.gravity),
            ambient_pressure: not_negative("arm", "ambient_pressure", parameters.ambient_pressure)?,
            force_model: parameters.force_model,
            rotational_energy: parameters.rotational_energy,
            coriolis_forces: parameters.coriolis_forces,
            inputs: parameters.inputs.len(),
            pneumatics,
            sections,
            effects: Effects::none(),
        };
        arm.effects = Effects::new(&parameters.effect, &arm, &parameters.inputs)?;
        Ok(arm)
    }

    /// The same arm over another scalar.
    pub fn lift<T: Real>(&self) -> Arm<T> {
        self.map(T::from_f64)
    }

    /// The arm with `c` of every number, which are visited in a fixed order.
    pub fn map<T: Real>(&self, c: impl Fn(f64) -> T + Copy) -> Arm<T> {
        let v = |a: Vec3<f64>| Vec3(a.0.map(c));
        Arm {
            gravity: v(self.gravity),
            ambient_pressure: c(self.ambient_pressure),
            force_model: self.force_model,
            rotational_energy: self.rotational_energy,
            coriolis_forces: self.coriolis_forces,
            inputs: self.inputs,
            pneumatics: self.pneumatics.as_ref().map(|p| p.map(c)),
            sections: self
                .sections
                .iter()
                .map(|s| Section {
                    mass: c(s.mass),
                    inertia: v(s.inertia),
                    products_of_inertia: s.products_of_inertia.map(v),
                    center_of_mass: v(s.center_of_mass),
                    force_point: v(s.force_point),
                    bellows_radius: c(s.bellows_radius),
                    inverse_radius: c(s.inverse_radius),
                    base_offset: c(s.base_offset),
                    head_offset: c(s.head_offset),
                    bending_stiffness: s.bending_stiffness.map(c),
                    reaction_scale: c(s.reaction_scale),
                    bellows: s
                        .bellows
                        .iter()
                        .map(|b| Bellows {
                            x: c(b.x),
                            y: c(b.y),
                            terminal_area: c(b.terminal_area),
                            rest_length: c(b.rest_length),
                            stiffness: b.stiffness.map(c),
                            stiffness_terms: b.stiffness_terms,
                            damping: c(b.damping),
                            input: b.input,
                        })
                        .collect(),
                })
                .collect(),
            effects: self.effects.map(c),
        }
    }
}

impl<T: Real> Arm<T> {
    /// The arm with its parameters changed by those effects that do so (payload, tilt, a weak bellows, ...); once, a second
    /// call changes nothing.
    pub fn applied(mut self) -> Self {
        if !self.effects.applied {
            let effects = std::mem::replace(&mut self.effects, Effects::none());
            for entry in &effects.list {
                entry.kind.change_arm(&mut self);
            }
            self.effects = Effects { applied: true, ..effects };
        }
        self
    }
}

impl<T> Arm<T> {
    /// Number of coordinates, three a section.
    #[inline(always)]
    pub fn coordinates(&self) -> usize {
        3 * self.sections.len()
    }
}
