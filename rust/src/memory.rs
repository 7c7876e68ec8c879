//! Room for large results: asked for before it is filled, since what does not fit must be an error and no abort.

use crate::error::{Error, Result};

/// An empty vector with room for the entries of an array of `shape`; `what` names it in the error.
///
/// # Errors
/// [`Error::Input`] where the memory does not suffice.
pub fn reserved(what: &str, shape: &[usize]) -> Result<Vec<f64>> {
    let mut out = Vec::new();
    let count = shape.iter().try_fold(1_usize, |n, extent| n.checked_mul(*extent));
    if count.is_some_and(|n| out.try_reserve_exact(n).is_ok()) {
        return Ok(out);
    }
    let gigabytes = shape.iter().map(|n| *n as f64).product::<f64>() * 8e-9;
    let text = format!("{what}: {shape:?} numbers, {gigabytes:.3} GB, do not fit into the memory; ask for fewer");
    Err(Error::Input(text))
}

/// The same, filled with `value`.
///
/// # Errors
/// As [`reserved`].
pub fn filled(what: &str, shape: &[usize], value: f64) -> Result<Vec<f64>> {
    let mut out = reserved(what, shape)?;
    out.resize(shape.iter().product(), value);
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_an_error() {
        assert_eq!(filled("x", &[2, 3], 1.0).unwrap(), [1.0; 6]);
        assert!(filled("x", &[0, usize::MAX], 1.0).unwrap().is_empty());
        let text = filled("lengths", &[1 << 40, 1 << 40], 0.0).unwrap_err().to_string();
        assert!(text.starts_with("lengths: [1099511627776, 1099511627776] numbers"), "{text}");
        assert!(filled("lengths", &[1 << 58], 0.0).is_err());
    }
}
