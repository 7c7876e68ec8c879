//! Equal sets of equations side by side within one model: many copies of the same small problem (the chambers of one arm).
//!
//! Where one model runs by itself (`f64`), as many of them as there are lanes are computed at once, the same code over a
//! wider scalar, and several registers side by side, since such problems are long chains of dependent operations. A scalar
//! that is lanes or carries derivatives already takes them one after the other.

use super::lanes::{AnyLanes, InstructionSet, dispatch};
use super::{Kernel, Real, Several};
use std::marker::PhantomData;

/// How some numbers of scalar `T` become one of a wider scalar.
pub trait Packing<T> {
    /// The wider scalar.
    type Wide: Real;
    /// How many numbers it holds.
    const WIDTH: usize;
    /// The same number in every place.
    fn same(x: T) -> Self::Wide;
    /// `part(k)` in place `k`.
    fn pack(part: impl Fn(usize) -> T) -> Self::Wide;
    /// The number in place `k`.
    fn unpack(wide: Self::Wide, k: usize) -> T;
}

/// Work on equal sets of equations, as many at a time as a packing holds. Implementations are `#[inline(always)]`, as those
/// of [`Kernel`] are.
pub trait SideBySide<T: Real> {
    /// Does it.
    fn run<P: Packing<T>>(self);
}

/// One by one.
pub struct Single;

impl<T: Real> Packing<T> for Single {
    type Wide = T;
    const WIDTH: usize = 1;
    #[inline(always)]
    fn same(x: T) -> T {
        x
    }
    #[inline(always)]
    fn pack(part: impl Fn(usize) -> T) -> T {
        part(0)
    }
    #[inline(always)]
    fn unpack(wide: T, _: usize) -> T {
        wide
    }
}

/// Plain numbers in the lanes of `V`.
struct InLanes<V>(PhantomData<V>);

impl<V: Real> Packing<f64> for InLanes<V> {
    type Wide = V;
    const WIDTH: usize = V::LANES;
    #[inline(always)]
    fn same(x: f64) -> V {
        V::from_f64(x)
    }
    #[inline(always)]
    fn pack(part: impl Fn(usize) -> f64) -> V {
        V::from_lanes(part)
    }
    #[inline(always)]
    fn unpack(wide: V, k: usize) -> f64 {
        wide.lane(k)
    }
}

/// Work on plain numbers and how many sets of equations there are.
struct Plain<W> {
    work: W,
    count: usize,
}

/// Work and the lanes to do it with.
struct With<W, V>(W, PhantomData<V>);

impl<W: SideBySide<f64>, V: Real> Kernel for With<W, V> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        self.0.run::<InLanes<V>>();
    }
}

impl<W: SideBySide<f64>> AnyLanes for Plain<W> {
    type Output = ();
    /// With as many registers side by side as they fill.
    fn with<V: Real>(self) {
        let Self { work, count } = self;
        match count.div_ceil(V::LANES) {
            0 | 1 => V::enter(With(work, PhantomData::<V>)),
            2 => V::enter(With(work, PhantomData::<Several<V, 2>>)),
            _ => V::enter(With(work, PhantomData::<Several<V, 3>>)),
        }
    }
}

/// Four lanes hold nine sets of equations in three registers; eight would leave seven of sixteen idle.
fn instruction_set() -> InstructionSet {
    if InstructionSet::Avx2.is_available() { InstructionSet::Avx2 } else { InstructionSet::best() }
}

/// `work` on `count` sets of plain numbers.
pub(super) fn plain<W: SideBySide<f64>>(count: usize, work: W) {
    dispatch(instruction_set(), Plain { work, count });
}
