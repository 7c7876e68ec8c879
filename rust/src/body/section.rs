//! One section and its bellows.

use super::along::{PointMass, SectionArc, Taper, normalized};
use super::check::{finite, not_negative, positive};
use super::holding::{self, Axial, BENDING_TERMS, BendingPlanes};
use super::parameters::{BellowsParameters, SectionParameters};
use super::springs::{STIFFNESS_TERMS, stiffness_terms};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::real::linear::Vec3;

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
    /// k1, k3, k5 of the bending moment, in the mean over the planes.
    pub bending_stiffness: [T; BENDING_TERMS],
    /// How they differ from plane to plane, where they do.
    pub bending_planes: Option<Box<BendingPlanes<T>>>,
    /// What holds its mean length beside the bellows, where something does.
    pub axial: Option<Box<Axial<T>>>,
    /// Radius at the head below by `bellows_radius`: where the bellows' reactions act on that head.
    pub reaction_scale: T,
    /// Its arcs from the base on; none for a section that is one arc.
    pub arcs: Vec<SectionArc<T>>,
    /// What its bellows do that are not alike in all arcs.
    pub taper: Option<Box<Taper<T>>>,
    /// The masses along it, besides `mass`.
    pub masses: Vec<PointMass<T>>,
    /// The bellows.
    pub bellows: Vec<Bellows<T>>,
}

impl Bellows<f64> {
    pub(super) fn new(place: &str, p: &BellowsParameters, inputs: usize) -> Result<Self> {
        let wrong = |key, found: usize, allowed| {
            Err(Error::Parameter { place: place.to_owned(), key, found: found.to_string(), allowed })
        };
        if p.input >= inputs {
            return wrong("input", p.input, "the index of one of the arm's inputs is needed");
        }
        let radius = not_negative(place, "radius", p.radius)?;
        let angle = finite(place, "angle", p.angle)?;
        let (cos, sin) = cos_sin(angle);
        Ok(Self {
            x: radius * cos,
            y: radius * sin,
            terminal_area: not_negative(place, "terminal_area", p.terminal_area)?,
            rest_length: finite(place, "rest_length", p.rest_length)?,
            stiffness: stiffness_terms(place, &p.stiffness)?,
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
    pub(super) fn new(index: usize, p: &SectionParameters, radius_below: f64, inputs: usize) -> Result<Self> {
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
        let (arcs, taper) = normalized(SectionArc::all(&place, &p.arcs)?);
        let first = arcs.first().map(|a| (a.relative_radius, a.relative_area));
        let tapers = arcs.iter().any(|a| Some((a.relative_radius, a.relative_area)) != first);
        let (bending_stiffness, bending_planes) = holding::bending(&place, p)?;
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
            bending_stiffness,
            bending_planes,
            axial: p.axial.as_ref().map(|a| Axial::new(&place, a)).transpose()?.map(Box::new),
            reaction_scale: radius_below / bellows_radius,
            arcs,
            taper: tapers.then(|| Box::new(taper)),
            masses: PointMass::all(&place, &p.masses)?,
            bellows,
        })
    }

    /// Whether the area of the bellows differs from arc to arc.
    pub(super) fn has_several_areas(&self) -> bool {
        self.arcs.iter().any(|a| a.relative_area != self.arcs[0].relative_area)
    }
}

impl Bellows<f64> {
    /// The same with `c` of every number.
    fn map<T: Real>(&self, c: impl Fn(f64) -> T + Copy) -> Bellows<T> {
        Bellows {
            x: c(self.x),
            y: c(self.y),
            terminal_area: c(self.terminal_area),
            rest_length: c(self.rest_length),
            stiffness: self.stiffness.map(c),
            stiffness_terms: self.stiffness_terms,
            damping: c(self.damping),
            input: self.input,
        }
    }
}

impl Section<f64> {
    /// The same with `c` of every number.
    pub(super) fn map<T: Real>(&self, c: impl Fn(f64) -> T + Copy) -> Section<T> {
        let v = |a: Vec3<f64>| Vec3(a.0.map(c));
        Section {
            mass: c(self.mass),
            inertia: v(self.inertia),
            products_of_inertia: self.products_of_inertia.map(v),
            center_of_mass: v(self.center_of_mass),
            force_point: v(self.force_point),
            bellows_radius: c(self.bellows_radius),
            inverse_radius: c(self.inverse_radius),
            base_offset: c(self.base_offset),
            head_offset: c(self.head_offset),
            bending_stiffness: self.bending_stiffness.map(c),
            bending_planes: self.bending_planes.as_ref().map(|b| Box::new(b.map(c))),
            axial: self.axial.as_ref().map(|a| Box::new(a.map(c))),
            reaction_scale: c(self.reaction_scale),
            arcs: self.arcs.iter().map(|a| a.map(c)).collect(),
            taper: self.taper.as_ref().map(|t| Box::new(t.map(c))),
            masses: self.masses.iter().map(|m| m.map(c)).collect(),
            bellows: self.bellows.iter().map(|b| b.map(c)).collect(),
        }
    }
}
