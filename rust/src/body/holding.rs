//! What holds a section beside its bellows: bending stiffness that differs from plane to plane, and axial stiffness.
//!
//! Both are rare, so that a section without them carries one empty pointer each.

use super::check::{finite, not_negative};
use super::parameters::{AxialParameters, SectionParameters};
use super::springs::{STIFFNESS_TERMS, stiffness_terms};
use crate::error::Result;
use crate::real::Real;

/// How the bending stiffness differs from plane to plane, beside its mean over the planes.
///
/// k(phi) = mean + d cos 2 (phi - alpha), d half the difference of the principal values: k cos^2 + k' sin^2. Kept as
/// (d cos 2 alpha, d sin 2 alpha), which add up where several things stiffen a section.
#[derive(Clone, Copy, Debug)]
pub struct BendingPlanes<T> {
    /// Of k1, N m.
    pub linear: [T; 2],
    /// Of k3, N m.
    pub cubic: [T; 2],
    /// Of k5, N m.
    pub quintic: [T; 2],
}

impl<T: Real> BendingPlanes<T> {
    /// All planes alike.
    pub fn alike() -> Self {
        Self { linear: [T::zero(); 2], cubic: [T::zero(); 2], quintic: [T::zero(); 2] }
    }
}

/// What holds the mean length of a section: a sleeve, a backbone.
#[derive(Clone, Copy, Debug)]
pub struct Axial<T> {
    /// Mean length without force, m.
    pub rest_length: T,
    /// Spring polynomial, from the first power.
    pub stiffness: [T; STIFFNESS_TERMS],
    /// How many terms of `stiffness` are used.
    pub stiffness_terms: usize,
    /// Viscous damping, N s/m.
    pub damping: T,
}

/// Terms of the bending moment: the odd powers of the bend up to the fifth.
pub const BENDING_TERMS: usize = 3;

/// k1, k3, k5 in the mean over the planes, and how they differ, where they do.
pub(super) type Bending = ([f64; BENDING_TERMS], Option<Box<BendingPlanes<f64>>>);

/// The bending stiffness that the parameters state.
pub(super) fn bending(place: &str, p: &SectionParameters) -> Result<Bending> {
    let mut along = [0.0; BENDING_TERMS];
    for (k, &given) in along.iter_mut().zip(&p.bending_stiffness) {
        *k = finite(place, "bending_stiffness", given)?;
    }
    let Some(given) = p.cross_bending_stiffness else { return Ok((along, None)) };
    let mut across = [0.0; BENDING_TERMS];
    for (k, given) in across.iter_mut().zip(given) {
        *k = finite(place, "cross_bending_stiffness", given)?;
    }
    let (sin, cos) = (2.0 * finite(place, "bending_plane", p.bending_plane)?).sin_cos();
    let [linear, cubic, quintic] = [0, 1, 2].map(|k| 0.5 * (along[k] - across[k])).map(|d| [d * cos, d * sin]);
    let mean = [0, 1, 2].map(|k| 0.5 * (along[k] + across[k]));
    let planes = BendingPlanes { linear, cubic, quintic };
    Ok((mean, Some(Box::new(planes))))
}

impl Axial<f64> {
    pub(super) fn new(place: &str, p: &AxialParameters) -> Result<Self> {
        let place = format!("{place}, axial");
        Ok(Self {
            rest_length: finite(&place, "rest_length", p.rest_length)?,
            stiffness: stiffness_terms(&place, &p.stiffness)?,
            stiffness_terms: p.stiffness.len(),
            damping: not_negative(&place, "damping", p.damping)?,
        })
    }

    /// The same with `c` of every number.
    pub(super) fn map<T: Real>(&self, c: impl Fn(f64) -> T + Copy) -> Axial<T> {
        Axial {
            rest_length: c(self.rest_length),
            stiffness: self.stiffness.map(c),
            stiffness_terms: self.stiffness_terms,
            damping: c(self.damping),
        }
    }
}

impl BendingPlanes<f64> {
    /// The same with `c` of every number.
    pub(super) fn map<T: Real>(&self, c: impl Fn(f64) -> T + Copy) -> BendingPlanes<T> {
        BendingPlanes { linear: self.linear.map(c), cubic: self.cubic.map(c), quintic: self.quintic.map(c) }
    }
}
