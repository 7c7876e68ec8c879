//! Spring polynomials as a file states them.

use super::check::finite;
use crate::error::{Error, Result};

/// Highest power of the spring polynomial.
pub const STIFFNESS_TERMS: usize = 8;

/// The terms of a spring polynomial, filled up with zeros.
pub(super) fn stiffness_terms(place: &str, terms: &[f64]) -> Result<[f64; STIFFNESS_TERMS]> {
    if terms.is_empty() || terms.len() > STIFFNESS_TERMS {
        return Err(Error::Parameter {
            place: place.to_owned(),
            key: "number of stiffness terms",
            found: terms.len().to_string(),
            allowed: "1 to 8 are allowed",
        });
    }
    let mut stiffness = [0.0; STIFFNESS_TERMS];
    for (k, &s) in stiffness.iter_mut().zip(terms) {
        *k = finite(place, "stiffness", s)?;
    }
    Ok(stiffness)
}
