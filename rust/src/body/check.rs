//! Numbers of a parameter file, checked.

use crate::error::{Error, Result};

pub(super) fn check(place: &str, key: &'static str, value: f64, ok: bool, allowed: &'static str) -> Result<f64> {
    if value.is_finite() && ok {
        return Ok(value);
    }
    Err(Error::Parameter { place: place.to_owned(), key, found: value.to_string(), allowed })
}

pub(super) fn positive(place: &str, key: &'static str, value: f64) -> Result<f64> {
    check(place, key, value, value > 0.0, "a positive, finite number is needed")
}

pub(super) fn not_negative(place: &str, key: &'static str, value: f64) -> Result<f64> {
    check(place, key, value, value >= 0.0, "a finite number not below zero is needed")
}

pub(super) fn finite(place: &str, key: &'static str, value: f64) -> Result<f64> {
    check(place, key, value, true, "a finite number is needed")
}
