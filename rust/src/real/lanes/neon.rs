//! Four lanes in two registers of NEON, which every aarch64 processor has.

use super::Register;
#[cfg(not(target_arch = "aarch64"))]
use super::emulated::*;
use crate::real::Kernel;
#[cfg(target_arch = "aarch64")]
use std::arch::aarch64::*;

/// Four numbers.
#[derive(Clone, Copy, Debug)]
pub struct Neon(float64x2_t, float64x2_t);

impl Neon {
    #[inline(always)]
    fn map(self, f: impl Fn(float64x2_t) -> float64x2_t) -> Self {
        Self(f(self.0), f(self.1))
    }
    #[inline(always)]
    fn zip(self, o: Self, f: impl Fn(float64x2_t, float64x2_t) -> float64x2_t) -> Self {
        Self(f(self.0, o.0), f(self.1, o.1))
    }
}

// SAFETY of all blocks: NEON is part of the target's baseline.
impl Register for Neon {
    const WIDTH: usize = 4;
    #[inline(always)]
    fn splat(x: f64) -> Self {
        let half = unsafe { vdupq_n_f64(x) };
        Self(half, half)
    }
    #[inline(always)]
    fn from_fn(x: impl FnMut(usize) -> f64) -> Self {
        let numbers: [f64; 4] = std::array::from_fn(x);
        unsafe { Self(vld1q_f64(numbers.as_ptr()), vld1q_f64(numbers.as_ptr().add(2))) }
    }
    #[inline(always)]
    fn get(self, k: usize) -> f64 {
        let mut numbers = [0.0; 4];
        unsafe {
            vst1q_f64(numbers.as_mut_ptr(), self.0);
            vst1q_f64(numbers.as_mut_ptr().add(2), self.1);
        }
        numbers[k]
    }
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        self.zip(o, |a, b| unsafe { vaddq_f64(a, b) })
    }
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        self.zip(o, |a, b| unsafe { vsubq_f64(a, b) })
    }
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        self.zip(o, |a, b| unsafe { vmulq_f64(a, b) })
    }
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        self.zip(o, |a, b| unsafe { vdivq_f64(a, b) })
    }
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|a| unsafe { vnegq_f64(a) })
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        unsafe { Self(vfmaq_f64(b.0, self.0, a.0), vfmaq_f64(b.1, self.1, a.1)) }
    }
    #[inline(always)]
    fn mul_sub(self, a: Self, b: Self) -> Self {
        self.mul_add(a, b.neg())
    }
    #[inline(always)]
    fn neg_mul_add(self, a: Self, b: Self) -> Self {
        unsafe { Self(vfmsq_f64(b.0, self.0, a.0), vfmsq_f64(b.1, self.1, a.1)) }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.map(|a| unsafe { vsqrtq_f64(a) })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.map(|a| unsafe { vabsq_f64(a) })
    }
    #[inline(always)]
    fn positive(self, then: Self, otherwise: Self) -> Self {
        unsafe {
            Self(vbslq_f64(vcgtzq_f64(self.0), then.0, otherwise.0), vbslq_f64(vcgtzq_f64(self.1), then.1, otherwise.1))
        }
    }
    #[inline(always)]
    fn power_of_two(self) -> Self {
        // The number plus the exponent's bias ends in the last bits of 2^52 + it; shifted, they are an exponent.
        self.map(|a| unsafe {
            let biased = vaddq_f64(a, vdupq_n_f64(1023.0 + super::TWO_52));
            vreinterpretq_f64_s64(vshlq_n_s64::<52>(vreinterpretq_s64_f64(biased)))
        })
    }
    #[inline(always)]
    fn exponent(self) -> Self {
        // The exponent's bits, shifted down, as the last bits of 2^52 plus them.
        self.map(|a| unsafe {
            let biased = vshrq_n_u64::<52>(vreinterpretq_u64_f64(a));
            let shifted = vorrq_u64(biased, vdupq_n_u64(super::TWO_52.to_bits()));
            vsubq_f64(vreinterpretq_f64_u64(shifted), vdupq_n_f64(1023.0 + super::TWO_52))
        })
    }
    #[inline(always)]
    fn mantissa(self) -> Self {
        // The bits behind the exponent, with that of 1.
        self.map(|a| unsafe {
            let bits = vandq_u64(vreinterpretq_u64_f64(a), vdupq_n_u64(super::MANTISSA));
            vreinterpretq_f64_u64(vorrq_u64(bits, vdupq_n_u64(1.0_f64.to_bits())))
        })
    }
    #[inline(always)]
    fn all_finite(self) -> bool {
        (0..4).all(|k| self.get(k).is_finite())
    }
    #[inline(always)]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        crate::real::run(kernel)
    }
}
