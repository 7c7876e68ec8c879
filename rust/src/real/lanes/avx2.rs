//! Four lanes in a register of AVX2, with FMA.
//!
//! Safety of all blocks: values of the type exist only where the processor has the instructions (see [`Register`]).

use super::{InstructionSet, Register};
use crate::real::Kernel;
use std::arch::x86_64::*;

/// 4 numbers.
#[derive(Clone, Copy, Debug)]
pub struct Avx2(__m256d);

/// An operation of the instruction set as a method.
macro_rules! operation {
    ($name:ident($($argument:ident),*) = $instruction:ident) => {
        #[inline(always)]
        fn $name(self, $($argument: Self),*) -> Self {
            // SAFETY: see the file's head.
            Self(unsafe { $instruction(self.0, $($argument.0),*) })
        }
    };
}

impl Register for Avx2 {
    const WIDTH: usize = 4;
    #[inline(always)]
    fn splat(x: f64) -> Self {
        // SAFETY: see the file's head.
        Self(unsafe { _mm256_set1_pd(x) })
    }
    #[inline(always)]
    fn from_fn(mut x: impl FnMut(usize) -> f64) -> Self {
        let mut numbers = [0.0; 4];
        for (k, number) in numbers.iter_mut().enumerate() {
            *number = x(k);
        }
        // SAFETY: see the file's head; the load reads exactly the array.
        Self(unsafe { _mm256_loadu_pd(numbers.as_ptr()) })
    }
    #[inline(always)]
    fn get(self, k: usize) -> f64 {
        let mut numbers = [0.0; 4];
        // SAFETY: see the file's head; the store writes exactly the array.
        unsafe { _mm256_storeu_pd(numbers.as_mut_ptr(), self.0) };
        numbers[k]
    }
    operation!(add(o) = _mm256_add_pd);
    operation!(sub(o) = _mm256_sub_pd);
    operation!(mul(o) = _mm256_mul_pd);
    operation!(div(o) = _mm256_div_pd);
    operation!(mul_add(a, b) = _mm256_fmadd_pd);
    operation!(mul_sub(a, b) = _mm256_fmsub_pd);
    operation!(neg_mul_add(a, b) = _mm256_fnmadd_pd);
    operation!(sqrt() = _mm256_sqrt_pd);
    #[inline(always)]
    fn neg(self) -> Self {
        // SAFETY: see the file's head.
        Self(unsafe { _mm256_xor_pd(self.0, _mm256_set1_pd(-0.0)) })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: see the file's head.
        Self(unsafe { _mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0) })
    }
    #[inline(always)]
    fn positive(self, then: Self, otherwise: Self) -> Self {
        // SAFETY: see the file's head.
        Self(unsafe {
            let mask = _mm256_cmp_pd::<_CMP_GT_OQ>(self.0, _mm256_setzero_pd());
            _mm256_blendv_pd(otherwise.0, then.0, mask)
        })
    }
    #[inline(always)]
    fn power_of_two(self) -> Self {
        // The number plus the exponent's bias ends in the last bits of 2^52 + it; shifted, they are an exponent. SAFETY: see the file's head.
        Self(unsafe {
            let biased = _mm256_add_pd(self.0, _mm256_set1_pd(1023.0 + super::TWO_52));
            _mm256_castsi256_pd(_mm256_slli_epi64::<52>(_mm256_castpd_si256(biased)))
        })
    }
    #[inline(always)]
    fn exponent(self) -> Self {
        // The exponent's bits, shifted down, as the last bits of 2^52 plus them. SAFETY: see the file's head.
        Self(unsafe {
            let biased = _mm256_srli_epi64::<52>(_mm256_castpd_si256(self.0));
            let shifted = _mm256_or_pd(_mm256_castsi256_pd(biased), _mm256_set1_pd(super::TWO_52));
            _mm256_sub_pd(shifted, _mm256_set1_pd(1023.0 + super::TWO_52))
        })
    }
    #[inline(always)]
    fn mantissa(self) -> Self {
        // The bits behind the exponent, with that of 1. SAFETY: see the file's head.
        Self(unsafe {
            let bits = _mm256_and_pd(self.0, _mm256_set1_pd(f64::from_bits(super::MANTISSA)));
            _mm256_or_pd(bits, _mm256_set1_pd(1.0))
        })
    }
    #[inline(always)]
    fn all_finite(self) -> bool {
        // x - x is 0 for finite numbers only. SAFETY: see the file's head.
        unsafe {
            let zero = _mm256_sub_pd(self.0, self.0);
            _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_EQ_OQ>(zero, _mm256_setzero_pd())) == 0b1111
        }
    }
    #[inline(always)]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        #[target_feature(enable = "avx2,fma")]
        #[inline(never)]
        fn compiled<K: Kernel>(kernel: K) -> K::Output {
            super::Aligned::keep();
            kernel.run()
        }
        assert!(InstructionSet::Avx2.is_available(), "this processor lacks the instruction set avx2,fma");
        // SAFETY: the processor has the instructions, as just checked.
        unsafe { compiled(kernel) }
    }
}
