//! Several scalars side by side as one.

use super::{Kernel, Real};
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// `N` scalars that go through the same code in turn, instruction by instruction: one waits for its division while the others go
/// on, which pays where a chain of dependent operations is long and registers are few.
#[derive(Clone, Copy, Debug)]
pub struct Several<T, const N: usize>([T; N]);

// Plain loops and no closures: these must end up in the kernel of the scalar's instruction set.
macro_rules! by_pairs {
    ($trait:ident, $name:ident) => {
        impl<T: Real, const N: usize> $trait for Several<T, N> {
            type Output = Self;
            #[inline(always)]
            fn $name(mut self, o: Self) -> Self {
                for k in 0..N {
                    self.0[k] = $trait::$name(self.0[k], o.0[k]);
                }
                self
            }
        }
    };
    ($trait:ident, $name:ident, f64) => {
        impl<T: Real, const N: usize> $trait<f64> for Several<T, N> {
            type Output = Self;
            #[inline(always)]
            fn $name(mut self, o: f64) -> Self {
                for k in 0..N {
                    self.0[k] = $trait::$name(self.0[k], o);
                }
                self
            }
        }
    };
    ($trait:ident, $name:ident, assign) => {
        impl<T: Real, const N: usize> $trait for Several<T, N> {
            #[inline(always)]
            fn $name(&mut self, o: Self) {
                for k in 0..N {
                    $trait::$name(&mut self.0[k], o.0[k]);
                }
            }
        }
    };
}

by_pairs!(Add, add);
by_pairs!(Sub, sub);
by_pairs!(Mul, mul);
by_pairs!(Div, div);
by_pairs!(Add, add, f64);
by_pairs!(Sub, sub, f64);
by_pairs!(Mul, mul, f64);
by_pairs!(AddAssign, add_assign, assign);
by_pairs!(SubAssign, sub_assign, assign);
by_pairs!(MulAssign, mul_assign, assign);

impl<T: Real, const N: usize> Neg for Several<T, N> {
    type Output = Self;
    #[inline(always)]
    fn neg(mut self) -> Self {
        for k in 0..N {
            self.0[k] = -self.0[k];
        }
        self
    }
}

macro_rules! each {
    ($name:ident($($other:ident),*)) => {
        #[inline(always)]
        fn $name(mut self $(, $other: Self)*) -> Self {
            for k in 0..N {
                self.0[k] = self.0[k].$name($($other.0[k]),*);
            }
            self
        }
    };
}

impl<T: Real, const N: usize> Real for Several<T, N> {
    const LANES: usize = N * T::LANES;
    each!(mul_add(a, b));
    each!(mul_sub(a, b));
    each!(neg_mul_add(a, b));
    each!(recip());
    each!(sqrt());
    each!(exp());
    each!(tanh());
    each!(ln());
    each!(powf(exponent));
    each!(abs());
    each!(max(other));
    each!(min(other));
    #[inline(always)]
    fn lane(self, k: usize) -> f64 {
        self.0[k / T::LANES].lane(k % T::LANES)
    }
    #[inline(always)]
    fn from_lanes(mut lane: impl FnMut(usize) -> f64) -> Self {
        let mut out = [T::zero(); N];
        for (k, x) in out.iter_mut().enumerate() {
            *x = T::from_lanes(|i| lane(k * T::LANES + i));
        }
        Self(out)
    }
    #[inline(always)]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        T::enter(kernel)
    }
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        Self([T::from_f64(x); N])
    }
    #[inline(always)]
    fn select(condition: Self, mut then: Self, otherwise: Self) -> Self {
        for k in 0..N {
            then.0[k] = T::select(condition.0[k], then.0[k], otherwise.0[k]);
        }
        then
    }
    #[inline(always)]
    fn is_finite(self) -> bool {
        let mut finite = true;
        for k in 0..N {
            finite &= self.0[k].is_finite();
        }
        finite
    }
    #[inline(always)]
    fn largest(self) -> f64 {
        let mut largest = f64::NEG_INFINITY;
        for k in 0..N {
            let x = self.0[k].largest();
            if x.is_nan() || x > largest {
                largest = x;
            }
        }
        largest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What several numbers together gave, and what each of them should.
    type Case = (Several<f64, 3>, fn(f64, f64) -> f64);

    #[test]
    fn each_number_goes_its_own_way() {
        let of = |f: fn(usize) -> f64| Several::<f64, 3>::from_lanes(f);
        let (x, y) = (of(|k| 1.5 + k as f64), of(|k| 0.25 * (k as f64 - 1.0)));
        let pairs: [Case; 8] = [
            (x + y, |x, y| x + y),
            (x * y - x, |x, y| x * y - x),
            (-x / (y + 2.0), |x, y| -x / (y + 2.0)),
            (x.powf(y), f64::powf),
            (x.mul_add(y, x), |x, y| x * y + x),
            (Several::select(y, x, -x), |x, y| if y > 0.0 { x } else { -x }),
            (x.max(y).min(Several::one() + 1.0), |x, y| x.max(y).min(2.0)),
            ((x.sqrt().ln().exp() + y.abs()).recip(), |x, y| 1.0 / (x.sqrt().ln().exp() + y.abs())),
        ];
        for (found, expected) in pairs {
            for k in 0..3 {
                assert!((found.lane(k) - expected(x.lane(k), y.lane(k))).abs() < 1e-15);
            }
        }
        assert_eq!(x.largest(), 3.5);
        assert!(of(|k| if k == 1 { f64::NAN } else { 0.0 }).largest().is_nan());
        assert!(x.is_finite() && !(x / (y + 0.25)).is_finite());
        assert_eq!(Several::<f64, 3>::LANES, 3);
    }
}
