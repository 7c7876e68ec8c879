//! One number, in code compiled for the processor's fused multiply-add.

use super::{InstructionSet, Kernel, Real};
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// An `f64` whose [`Real::mul_add`] rounds once. Its kernels run only where [`Fused::is_available`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fused(pub f64);

impl Fused {
    /// Whether the processor has fused multiply-add beyond the target's baseline.
    pub fn is_available() -> bool {
        cfg!(target_arch = "x86_64") && InstructionSet::Avx2.is_available()
    }
}

impl Add for Fused {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self(self.0 + o.0)
    }
}

impl Add<f64> for Fused {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: f64) -> Self {
        Self(self.0 + o)
    }
}

impl AddAssign for Fused {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        self.0 += o.0;
    }
}

impl Sub for Fused {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Self(self.0 - o.0)
    }
}

impl Sub<f64> for Fused {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: f64) -> Self {
        Self(self.0 - o)
    }
}

impl SubAssign for Fused {
    #[inline(always)]
    fn sub_assign(&mut self, o: Self) {
        self.0 -= o.0;
    }
}

impl Mul for Fused {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        Self(self.0 * o.0)
    }
}

impl Mul<f64> for Fused {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: f64) -> Self {
        Self(self.0 * o)
    }
}

impl MulAssign for Fused {
    #[inline(always)]
    fn mul_assign(&mut self, o: Self) {
        self.0 *= o.0;
    }
}

impl Div for Fused {
    type Output = Self;
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        Self(self.0 / o.0)
    }
}

impl Neg for Fused {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Real for Fused {
    #[inline(always)]
    fn lane(self, _: usize) -> f64 {
        self.0
    }
    #[inline(always)]
    fn from_lanes(mut lane: impl FnMut(usize) -> f64) -> Self {
        Self(lane(0))
    }
    #[inline(always)]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        #[cfg(target_arch = "x86_64")]
        {
            use super::lanes::Register;
            super::lanes::Avx2::enter(kernel)
        }
        #[cfg(not(target_arch = "x86_64"))]
        super::run(kernel)
    }
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        Self(x)
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        Self(self.0.mul_add(a.0, b.0))
    }
    #[inline(always)]
    fn mul_sub(self, a: Self, b: Self) -> Self {
        Self(self.0.mul_add(a.0, -b.0))
    }
    #[inline(always)]
    fn neg_mul_add(self, a: Self, b: Self) -> Self {
        Self((-self.0).mul_add(a.0, b.0))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }
    #[inline(always)]
    fn exp(self) -> Self {
        Self(self.0.exp())
    }
    #[inline(always)]
    fn ln(self) -> Self {
        Self(self.0.ln())
    }
    #[inline(always)]
    fn tanh(self) -> Self {
        Self(self.0.tanh())
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.abs())
    }
    #[inline(always)]
    fn select(condition: Self, then: Self, otherwise: Self) -> Self {
        if condition.0 > 0.0 { then } else { otherwise }
    }
    #[inline(always)]
    fn is_finite(self) -> bool {
        self.0.is_finite()
    }
    #[inline(always)]
    fn largest(self) -> f64 {
        self.0
    }
}
