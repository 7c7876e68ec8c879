//! Several numbers abreast in vector registers.
//!
//! [`Lanes`] makes a [`Real`] of a [`Register`]; a register type belongs to one [`InstructionSet`]. The operations are
//! `#[inline(always)]` and the model is too, so that a whole time step ends up in the one function that
//! [`Register::enter`] compiles for the instruction set; outside of it the same operations are correct, but slow calls.
//!
//! Which set is used is chosen when the program runs, inside one binary: [`InstructionSet::best`].

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod elementary;
#[cfg(all(test, not(target_arch = "aarch64")))]
mod emulated;
#[cfg(any(target_arch = "aarch64", test))]
mod neon;

use super::{Kernel, Real};
use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

#[cfg(target_arch = "x86_64")]
pub use avx2::Avx2;
#[cfg(target_arch = "x86_64")]
pub use avx512::Avx512;
#[cfg(target_arch = "aarch64")]
pub use neon::Neon;

/// Instruction sets there are lanes for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstructionSet {
    /// No lanes: one member after the other, in the instructions that every processor of the target has.
    Scalar,
    /// Four lanes, fused multiply-add (aarch64).
    Neon,
    /// Four lanes, fused multiply-add (x86-64).
    Avx2,
    /// Eight lanes, fused multiply-add (x86-64).
    Avx512,
}

impl InstructionSet {
    /// All, from the narrowest on.
    pub const ALL: [Self; 4] = [Self::Scalar, Self::Neon, Self::Avx2, Self::Avx512];

    /// Whether this build and this processor have it. Lanes are in builds with the feature `lanes` only, since compiling
    /// the model for each instruction set takes its time.
    pub fn is_available(self) -> bool {
        if cfg!(not(feature = "lanes")) {
            return self == Self::Scalar;
        }
        match self {
            Self::Scalar => true,
            Self::Neon => cfg!(target_arch = "aarch64"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => Self::Avx2.is_available() && is_x86_feature_detected!("avx512f"),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => false,
        }
    }

    /// The widest one of this processor.
    pub fn best() -> Self {
        Self::ALL.into_iter().rev().find(|s| s.is_available()).unwrap_or(Self::Scalar)
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Neon => "neon",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }

    /// By the user's name.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|s| s.name() == name)
    }

    /// Numbers abreast.
    pub fn lanes(self) -> usize {
        match self {
            Self::Scalar => 1,
            Self::Neon | Self::Avx2 => 4,
            Self::Avx512 => 8,
        }
    }
}

/// Work that can be done with any kind of lanes.
pub trait AnyLanes {
    /// What it returns.
    type Output;
    /// Does it with lanes of type `T` (`f64` for [`InstructionSet::Scalar`]).
    fn with<T: Real>(self) -> Self::Output;
}

/// Does `work` with the lanes of `set`; with `f64` where this processor does not have it.
pub fn dispatch<W: AnyLanes>(set: InstructionSet, work: W) -> W::Output {
    if !set.is_available() {
        return work.with::<f64>();
    }
    match set {
        InstructionSet::Scalar => work.with::<f64>(),
        #[cfg(all(feature = "lanes", target_arch = "aarch64"))]
        InstructionSet::Neon => work.with::<Lanes<Neon>>(),
        #[cfg(all(feature = "lanes", target_arch = "x86_64"))]
        InstructionSet::Avx2 => work.with::<Lanes<Avx2>>(),
        #[cfg(all(feature = "lanes", target_arch = "x86_64"))]
        InstructionSet::Avx512 => work.with::<Lanes<Avx512>>(),
        #[allow(unreachable_patterns)] // the sets of other architectures and builds
        _ => work.with::<f64>(),
    }
}

/// A vector register of an instruction set (or several that act as one).
///
/// Values exist only where the processor has the set: [`dispatch`] sees to it, and [`Register::enter`] checks again.
pub trait Register: Copy + Debug + Send + Sync + 'static {
    /// Numbers in it.
    const WIDTH: usize;
    /// The same number everywhere.
    fn splat(x: f64) -> Self;
    /// Number by number.
    fn from_fn(x: impl FnMut(usize) -> f64) -> Self;
    /// Number `k`.
    fn get(self, k: usize) -> f64;
    /// Sum.
    fn add(self, o: Self) -> Self;
    /// Difference.
    fn sub(self, o: Self) -> Self;
    /// Product.
    fn mul(self, o: Self) -> Self;
    /// Quotient.
    fn div(self, o: Self) -> Self;
    /// `-self`.
    fn neg(self) -> Self;
    /// `self a + b`.
    fn mul_add(self, a: Self, b: Self) -> Self;
    /// `self a - b`.
    fn mul_sub(self, a: Self, b: Self) -> Self;
    /// `b - self a`.
    fn neg_mul_add(self, a: Self, b: Self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Absolute value.
    fn abs(self) -> Self;
    /// `then` where `self > 0`, else `otherwise`.
    fn positive(self, then: Self, otherwise: Self) -> Self;
    /// 2^self for a whole number from -1022 to 1023.
    fn power_of_two(self) -> Self;
    /// The whole number e of a positive, normal number m 2^e with 1 <= m < 2.
    fn exponent(self) -> Self;
    /// And m.
    fn mantissa(self) -> Self;
    /// Whether all numbers are finite.
    fn all_finite(self) -> bool;
    /// Runs `kernel` in a function compiled for the instruction set.
    fn enter<K: Kernel>(kernel: K) -> K::Output;
}

