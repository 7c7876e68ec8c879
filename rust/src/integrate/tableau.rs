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
    /// [`Self::Rodas4`] for stiff arms, [`Self::DormandPrince54`] for others: see `plant::stiffness`.
    Auto,
    /// Classical Runge-Kutta of order 4, fixed step.
    Rk4,
    /// Dormand-Prince 5(4), adaptive step.
    DormandPrince54,
    /// Rosenbrock of order 4(3), adaptive step, for stiff arms.
    Rodas4,
    /// Rosenbrock-W of order 2, fixed step, for stiff arms.
    Ros2,
}

/// The name of [`Method::Auto`].
const AUTO: &str = "auto";

impl Method {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Auto, Self::DormandPrince54, Self::Rodas4, Self::Rk4, Self::Ros2];

    /// By the user's name.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|m| m.name() == name)
    }

    /// As users give it.
    pub fn name(self) -> &'static str {
        if self == Self::Auto { AUTO } else { self.tableau().name }
    }

    /// Whether steps follow from a tolerance.
    pub fn is_adaptive(self) -> bool {
        self == Self::Auto || !self.tableau().error.is_empty()
    }

    /// Its coefficients; those of the explicit method as long as nobody has chosen.
    pub fn tableau(self) -> &'static Tableau {
        match self {
            Self::Rk4 => &RK4,
            Self::Auto | Self::DormandPrince54 => &DORMAND_PRINCE_54,
            Self::Rodas4 => &RODAS4,
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

/// gamma of [`RODAS4`].
const GAMMA: f64 = 0.25;

/// `GAMMA` times the numbers of a row: published are those of U_i = gamma h k_i.
const fn scaled<const N: usize>(row: [f64; N]) -> [f64; N] {
    let mut out = row;
    let mut i = 0;
    while i < N {
        out[i] *= GAMMA;
        i += 1;
    }
    out
}

/// Dense output (1 - s) x0 + s (x1 + (1 - s) (sum near_i U_i + s sum far_i U_i)), x1 = x0 + sum last_i U_i, in powers of s.
const fn in_powers(last: [f64; 6], near: [f64; 6], far: [f64; 6]) -> [[f64; 4]; 6] {
    let mut out = [[0.0; 4]; 6];
    let mut i = 0;
    while i < 6 {
        out[i] = scaled([last[i] + near[i], far[i] - near[i], -far[i], 0.0]);
        i += 1;
    }
    out
}

/// Weights of [`RODAS4`]'s fifth stage; with 1 for the stage before, of the sixth and of the solution.
const FIFTH: [f64; 4] = [7.089566927282776, 4.573591406461604, -8.423496976860259, -0.959280113459775];
const LAST: [f64; 6] = [FIFTH[0], FIFTH[1], FIFTH[2], FIFTH[3], 1.0, 1.0];

/// Steinebach, *Improvement of Rosenbrock-Wanner method RODASP*, Progress in Differential-Algebraic Equations II (2020) 165-184,
/// method Rodas4P2: L-stable and stiffly accurate, order 4(3) without reduction on linear stiff problems, order 2 whatever
/// stands for J. Form and dense output of order 3: Hairer & Wanner, *Solving Ordinary Differential Equations II*, sec. IV.7.
pub static RODAS4: Tableau = Tableau {
    name: "rodas4",
    order: 4,
    c: &[0.0, 0.75, 0.321448134013046, 0.519745732277726, 1.0, 1.0],
    a: &[
        &scaled([3.0]),
        &scaled([0.906377755268814, -0.189707390391685]),
        &scaled([3.758617027739064, 1.161741776019525, -0.849258085312803]),
        &scaled(FIFTH),
        &scaled([FIFTH[0], FIFTH[1], FIFTH[2], FIFTH[3], 1.0]),
    ],
    b: &scaled(LAST),
    error: &scaled([0.0, 0.0, 0.0, 0.0, 0.0, 1.0]),
    dense: &in_powers(
        LAST,
        [-5.323528268423303, -10.042123754867493, 17.175254928256965, -5.079931171878093, -0.016185991706112, 0.0],
        [6.984505741529879, 6.914061169603662, -0.849178943070653, 18.104410789349338, -3.516963011559032, 0.0],
    ),
    first_same_as_last: false,
    gamma: GAMMA,
    // Published are multiples of h df/dt.
    drift: &[1.0, -0.5 / GAMMA, -0.189532918363016 / GAMMA, 0.085612108792769 / GAMMA, 0.0, 0.0],
    coupling: &[
        &scaled([-12.0]),
        &scaled([-6.354581592719008, 0.338972550544623]),
        &scaled([-8.575016317114033, -7.606483992117508, 12.22499765012482]),
        &scaled([-5.888975457523102, -8.15739661784182, 24.805546872612922, 12.79040151279698]),
        &scaled([-4.408651676063871, -6.692003137674639, 24.625568527593117, 16.627521966636085, -5.714285714285718]),
    ],
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
