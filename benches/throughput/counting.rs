//! A number that counts the floating-point operations done with it.

use bha_core::real::Real;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

static OPERATIONS: AtomicU64 = AtomicU64::new(0);

/// Operations that `work` does: additions, products, quotients and roots one each, a fused multiply-add two; elementary
/// functions as the lanes compute them are not looked into and count as ten.
pub fn operations(work: impl FnOnce()) -> u64 {
    OPERATIONS.store(0, Relaxed);
    work();
    OPERATIONS.load(Relaxed)
}

/// See [`operations`].
#[derive(Clone, Copy, Debug)]
pub struct Counting(f64);

fn done(count: u64, x: f64) -> Counting {
    OPERATIONS.fetch_add(count, Relaxed);
    Counting(x)
}

macro_rules! operator {
    ($trait:ident, $name:ident, $assign:ident, $assign_name:ident, $sign:tt) => {
        impl $trait for Counting {
            type Output = Self;
            fn $name(self, o: Self) -> Self {
                done(1, self.0 $sign o.0)
            }
        }
        impl $trait<f64> for Counting {
            type Output = Self;
            fn $name(self, o: f64) -> Self {
                done(1, self.0 $sign o)
            }
        }
        impl $assign for Counting {
            fn $assign_name(&mut self, o: Self) {
                *self = done(1, self.0 $sign o.0);
            }
        }
    };
}

operator!(Add, add, AddAssign, add_assign, +);
operator!(Sub, sub, SubAssign, sub_assign, -);
operator!(Mul, mul, MulAssign, mul_assign, *);

impl Div for Counting {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        done(1, self.0 / o.0)
    }
}

impl Neg for Counting {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Real for Counting {
    fn lane(self, _: usize) -> f64 {
        self.0
    }
    fn from_lanes(mut lane: impl FnMut(usize) -> f64) -> Self {
        Self(lane(0))
    }
    fn from_f64(x: f64) -> Self {
        Self(x)
    }
    fn sqrt(self) -> Self {
        done(1, self.0.sqrt())
    }
    fn exp(self) -> Self {
        done(10, self.0.exp())
    }
    fn ln(self) -> Self {
        done(10, self.0.ln())
    }
    fn tanh(self) -> Self {
        done(10, self.0.tanh())
    }
    fn abs(self) -> Self {
        Self(self.0.abs())
    }
    fn select(condition: Self, then: Self, otherwise: Self) -> Self {
        if condition.0 > 0.0 { then } else { otherwise }
    }
    fn is_finite(self) -> bool {
        self.0.is_finite()
    }
    fn largest(self) -> f64 {
        self.0
    }
}
