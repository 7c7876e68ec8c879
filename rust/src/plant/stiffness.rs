//! How fast an arm's modes are: which method suits it, and which steps an explicit one can take.
//!
//! Source: Hairer & Wanner, *Solving Ordinary Differential Equations II*, sec. IV.2. Around a state the arm is x' = J x; an explicit
//! method is stable where step times the fastest |eigenvalue| is below about 3 and has to step so also where that mode is
//! long at rest. That is a waste (the arm is stiff) where the accuracy wanted of the motion asks for longer steps.
//! Limits: of one state, where a run starts. An arm that grows stiff later is slower than it might be, not wrong.

use crate::arm::Arm;
use crate::error::Error;
use crate::integrate::{Method, Options, System};
use crate::plant::Plant;
use crate::plant::input::Input;
use nalgebra::{DMatrix, DVector, linalg::Schur};
use std::sync::Arc;

/// Fastest |eigenvalue| (1/s) up to which both sorts of methods are about equally fast, under inputs with the noise of
/// sensors, be the mode damped or ringing (measured: docs/decisions/0002-stiff-arms.md).
const RATE: f64 = 6000.0;
/// States beyond which the fastest mode is sought by itself.
const MANY: usize = 72;
/// Step times |eigenvalue| up to which RK4 is stable is 2.78 for a damped mode; with some reserve.
const STABLE: f64 = 2.0;
/// Difference of a coordinate, as the integrator's.
const STEP: f64 = 1e-7;

/// The fastest mode's |eigenvalue|, 1/s.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Fastest(pub f64);

impl Fastest {
    /// Of `arm` under `input` at time `t` (of the input's clock) and state `x`; none where the model gives no finite numbers.
    pub fn at(arm: &Arc<Arm>, input: &Arc<Input>, t: f64, x: &[f64]) -> Option<Self> {
        let n = x.len();
        if n == 0 {
            return None;
        }
        let mut plant = Plant::new(arm.clone(), input.clone()).with_pneumatics(t, &x[..n / 2]);
        plant.begin(t, x);
        plant.begin_step(t, t + 1e-3, x);
        let mut f = vec![0.0; n];
        let mut at = |v: &DVector<f64>| {
            let moved: Vec<f64> = x.iter().zip(v.iter()).map(|(x, v)| x + STEP * v).collect();
            plant.derivative(t, &moved, &mut f);
            DVector::from_column_slice(&f)
        };
        let rest = at(&DVector::zeros(n));
        if n > MANY {
            // Power iteration, two by two: a ringing pair trades lengths for rates, which are of other sizes.
            let mut v = DVector::from_fn(n, |i, _| 1.0 + 0.1 * (i as f64).sin());
            let mut growth = [0.0; 2];
            for _ in 0..16 {
                v /= v.norm();
                v = (at(&v) - &rest) / STEP;
                growth = [growth[1], v.norm()];
            }
            let fastest = (growth[0] * growth[1]).sqrt();
            return fastest.is_finite().then_some(Self(fastest));
        }
        let mut jacobian = DMatrix::zeros(n, n);
        for j in 0..n {
            let mut unit = DVector::zeros(n);
            unit[j] = 1.0;
            jacobian.set_column(j, &((at(&unit) - &rest) / STEP));
        }
        if jacobian.iter().any(|x| !x.is_finite()) {
            return None;
        }
        let eigenvalues = Schur::try_new(jacobian, f64::EPSILON, 10_000)?.complex_eigenvalues();
        Some(Self(eigenvalues.iter().map(|x| x.re.hypot(x.im)).fold(0.0, f64::max)))
    }

    /// Whether an explicit method wastes steps.
    pub fn is_stiff(self) -> bool {
        self.0 > RATE
    }

    /// Longest step with which RK4 is stable, with some reserve, s.
    pub fn stable_step(self) -> f64 {
        STABLE / self.0
    }
}

/// `options` with a method chosen, where that is left open, for a run from (`t`, `x`).
pub fn chosen(options: Options, arm: &Arc<Arm>, input: &Arc<Input>, t: f64, x: &[f64]) -> Options {
    if options.method != Method::Auto {
        return options;
    }
    let stiff = Fastest::at(arm, input, t, x).is_some_and(Fastest::is_stiff);
    Options { method: if stiff { Method::Rodas4 } else { Method::DormandPrince54 }, ..options }
}

/// The error that ended a run from (`t`, `x`), with its likely cause where that is a step beyond the stable one.
#[cold]
pub fn explained(error: Error, options: Options, arm: &Arc<Arm>, input: &Arc<Input>, t: f64, x: &[f64]) -> Error {
    let Error::Simulation { time, reason } = error else { return error };
    let fastest = if options.method == Method::Rk4 { Fastest::at(arm, input, t, x) } else { None };
    let reason = match fastest {
        Some(fastest) if options.step > fastest.stable_step() => format!(
            "{reason}; the likely cause is the step of {:.2e} s, which is longer than rk4 is stable with for this arm \
             (about {:.2e} s); the methods \"auto\", \"rodas4\" and \"ros2\" are stable with any",
            options.step,
            fastest.stable_step()
        ),
        _ => reason,
    };
    Error::Simulation { time, reason }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::testing::fixed_parameters;
    use crate::body::parameters::ArmParameters;
    use crate::plant::input::Interpolation;

    fn fastest(change: impl Fn(&mut ArmParameters), sections: usize) -> Fastest {
        let mut parameters = fixed_parameters(sections);
        change(&mut parameters);
        let arm = Arc::new(Arm::new(&parameters).unwrap());
        let p = vec![1.1e5; arm.body.inputs];
        let input = Input::new(vec![0.0], (p, arm.body.inputs), (Vec::new(), 0), Interpolation::Linear).unwrap();
        let mut x: Vec<f64> = vec![0.2; arm.coordinates()];
        x.resize(2 * arm.coordinates(), 0.0);
        Fastest::at(&arm, &Arc::new(input), 0.0, &x).unwrap()
    }

    #[test]
    fn damping_makes_an_arm_stiff() {
        let calm = fastest(|_| (), 2);
        assert!(!calm.is_stiff(), "{calm:?}");
        let times = |p: &mut ArmParameters, k: f64| {
            p.section.iter_mut().flat_map(|s| &mut s.bellows).for_each(|b| b.damping *= k)
        };
        let (stiff, stiffer) = (fastest(|p| times(p, 1e3), 2), fastest(|p| times(p, 2e3), 2));
        assert!(stiff.is_stiff(), "{stiff:?}");
        assert!((stiffer.0 / stiff.0 - 2.0).abs() < 0.05, "{stiff:?} {stiffer:?}");
    }

    #[test]
    fn the_fastest_mode_of_a_long_arm_is_found_by_itself() {
        let calm = fastest(|_| (), 13);
        assert!(!calm.is_stiff(), "{calm:?}");
        let long = fastest(|p| p.section.iter_mut().flat_map(|s| &mut s.bellows).for_each(|b| b.damping *= 1e3), 13);
        assert!(long.is_stiff(), "{long:?}");
    }
}