/// A place on the stack as aligned as the widest register.
///
/// A kernel's function keeps one, so that the compiler aligns its whole frame: it would notice only when it spills
/// registers that it should have, too late to do so, and every other spill would cross two cache lines.
#[cfg(target_arch = "x86_64")]
#[repr(align(64))]
struct Aligned(#[allow(dead_code)] u8);

#[cfg(target_arch = "x86_64")]
impl Aligned {
    /// Asks for the place.
    #[inline(always)]
    fn keep() {
        // Not a constant, which would lie elsewhere.
        let mut place = Self(0);
        std::hint::black_box(&mut place);
    }
}

/// 2^52, from which on doubles are whole numbers.
const TWO_52: f64 = 4_503_599_627_370_496.0;

/// The bits behind the exponent.
const MANTISSA: u64 = (1 << 52) - 1;

/// Numbers abreast as one [`Real`].
#[derive(Clone, Copy, Debug)]
pub struct Lanes<R>(pub R);

macro_rules! operator {
    ($trait:ident, $name:ident) => {
        impl<R: Register> $trait for Lanes<R> {
            type Output = Self;
            #[inline(always)]
            fn $name(self, o: Self) -> Self {
                Self(Register::$name(self.0, o.0))
            }
        }
    };
    ($trait:ident, $name:ident, f64) => {
        impl<R: Register> $trait<f64> for Lanes<R> {
            type Output = Self;
            #[inline(always)]
            fn $name(self, o: f64) -> Self {
                Self(Register::$name(self.0, R::splat(o)))
            }
        }
    };
    ($trait:ident, $name:ident, assign $by:ident) => {
        impl<R: Register> $trait for Lanes<R> {
            #[inline(always)]
            fn $name(&mut self, o: Self) {
                self.0 = Register::$by(self.0, o.0);
            }
        }
    };
}

operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);
operator!(Add, add, f64);
operator!(Sub, sub, f64);
operator!(Mul, mul, f64);
operator!(AddAssign, add_assign, assign add);
operator!(SubAssign, sub_assign, assign sub);
operator!(MulAssign, mul_assign, assign mul);

impl<R: Register> Neg for Lanes<R> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.neg())
    }
}

impl<R: Register> Real for Lanes<R> {
    const LANES: usize = R::WIDTH;
    #[inline(always)]
    fn lane(self, k: usize) -> f64 {
        self.0.get(k)
    }
    #[inline(always)]
    fn from_lanes(lane: impl FnMut(usize) -> f64) -> Self {
        Self(R::from_fn(lane))
    }
    #[inline(always)]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        R::enter(kernel)
    }
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        Self(R::splat(x))
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        Self(self.0.mul_add(a.0, b.0))
    }
    #[inline(always)]
    fn mul_sub(self, a: Self, b: Self) -> Self {
        Self(self.0.mul_sub(a.0, b.0))
    }
    #[inline(always)]
    fn neg_mul_add(self, a: Self, b: Self) -> Self {
        Self(self.0.neg_mul_add(a.0, b.0))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }
    #[inline(always)]
    fn exp(self) -> Self {
        elementary::exp(self)
    }
    #[inline(always)]
    fn ln(self) -> Self {
        elementary::ln(self)
    }
    #[inline(always)]
    fn tanh(self) -> Self {
        elementary::tanh(self)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.abs())
    }
    #[inline(always)]
    fn select(condition: Self, then: Self, otherwise: Self) -> Self {
        Self(condition.0.positive(then.0, otherwise.0))
    }
    #[inline(always)]
    fn is_finite(self) -> bool {
        self.0.all_finite()
    }
    #[inline(always)]
    fn largest(self) -> f64 {
        let mut largest = f64::NEG_INFINITY;
        for k in 0..R::WIDTH {
            let x = self.lane(k);
            if x.is_nan() || x > largest {
                largest = x;
            }
        }
        largest
    }
}

#[cfg(test)]
mod tests;
