//! A point on an arc: pose, derivatives by (u, v, l) and the part of its acceleration that is quadratic in the rates.
//!
//! Source: p = l [u b, v b, a], R = exp([w]x), w = (-v, u, 0), with a = sin psi / psi, b = (1 - cos psi) / psi^2 and
//! d = (psi - sin psi) / psi^3 as power series in s = psi^2 = u^2 + v^2, summed term by term: nothing divides by psi.
//! Frame: that of the arc's base. The angular velocity is J w', J = 1 + b [w]x + d [w]x^2.

use nalgebra::{Matrix3, Vector3};

/// Largest bending angle: beyond it the alternating series lose more than four digits, rad.
pub const PSI_MAX: f64 = 7.0;

/// A power series sum_j (-s)^j / (first + 2 j)! with its first two derivatives by s.
#[derive(Clone, Copy)]
struct Series {
    value: f64,
    by_s: f64,
    by_ss: f64,
}

/// Most terms of a series; the last one is below 1e-18 at s = PSI_MAX^2.
const TERMS: usize = 26;

/// (-1)^j / (first + 2 j)!
const fn coefficients(first: u32) -> [f64; TERMS] {
    let mut out = [0.0; TERMS];
    let (mut factorial, mut k) = (1.0, 1);
    while k <= first {
        factorial *= k as f64;
        k += 1;
    }
    let (mut sign, mut j) = (1.0, 0);
    while j < TERMS {
        out[j] = sign / factorial;
        sign = -sign;
        factorial *= (k as f64) * (k as f64 + 1.0);
        k += 2;
        j += 1;
    }
    out
}

const FIRST_1: [f64; TERMS] = coefficients(1);
const FIRST_2: [f64; TERMS] = coefficients(2);
const FIRST_3: [f64; TERMS] = coefficients(3);

impl Series {
    fn at(s: f64, coefficients: &[f64; TERMS]) -> Self {
        let (mut value, mut by_s, mut by_ss) = (0.0, 0.0, 0.0);
        // s^j, s^(j-1), s^(j-2).
        let (mut power, mut power_1, mut power_2) = (1.0, 0.0, 0.0);
        let mut j = 0.0;
        for c in coefficients {
            let last = c * j * (j - 1.0) * power_2;
            value += c * power;
            by_s += c * j * power_1;
            by_ss += last;
            if j > 2.0 && last.abs() < 1e-18 {
                break;
            }
            (power_2, power_1, power) = (power_1, power, power * s);
            j += 1.0;
        }
        Self { value, by_s, by_ss }
    }

    /// First and second time derivative for s' and s''.
    fn rates(&self, s_t: f64, s_tt: f64) -> (f64, f64) {
        (self.by_s * s_t, self.by_ss * s_t * s_t + self.by_s * s_tt)
    }
}

/// A point at a fraction of an arc, in the frame of the arc's base.
pub struct ArcPoint {
    /// Orientation.
    pub rotation: Matrix3<f64>,
    /// Position, m.
    pub position: Vector3<f64>,
    /// Velocity, m/s.
    pub velocity: Vector3<f64>,
    /// Acceleration at u'' = v'' = l'' = 0, m/s^2.
    pub bias: Vector3<f64>,
    /// Angular velocity, rad/s.
    pub angular_velocity: Vector3<f64>,
    /// Angular acceleration at u'' = v'' = 0, rad/s^2.
    pub angular_bias: Vector3<f64>,
    /// Derivatives of the position by u, v, l.
    pub linear: [Vector3<f64>; 3],
    /// Angular velocity per unit rate of u, v, l.
    pub angular: [Vector3<f64>; 3],
}

impl ArcPoint {
    /// The point at `fraction` of the arc (u, v, l) that moves with rates (u', v', l').
    pub fn new(arc: [f64; 3], rate: [f64; 3], fraction: f64) -> Self {
        // A piece of an arc is an arc with its share of bending and length.
        let [u, v, l] = arc.map(|x| x * fraction);
        let [u_t, v_t, l_t] = rate.map(|x| x * fraction);
        let s = u * u + v * v;
        let (s_t, s_tt) = (2.0 * (u * u_t + v * v_t), 2.0 * (u_t * u_t + v_t * v_t));
        let (a, b, d) = (Series::at(s, &FIRST_1), Series::at(s, &FIRST_2), Series::at(s, &FIRST_3));
        let ((a_t, a_tt), (b_t, b_tt), (d_t, _)) = (a.rates(s_t, s_tt), b.rates(s_t, s_tt), d.rates(s_t, s_tt));

        let w = Vector3::new(-v, u, 0.0);
        let w_t = Vector3::new(-v_t, u_t, 0.0);
        // 1 + x [w]x + y [w]x^2, applied to a vector.
        let series = |x: f64, y: f64, e: Vector3<f64>| {
            let once = w.cross(&e);
            e + x * once + y * w.cross(&once)
        };
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        let left_jacobian = |e: Vector3<f64>| series(b.value, d.value, e);
        let turned = w.cross(&w_t);

        // d/dt and d2/dt2 of l c e, e being u, v or 1, c being b or a.
        let product = |e: f64, e_t: f64, c: f64, c_t: f64, c_tt: f64| {
            (
                l_t * e * c + l * e_t * c + l * e * c_t,
                2.0 * (l_t * e_t * c + l_t * e * c_t + l * e_t * c_t) + l * e * c_tt,
            )
        };
        let (x_t, x_tt) = product(u, u_t, b.value, b_t, b_tt);
        let (y_t, y_tt) = product(v, v_t, b.value, b_t, b_tt);
        let (z_t, z_tt) = product(1.0, 0.0, a.value, a_t, a_tt);

        Self {
            rotation: Matrix3::from_columns(&axes.map(|e| series(a.value, b.value, e))),
            position: Vector3::new(u * b.value, v * b.value, a.value) * l,
            velocity: Vector3::new(x_t, y_t, z_t),
            bias: Vector3::new(x_tt, y_tt, z_tt),
            angular_velocity: left_jacobian(w_t),
            angular_bias: b_t * turned + d_t * w.cross(&turned) + d.value * w_t.cross(&turned),
            linear: [
                Vector3::new(b.value + 2.0 * u * u * b.by_s, 2.0 * u * v * b.by_s, 2.0 * u * a.by_s) * (l * fraction),
                Vector3::new(2.0 * u * v * b.by_s, b.value + 2.0 * v * v * b.by_s, 2.0 * v * a.by_s) * (l * fraction),
                Vector3::new(u * b.value, v * b.value, a.value) * fraction,
            ],
            angular: [left_jacobian(axes[1]) * fraction, left_jacobian(-axes[0]) * fraction, Vector3::zeros()],
        }
    }
}
