//! Eight lanes in a register of AVX-512F.
//!
//! Safety of all blocks: values of the type exist only where the processor has the instructions (see [`Register`]).

use super::{InstructionSet, Register};
use crate::real::Kernel;
use std::arch::x86_64::*;

/// 8 numbers.
#[derive(Clone, Copy, Debug)]
pub struct Avx512(__m512d);

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

impl Register for Avx512 {
    const WIDTH: usize = 8;
    #[inline(always)]
    fn splat(x: f64) -> Self {
        // SAFETY: see the file's head.
        Self(unsafe { _mm512_set1_pd(x) })
    }
    #[inline(always)]
    fn from_fn(mut x: impl FnMut(usize) -> f64) -> Self {
        let mut numbers = [0.0; 8];
        for (k, number) in numbers.iter_mut().enumerate() {
            *number = x(k);
        }
        // SAFETY: see the file's head; the load reads exactly the array.
        Self(unsafe { _mm512_loadu_pd(numbers.as_ptr()) })
    }
    #[inline(always)]
    fn get(self, k: usize) -> f64 {
        let mut numbers = [0.0; 8];
        // SAFETY: see the file's head; the store writes exactly the array.
        unsafe { _mm512_storeu_pd(numbers.as_mut_ptr(), self.0) };
        numbers[k]
    }
    operation!(add(o) = _mm512_add_pd);
    operation!(sub(o) = _mm512_sub_pd);
    operation!(mul(o) = _mm512_mul_pd);
    operation!(div(o) = _mm512_div_pd);
    operation!(mul_add(a, b) = _mm512_fmadd_pd);
    operation!(mul_sub(a, b) = _mm512_fmsub_pd);
    operation!(neg_mul_add(a, b) = _mm512_fnmadd_pd);
    operation!(sqrt() = _mm512_sqrt_pd);
    #[inline(always)]
    fn neg(self) -> Self {
        // By the integer instruction: the one for numbers belongs to a further extension. SAFETY: see the file's head.
        Self(unsafe {
            let sign = _mm512_castpd_si512(_mm512_set1_pd(-0.0));
            _mm512_castsi512_pd(_mm512_xor_si512(_mm512_castpd_si512(self.0), sign))
        })
    }
    operation!(abs() = _mm512_abs_pd);
    #[inline(always)]
    fn positive(self, then: Self, otherwise: Self) -> Self {
        // SAFETY: see the file's head.
        Self(unsafe {
            let mask = _mm512_cmp_pd_mask::<_CMP_GT_OQ>(self.0, _mm512_setzero_pd());
            _mm512_mask_blend_pd(mask, otherwise.0, then.0)
        })
    }
    #[inline(always)]
    fn power_of_two(self) -> Self {
        // The number plus the exponent's bias ends in the last bits of 2^52 + it; shifted, they are an exponent. SAFETY: see the file's head.
        Self(unsafe {
            let biased = _mm512_add_pd(self.0, _mm512_set1_pd(1023.0 + super::TWO_52));
            _mm512_castsi512_pd(_mm512_slli_epi64::<52>(_mm512_castpd_si512(biased)))
        })
    }
    operation!(exponent() = _mm512_getexp_pd);
    #[inline(always)]
    fn mantissa(self) -> Self {
        // SAFETY: see the file's head.
        Self(unsafe { _mm512_getmant_pd::<_MM_MANT_NORM_1_2, _MM_MANT_SIGN_SRC>(self.0) })
    }
    #[inline(always)]
    fn all_finite(self) -> bool {
        // x - x is 0 for finite numbers only. SAFETY: see the file's head.
        unsafe {
            let zero = _mm512_sub_pd(self.0, self.0);
            _mm512_cmp_pd_mask::<_CMP_EQ_OQ>(zero, _mm512_setzero_pd()) == 0b1111_1111
        }
    }
    #[inline(always)]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        #[target_feature(enable = "avx512f,avx2,fma")]
        #[inline(never)]
        fn compiled<K: Kernel>(kernel: K) -> K::Output {
            super::Aligned::keep();
            kernel.run()
        }
        assert!(InstructionSet::Avx512.is_available(), "this processor lacks the instruction set avx512f,avx2,fma");
        // SAFETY: the processor has the instructions, as just checked.
        unsafe { compiled(kernel) }
    }
}
