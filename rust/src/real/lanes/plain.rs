//! Four lanes in ordinary code: the same results on every processor, and what the others are tested against.

use super::Register;
use crate::real::Kernel;

/// Four numbers.
#[derive(Clone, Copy, Debug)]
pub struct Plain([f64; 4]);

/// Number by number; a macro and no closure: see `linear`.
macro_rules! each {
    ($k:ident, $number:expr) => {{
        let mut out = [0.0; 4];
        for ($k, x) in out.iter_mut().enumerate() {
            *x = $number;
        }
        Self(out)
    }};
}

impl Register for Plain {
    const WIDTH: usize = 4;
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self([x; 4])
    }
    #[inline(always)]
    fn from_fn(mut x: impl FnMut(usize) -> f64) -> Self {
        each!(k, x(k))
    }
    #[inline(always)]
    fn get(self, k: usize) -> f64 {
        self.0[k]
    }
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        each!(k, self.0[k] + o.0[k])
    }
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        each!(k, self.0[k] - o.0[k])
    }
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        each!(k, self.0[k] * o.0[k])
    }
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        each!(k, self.0[k] / o.0[k])
    }
    #[inline(always)]
    fn neg(self) -> Self {
        each!(k, -self.0[k])
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        self.mul(a).add(b)
    }
    #[inline(always)]
    fn mul_sub(self, a: Self, b: Self) -> Self {
        self.mul(a).sub(b)
    }
    #[inline(always)]
    fn neg_mul_add(self, a: Self, b: Self) -> Self {
        b.sub(self.mul(a))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        each!(k, self.0[k].sqrt())
    }
    #[inline(always)]
    fn abs(self) -> Self {
        each!(k, self.0[k].abs())
    }
    #[inline(always)]
    fn positive(self, then: Self, otherwise: Self) -> Self {
        each!(k, if self.0[k] > 0.0 { then.0[k] } else { otherwise.0[k] })
    }
    #[inline(always)]
    fn power_of_two(self) -> Self {
        // The number plus the exponent's bias ends in the last bits of 2^52 + it; shifted, they are an exponent.
        each!(k, f64::from_bits((self.0[k] + (1023.0 + super::TWO_52)).to_bits() << 52))
    }
    #[inline(always)]
    fn all_finite(self) -> bool {
        self.0.iter().all(|x| x.is_finite())
    }
    #[inline(always)]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        crate::real::run(kernel)
    }
}
