//! The scalar that the model is written over.
//!
//! The equations of motion are written once, generic over [`Real`]: `f64` runs one arm, lanes ([`Lanes`]) run several
//! abreast, dual numbers ([`Dual`]) carry
//! exact derivatives. The hot path has no branch that depends on a value; where a law is
//! one-sided, [`Real::select`] chooses between two values that were both computed.

mod dual;
mod fused;
pub mod lanes;
pub mod linear;
mod several;
mod side_by_side;

pub use dual::Dual;
pub use fused::Fused;
pub use lanes::{InstructionSet, Lanes};
pub use several::Several;
pub use side_by_side::{Packing, SideBySide, Single};

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// Work that is compiled once for each scalar it runs on, by [`Real::enter`].
///
/// A stage of the model is a kernel of its own (a pass up the chain, the sum of forces, the sweep of the solution, a
/// step's begin and end): small enough to compile in seconds, large enough that the call does not show.
pub trait Kernel {
    /// What it returns.
    type Output;
    /// Does the work. Implementations are `#[inline(always)]`, as is all they call: what stays out of line is compiled
    /// without the instruction set.
    fn run(self) -> Self::Output;
}

/// A function whose body is a [`Kernel`]: compiled once for each scalar, for its instruction set.
///
/// The references among its arguments have the lifetime named first.
macro_rules! kernel {
    ($(#[$attribute:meta])* $vis:vis fn $name:ident<$life:lifetime, $scalar:ident>($($field:ident: $type:ty),+ $(,)?) $body:block) => {
        $(#[$attribute])*
        #[inline(always)]
        #[allow(clippy::too_many_arguments)]
        $vis fn $name<$life, $scalar: $crate::real::Real>($($field: $type),+) {
            struct Work<$life, $scalar> {
                $($field: $type),+
            }
            impl<$life, $scalar: $crate::real::Real> $crate::real::Kernel for Work<$life, $scalar> {
                type Output = ();
                #[inline(always)]
                fn run(self) {
                    let Self { $($field),+ } = self;
                    $body
                }
            }
            $scalar::enter(Work { $($field),+ });
        }
    };
}
pub(crate) use kernel;

/// A [`Kernel`] for the instruction set that every processor of the target has.
#[inline(never)]
fn run<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}

/// Whether all are finite. A loop and not `all`: see `linear`.
#[inline(always)]
pub(crate) fn all_finite<T: Real>(x: &[T]) -> bool {
    let mut finite = true;
    for x in x {
        finite &= x.is_finite();
    }
    finite
}

/// Puts the lanes of `new` that `which` says into `x`.
#[inline(always)]
pub(crate) fn replace<T: Real>(x: &mut [T], new: &[T], which: impl Fn(usize) -> bool + Copy) {
    for (x, new) in x.iter_mut().zip(new) {
        *x = x.replaced(*new, which);
    }
}

/// A real number, several of them abreast, or one with its derivatives.
pub trait Real:
    Copy
    + Debug
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
{
    /// How many numbers are abreast.
    const LANES: usize = 1;
    /// The value in lane `k`, derivatives left out.
    fn lane(self, k: usize) -> f64;
    /// Lane by lane, from lane 0 on, with no derivative.
    fn from_lanes(lane: impl FnMut(usize) -> f64) -> Self;
    /// The same with the lanes of `new` that `which` says.
    #[inline(always)]
    fn replaced(self, new: Self, which: impl Fn(usize) -> bool) -> Self {
        Self::from_lanes(|k| if which(k) { new.lane(k) } else { self.lane(k) })
    }
    /// Runs `kernel` in a function compiled for this scalar's instruction set.
    #[inline(always)]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        run(kernel)
    }
    /// Does `work` on `count` equal sets of equations: some at a time where this scalar can be packed, else one by one.
    #[inline(always)]
    fn side_by_side<W: SideBySide<Self>>(_count: usize, work: W) {
        work.run::<Single>();
    }
    /// The constant `x`: the same in every lane, with no derivative.
    fn from_f64(x: f64) -> Self;
    /// Zero.
    #[inline(always)]
    fn zero() -> Self {
        Self::from_f64(0.0)
    }
    /// One.
    #[inline(always)]
    fn one() -> Self {
        Self::from_f64(1.0)
    }
    /// `self * a + b`; fused where the scalar's instruction set has it, else rounded twice.
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        self * a + b
    }
    /// `self * a - b`, likewise.
    #[inline(always)]
    fn mul_sub(self, a: Self, b: Self) -> Self {
        self * a - b
    }
    /// `b - self * a`, likewise.
    #[inline(always)]
    fn neg_mul_add(self, a: Self, b: Self) -> Self {
        b - self * a
    }
    /// `1 / self`.
    #[inline(always)]
    fn recip(self) -> Self {
        Self::one() / self
    }
    /// Square root.
    fn sqrt(self) -> Self;
    /// Exponential.
    fn exp(self) -> Self;
    /// Hyperbolic tangent.
    fn tanh(self) -> Self;
    /// Natural logarithm of a positive number.
    fn ln(self) -> Self;
    /// A positive number to a power.
    #[inline(always)]
    fn powf(self, exponent: Self) -> Self {
        (self.ln() * exponent).exp()
    }
    /// Absolute value (derivative at zero: that of `+x`).
    fn abs(self) -> Self;
    /// `then` where `condition > 0`, else `otherwise`; both are computed.
    fn select(condition: Self, then: Self, otherwise: Self) -> Self;
    /// The larger of two.
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::select(self - other, self, other)
    }
    /// The smaller of two.
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self::select(other - self, self, other)
    }
    /// Whether every lane and every derivative is finite.
    fn is_finite(self) -> bool;
    /// The largest value over the lanes, derivatives left out (for checks and step control, never inside the model).
    fn largest(self) -> f64;
    /// The smallest value over the lanes.
    #[inline(always)]
    fn smallest(self) -> f64 {
        -(-self).largest()
    }
}

impl Real for f64 {
    #[inline(always)]
    fn side_by_side<W: SideBySide<Self>>(count: usize, work: W) {
        side_by_side::plain(count, work);
    }
    #[inline(always)]
    fn lane(self, _: usize) -> f64 {
        self
    }
    #[inline(always)]
    fn from_lanes(mut lane: impl FnMut(usize) -> f64) -> Self {
        lane(0)
    }
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn exp(self) -> Self {
        f64::exp(self)
    }
    #[inline(always)]
    fn tanh(self) -> Self {
        f64::tanh(self)
    }
    #[inline(always)]
    fn ln(self) -> Self {
        f64::ln(self)
    }
    #[inline(always)]
    fn powf(self, exponent: Self) -> Self {
        f64::powf(self, exponent)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        f64::abs(self)
    }
    #[inline(always)]
    fn select(condition: Self, then: Self, otherwise: Self) -> Self {
        if condition > 0.0 { then } else { otherwise }
    }
    #[inline(always)]
    fn is_finite(self) -> bool {
        f64::is_finite(self)
    }
    #[inline(always)]
    fn largest(self) -> f64 {
        self
    }
}
