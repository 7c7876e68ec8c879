//! Butcher tableaux, as data.

/// Coefficients of a Runge-Kutta method, explicit or linearly implicit (Rosenbrock-W).
#[derive(Debug)]
pub struct Tableau {
    /// Name as users give it.
    pub name: &'static str,
    /// Order of the solution that is propagated.
    pub order: u32,
    /// Nodes.
    pub c: &'static [f64],
    /// Rows of the strictly lower triangular matrix, from the second stage on.
    pub a: &'static [&'static [f64]],
    /// Weights.
    pub b: &'static [f64],
    /// Weights of the error estimate (b minus the embedded method's), empty for a method without one.
    pub error: &'static [f64],
    /// Dense output: polynomial in theta without constant term, x(t0 + theta h) = x0 + h sum_i k_i sum_j dense[i][j] theta^(j+1).
    pub dense: &'static [[f64; 4]],
    /// Whether the last stage is the first one of the next step.
    pub first_same_as_last: bool,
    /// gamma of a linearly implicit method, (I - gamma h J) k_i = f(x + h sum a_ij k_j) + sum c_ij k_j; 0 for explicit ones.
    pub gamma: f64,
    /// Multiples of gamma h df/dt on the right-hand side of each stage of a linearly implicit method; empty for explicit ones.
    pub drift: &'static [f64],
    /// Rows c_ij of a linearly implicit method, from the second stage on; empty for explicit ones.
    pub coupling: &'static [&'static [f64]],
}

/// Which method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Classical Runge-Kutta of order 4, fixed step.
    Rk4,
    /// Dormand-Prince 5(4), adaptive step.
    DormandPrince54,
    /// Rosenbrock-W of order 2, fixed step, for stiff arms.
    Ros2,
}

impl Method {
    /// By the user's name.
    pub fn by_name(name: &str) -> Option<Self> {
        [Self::Rk4, Self::DormandPrince54, Self::Ros2].into_iter().find(|m| m.tableau().name == name)
    }

    /// Its coefficients.
    pub fn tableau(self) -> &'static Tableau {
        match self {
            Self::Rk4 => &RK4,
            Self::DormandPrince54 => &DORMAND_PRINCE_54,
            Self::Ros2 => &ROS2,
        }
    }
}

/// Kutta, 1901.
pub static RK4: Tableau = Tableau {
    name: "rk4",
    order: 4,
    c: &[0.0, 0.5, 0.5, 1.0],
    a: &[&[0.5], &[0.0, 0.5], &[0.0, 0.0, 1.0]],
    b: &[1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0],
    error: &[],
    dense: &[],
    first_same_as_last: false,
    gamma: 0.0,
    drift: &[],
    coupling: &[],
};

/// Verwer, Spee, Blom & Hundsdorfer, SIAM J. Sci. Comput. 20 (1999) 1456-1480: L-stable, order 2 whatever stands for J.
pub static ROS2: Tableau = Tableau {
    name: "ros2",
    order: 2,
    c: &[0.0, 1.0],
    a: &[&[1.0]],
    b: &[1.5, 0.5],
    error: &[],
    dense: &[],
    first_same_as_last: false,
    gamma: 1.0 - std::f64::consts::FRAC_1_SQRT_2,
    drift: &[1.0, -1.0],
    coupling: &[&[-2.0]],
};

/// Dormand & Prince, J. Comp. Appl. Math. 6 (1980) 19-26; dense output of order 4 by Shampine, Math. Comp. 46 (1986) 135-150.
pub static DORMAND_PRINCE_54: Tableau = Tableau {
    name: "dopri5",
    order: 5,
    c: &[0.0, 1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0, 1.0],
    a: &[
        &[1.0 / 5.0],
        &[3.0 / 40.0, 9.0 / 40.0],
        &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
        &[19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0],
        &[9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0],
        &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
    ],
    b: &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0, 0.0],
    error: &[71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0],
    dense: &[
        [1.0, -8048581381.0 / 2820520608.0, 8663915743.0 / 2820520608.0, -12715105075.0 / 11282082432.0],
        [0.0, 0.0, 0.0, 0.0],
        [0.0, 131558114200.0 / 32700410799.0, -68118460800.0 / 10900136933.0, 87487479700.0 / 32700410799.0],
        [0.0, -1754552775.0 / 470086768.0, 14199869525.0 / 1410260304.0, -10690763975.0 / 1880347072.0],
        [0.0, 127303824393.0 / 49829197408.0, -318862633887.0 / 49829197408.0, 701980252875.0 / 199316789632.0],
        [0.0, -282668133.0 / 205662961.0, 2019193451.0 / 616988883.0, -1453857185.0 / 822651844.0],
        [0.0, 40617522.0 / 29380423.0, -110615467.0 / 29380423.0, 69997945.0 / 29380423.0],
    ],
    first_same_as_last: true,
    gamma: 0.0,
    drift: &[],
    coupling: &[],
};

#[cfg(test)]
mod tests {
    use super::*;

    /// Row sums, weights and the dense output's end point: what a mistyped digit would break.
    #[test]
    fn consistent() {
        for t in [&RK4, &DORMAND_PRINCE_54] {
            for (row, c) in t.a.iter().zip(&t.c[1..]) {
                assert!((row.iter().sum::<f64>() - c).abs() < 1e-14, "{}", t.name);
            }
            assert!((t.b.iter().sum::<f64>() - 1.0).abs() < 1e-15);
            assert!(t.error.iter().sum::<f64>().abs() < 1e-15);
            for (row, b) in t.dense.iter().zip(t.b) {
                assert!((row.iter().sum::<f64>() - b).abs() < 1e-14);
            }
            // sum b_i c_i^(k-1) = 1/k up to the order.
            for k in 2..=t.order as i32 {
                let moment: f64 = t.b.iter().zip(t.c).map(|(b, c)| b * c.powi(k - 1)).sum();
                assert!((moment - 1.0 / f64::from(k)).abs() < 1e-14, "{} {k}", t.name);
            }
        }
    }
}
