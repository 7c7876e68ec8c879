//! What differs along a section: its arcs and the masses that lie on it.
//!
//! Source: paper (6), (8) with its remarks on variable and piecewise constant curvature and on conical sections. The
//! shares are fixed by the section's geometry, so that its coordinates stay three lengths.
//! A bellows beside the centre line has the length q_k = sum_j (l_j - r_j psi_j cos(phi - a_k)) with l_j = lambda_j l and
//! psi_j = beta_j psi, that of one arc at the radius sum_j beta_j r_j; its pressure does the work (p - p_amb) dV on
//! V_k = sum_j A_j (l_j - r_j psi_j cos(phi - a_k)). Radii and areas are kept relative to these means.

use super::check::{finite, not_negative, positive};
use super::parameters::{PointMassParameters, SectionArcParameters};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::real::linear::Vec3;

/// Most arcs, and most masses, of a section.
pub const MOST_ALONG: usize = 32;
/// How far sums of rounded shares may be from 1.
const SUM: f64 = 1e-6;

/// One of several arcs that make a section, from its base on.
#[derive(Clone, Copy, Debug)]
pub struct SectionArc<T> {
    /// Share of the section's length; the shares add up to 1.
    pub length: T,
    /// Share of its bending angle, likewise.
    pub bending: T,
    /// Radius of the bellows here by that of the section; 1 in the mean weighted by bending.
    pub relative_radius: T,
    /// Area of the bellows here by their mean; 1 in the mean weighted by length.
    pub relative_area: T,
}

/// A mass at a place along a section.
#[derive(Clone, Copy, Debug)]
pub struct PointMass<T> {
    /// Where on the section's arcs, as a share of their length.
    pub share: T,
    /// Mass, kg.
    pub mass: T,
    /// Principal moments of inertia about its centre of mass, along the axes of the centre line's frame there, kg m^2.
    pub inertia: Vec3<T>,
    /// Its centre of mass in that frame, m.
    pub offset: Vec3<T>,
}

/// What tapering bellows do besides giving the arcs their lengths.
#[derive(Clone, Copy, Debug)]
pub struct Taper<T> {
    /// Radius at the head by that of the section: where end forces act.
    pub head_radius: T,
    /// Lever of a pressure by that of a spring, sum_j beta_j A_j r_j of the relative numbers.
    pub pressure_lever: T,
}

/// Arcs whose shares and relative numbers are those of their means, and their taper.
pub(super) fn normalized<T: Real>(mut arcs: Vec<SectionArc<T>>) -> (Vec<SectionArc<T>>, Taper<T>) {
    let mut taper = Taper { head_radius: T::one(), pressure_lever: T::one() };
    if arcs.is_empty() {
        return (arcs, taper);
    }
    taper.pressure_lever = T::zero();
    let (mut length, mut bending, mut radius, mut area) = (T::zero(), T::zero(), T::zero(), T::zero());
    for arc in &arcs {
        length += arc.length;
        bending += arc.bending;
        radius += arc.bending * arc.relative_radius;
        area += arc.length * arc.relative_area;
    }
    let (radius, area) = (bending / radius, length / area);
    let (length, bending) = (length.recip(), bending.recip());
    for arc in &mut arcs {
        arc.length *= length;
        arc.bending *= bending;
        arc.relative_radius *= radius;
        arc.relative_area *= area;
        taper.head_radius = arc.relative_radius;
        taper.pressure_lever += arc.bending * arc.relative_area * arc.relative_radius;
    }
    (arcs, taper)
}

impl SectionArc<f64> {
    pub(super) fn all(place: &str, parameters: &[SectionArcParameters]) -> Result<Vec<Self>> {
        let wrong =
            |key, found: String, allowed| Err(Error::Parameter { place: place.to_owned(), key, found, allowed });
        if parameters.len() > MOST_ALONG {
            return wrong("number of arcs", parameters.len().to_string(), "at most 32 are allowed");
        }
        let mut arcs = Vec::with_capacity(parameters.len());
        for (k, p) in parameters.iter().enumerate() {
            let place = format!("{place}, arc {}", k + 1);
            arcs.push(Self {
                length: positive(&place, "length", p.length)?,
                bending: finite(&place, "bending", p.bending)?,
                relative_radius: positive(&place, "relative_radius", p.relative_radius)?,
                relative_area: positive(&place, "relative_area", p.relative_area)?,
            });
        }
        let sum = |of: fn(&Self) -> f64| arcs.iter().map(of).sum::<f64>();
        for (key, total) in [("length", sum(|a| a.length)), ("bending", sum(|a| a.bending))] {
            if !arcs.is_empty() && (total - 1.0).abs() > SUM {
                return wrong(
                    key,
                    format!("shares with the sum {total}"),
                    "shares of the arcs that add up to 1 are needed",
                );
            }
        }
        if !arcs.is_empty() && sum(|a| a.bending * a.relative_radius) <= 0.0 {
            let allowed = "a mean radius, weighted by bending, above 0 is needed";
            return wrong("relative_radius", sum(|a| a.bending * a.relative_radius).to_string(), allowed);
        }
        Ok(arcs)
    }

    /// The same with `c` of every number.
    pub(super) fn map<T: Real>(&self, c: impl Fn(f64) -> T + Copy) -> SectionArc<T> {
        SectionArc {
            length: c(self.length),
            bending: c(self.bending),
            relative_radius: c(self.relative_radius),
            relative_area: c(self.relative_area),
        }
    }
}

impl PointMass<f64> {
    pub(super) fn all(place: &str, parameters: &[PointMassParameters]) -> Result<Vec<Self>> {
        if parameters.len() > MOST_ALONG {
            let (found, allowed) = (parameters.len().to_string(), "at most 32 are allowed");
            return Err(Error::Parameter { place: place.to_owned(), key: "number of masses", found, allowed });
        }
        let mut masses = Vec::with_capacity(parameters.len());
        for (k, p) in parameters.iter().enumerate() {
            let place = format!("{place}, mass {}", k + 1);
            if !(0.0..=1.0).contains(&p.share) {
                let (found, allowed) = (p.share.to_string(), "a number from 0 to 1 is needed");
                return Err(Error::Parameter { place, key: "share", found, allowed });
            }
            let (mut inertia, mut offset) = ([0.0; 3], [0.0; 3]);
            for k in 0..3 {
                inertia[k] = not_negative(&place, "inertia", p.inertia[k])?;
                offset[k] = finite(&place, "offset", p.offset[k])?;
            }
            let mass = positive(&place, "mass", p.mass)?;
            masses.push(Self { share: p.share, mass, inertia: Vec3(inertia), offset: Vec3(offset) });
        }
        Ok(masses)
    }

    /// The same with `c` of every number.
    pub(super) fn map<T: Real>(&self, c: impl Fn(f64) -> T + Copy) -> PointMass<T> {
        let v = |a: Vec3<f64>| Vec3(a.0.map(c));
        PointMass { share: c(self.share), mass: c(self.mass), inertia: v(self.inertia), offset: v(self.offset) }
    }
}

impl Taper<f64> {
    /// The same with `c` of every number.
    pub(super) fn map<T: Real>(&self, c: impl Fn(f64) -> T) -> Taper<T> {
        Taper { head_radius: c(self.head_radius), pressure_lever: c(self.pressure_lever) }
    }
}
