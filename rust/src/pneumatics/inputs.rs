//! The inputs of one arm over a step, side by side.
//!
//! Chambers know each other only through the arm, so that over a step they are so many copies of the same equations: as
//! many of them as the scalar can pack are advanced at once ([`crate::real::SideBySide`]). The last place of a pack repeats
//! the last input where the inputs do not fill it.

use super::chamber::{self, Air, Volume};
use super::substep::{Drive, Input, substep};
use super::{Chambers, Pneumatics};
use crate::real::{Packing, Real, SideBySide};

/// A moment within a step of the arm.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// The node before it.
    pub node: usize,
    /// That node's time from the start of the step, s.
    pub time: f64,
    /// How far it is on the way to the next node, 0 to 1.
    pub on: f64,
}

/// Volumes packed; what they gain by pressure only where walls give way. A macro: a closure within the one that `pack` takes
/// may stay out of line, where it is compiled without the lanes' instruction set.
macro_rules! packed {
    ($pack:ident, $walls_give:expr, |$i:ident| $volume:expr) => {{
        let at_ambient = $pack::pack(|$i| $volume.at_ambient);
        let by_pressure = if $walls_give { $pack::pack(|$i| $volume.by_pressure) } else { $pack::Wide::zero() };
        Volume { at_ambient, by_pressure }
    }};
}

/// Advances all inputs over a step in sub-steps of `step` s; nodes are as long as they need to be.
pub struct Fill<'a, T> {
    /// Those of one arm.
    pub chambers: &'a mut Chambers<T>,
    /// Their laws.
    pub pneumatics: &'a Pneumatics<T>,
    /// Length of a sub-step, s.
    pub step: f64,
}

impl<T: Real> SideBySide<T> for Fill<'_, T> {
    #[inline(always)]
    fn run<P: Packing<T>>(self) {
        let Self { chambers, pneumatics, step } = self;
        let Chambers { now, next, drives, nodes, node_pressures, substeps, .. } = chambers;
        let (k, inputs) = (pneumatics.shared(P::same), now.len());
        let last = inputs - 1;
        for first in (0..inputs).step_by(P::WIDTH) {
            let x = Input {
                content: P::pack(|i| now[(first + i).min(last)].content),
                spool: P::pack(|i| now[(first + i).min(last)].spool),
                integral: P::pack(|i| now[(first + i).min(last)].integral),
            };
            let drive = Drive {
                reference: P::pack(|i| drives[(first + i).min(last)].reference),
                reference_rate: P::pack(|i| drives[(first + i).min(last)].reference_rate),
                volume: packed!(P, k.walls_give, |i| drives[(first + i).min(last)].volume),
                volume_rate: packed!(P, k.walls_give, |i| drives[(first + i).min(last)].volume_rate),
            };
            let volume = P::pack(|i| pneumatics.control_volume[(first + i).min(last)]);
            let used = P::WIDTH.min(inputs - first);
            let mut x = (x, chamber::pressure(&k, x.content, &drive.volume));
            for node in 0..=*substeps {
                if node > 0 {
                    x = substep(&k, volume, x, &drive, ((node - 1) as f64 * step, step));
                }
                let row = node * inputs + first;
                for i in 0..used {
                    nodes[row + i] = P::unpack(x.0.content, i);
                    node_pressures[row + i] = P::unpack(x.1, i);
                }
            }
            let x = x.0;
            for (i, next) in next[first..first + used].iter_mut().enumerate() {
                *next = Input {
                    content: P::unpack(x.content, i),
                    spool: P::unpack(x.spool, i),
                    integral: P::unpack(x.integral, i),
                };
            }
        }
    }
}

/// The acting pressures at a moment of the step, in the volumes that the chambers stand in, into `out`.
pub struct Read<'a, T> {
    /// Those of one arm.
    pub chambers: &'a Chambers<T>,
    /// Their law.
    pub air: Air<T>,
    /// When.
    pub at: Place,
    /// One pressure an input, Pa.
    pub out: &'a mut [T],
}

impl<T: Real> SideBySide<T> for Read<'_, T> {
    #[inline(always)]
    fn run<P: Packing<T>>(self) {
        let Self { chambers, air, at, out } = self;
        let Chambers { drives, nodes, node_pressures, volumes, .. } = chambers;
        let inputs = out.len();
        let (exponent, ambient) = (P::same(air.exponent), P::same(air.ambient));
        let air = Air { exponent, ambient, walls_give: air.walls_give };
        let (before, after) = (&nodes[at.node * inputs..], &nodes[(at.node + 1) * inputs..]);
        let pressures = &node_pressures[at.node * inputs..];
        let last = inputs - 1;
        for first in (0..inputs).step_by(P::WIDTH) {
            let a = P::pack(|i| before[(first + i).min(last)]);
            let b = P::pack(|i| after[(first + i).min(last)]);
            let p = P::pack(|i| pressures[(first + i).min(last)]);
            let then = packed!(P, air.walls_give, |i| drives[(first + i).min(last)].volume_at(at.time));
            let now = packed!(P, air.walls_give, |i| volumes[(first + i).min(last)]);
            let found = air.pressure_from((p, a, then), (a + (b - a) * at.on, now));
            for (i, p) in out[first..].iter_mut().take(P::WIDTH).enumerate() {
                *p = P::unpack(found, i);
            }
        }
    }
}
