//! How fast the modes of a linear model are.

use nalgebra::{Complex, DMatrix, DVector};

/// States beyond which eigenvalues would take seconds: the modulus of the fastest alone is found by iteration.
pub(crate) const MANY_STATES: usize = 150;
/// Iterations for that, and how many of them are counted.
const ITERATIONS: (usize, usize) = (300, 150);

/// Modulus of the fastest eigenvalue of a linear model, 1/s: infinite where the model is not finite.
pub fn fastest(state: &DMatrix<f64>) -> f64 {
    if state.nrows() > MANY_STATES && state.iter().all(|x| x.is_finite()) {
        return by_iteration(state);
    }
    eigenvalues(state).iter().fold(0.0, |m, z| m.max(z.norm()))
}

/// The same by the mean growth of a vector under `state`, again and again.
fn by_iteration(state: &DMatrix<f64>) -> f64 {
    let mut x = DVector::from_fn(state.nrows(), |k, _| (1.0 + k as f64).sin());
    let mut growth = 0.0;
    for k in 0..ITERATIONS.0 {
        let size = x.norm();
        if size == 0.0 {
            return 0.0;
        }
        x = state * (x / size);
        if k >= ITERATIONS.0 - ITERATIONS.1 {
            growth += x.norm().max(f64::MIN_POSITIVE).ln();
        }
    }
    (growth / ITERATIONS.1 as f64).exp()
}

/// All eigenvalues; one that is infinite where the model is not finite.
pub(crate) fn eigenvalues(state: &DMatrix<f64>) -> Vec<Complex<f64>> {
    // Numbers that are not finite would be iterated on for ever.
    if !state.iter().all(|x| x.is_finite()) {
        return vec![Complex::new(f64::INFINITY, 0.0)];
    }
    state.complex_eigenvalues().iter().copied().collect()
}

#[cfg(test)]
pub(crate) mod testing {
    use super::MANY_STATES;
    use nalgebra::DMatrix;

    /// More states than eigenvalues are sought for; the fastest mode, damped, is of 90 1/s.
    pub fn chain_of_oscillators() -> DMatrix<f64> {
        let count = MANY_STATES;
        let mut state = DMatrix::zeros(2 * count, 2 * count);
        for k in 0..count {
            let (w, d) = if k == 70 { (90.0, 0.4) } else { (10.0 + 0.2 * k as f64, 0.1) };
            state[(k, count + k)] = 1.0;
            state[(count + k, k)] = -w * w;
            state[(count + k, count + k)] = -2.0 * d * w;
        }
        state
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fastest_of_many() {
        let state = testing::chain_of_oscillators();
        assert!((fastest(&state) / 90.0 - 1.0).abs() < 0.05, "{}", fastest(&state));
        assert!(fastest(&DMatrix::from_element(2, 2, f64::NAN)).is_infinite());
    }
}
