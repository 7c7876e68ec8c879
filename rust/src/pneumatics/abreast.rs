//! The inputs of one arm abreast in the processor's lanes.
//!
//! Chambers know each other only through the arm, so that over a step they are so many copies of the same equations: where
//! one arm runs by itself (`f64`), as many of its inputs as there are lanes are advanced at once, the same code over
//! another scalar, and several registers side by side, since a sub-step is a long chain of dependent operations. The last
//! lanes repeat the last input where the inputs do not fill them.

use super::substep::substep;
use super::{Chambers, Drive, Input, Place, Pneumatics, chamber};
use crate::real::lanes::{AnyLanes, dispatch};
use crate::real::{InstructionSet, Kernel, Real, Several};
use std::marker::PhantomData;

/// Four lanes hold the nine inputs of three sections in three registers; eight would leave seven of sixteen idle.
fn instruction_set() -> InstructionSet {
    if InstructionSet::Avx2.is_available() { InstructionSet::Avx2 } else { InstructionSet::best() }
}

/// Advances all inputs over a step in sub-steps of `step` s; nodes are as long as they need to be.
pub fn fill(chambers: &mut Chambers<f64>, pneumatics: &Pneumatics<f64>, step: f64) {
    dispatch(instruction_set(), Fill { chambers, pneumatics, step });
}

/// The acting pressures at a moment of the step, in the volumes given, into [`Chambers::acting`].
pub fn read(chambers: &mut Chambers<f64>, pneumatics: &Pneumatics<f64>, at: Place) {
    dispatch(instruction_set(), Read { chambers, exponent: pneumatics.exponent, at });
}

struct Fill<'a> {
    chambers: &'a mut Chambers<f64>,
    pneumatics: &'a Pneumatics<f64>,
    step: f64,
}

struct Read<'a> {
    chambers: &'a mut Chambers<f64>,
    exponent: f64,
    at: Place,
}

/// Work and the lanes to do it with.
struct With<W, V>(W, PhantomData<V>);

/// Does work on so many inputs with as many registers side by side as they fill.
fn side_by_side<V: Real, W>(inputs: usize, work: W)
where
    With<W, V>: Kernel<Output = ()>,
    With<W, Several<V, 2>>: Kernel<Output = ()>,
    With<W, Several<V, 3>>: Kernel<Output = ()>,
{
    match inputs.div_ceil(V::LANES) {
        0 | 1 => V::enter(With(work, PhantomData::<V>)),
        2 => V::enter(With(work, PhantomData::<Several<V, 2>>)),
        _ => V::enter(With(work, PhantomData::<Several<V, 3>>)),
    }
}

impl AnyLanes for Fill<'_> {
    type Output = ();
    fn with<V: Real>(self) {
        side_by_side::<V, _>(self.chambers.now.len(), self);
    }
}

impl AnyLanes for Read<'_> {
    type Output = ();
    fn with<V: Real>(self) {
        side_by_side::<V, _>(self.chambers.now.len(), self);
    }
}

impl<V: Real> Kernel for With<Fill<'_>, V> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Fill { chambers, pneumatics, step } = self.0;
        let Chambers { now, next, drives, nodes, node_pressures, substeps, .. } = chambers;
        let (k, inputs) = (pneumatics.shared(V::from_f64), now.len());
        for first in (0..inputs).step_by(V::LANES) {
            let last = inputs - 1;
            let x = Input {
                content: V::from_lanes(|i| now[(first + i).min(last)].content),
                spool: V::from_lanes(|i| now[(first + i).min(last)].spool),
                integral: V::from_lanes(|i| now[(first + i).min(last)].integral),
            };
            let drive = Drive {
                reference: V::from_lanes(|i| drives[(first + i).min(last)].reference),
                reference_rate: V::from_lanes(|i| drives[(first + i).min(last)].reference_rate),
                volume: V::from_lanes(|i| drives[(first + i).min(last)].volume),
                volume_rate: V::from_lanes(|i| drives[(first + i).min(last)].volume_rate),
            };
            let volume = V::from_lanes(|i| pneumatics.control_volume[(first + i).min(last)]);
            let used = V::LANES.min(inputs - first);
            let mut x = (x, chamber::pressure(&k, x.content, drive.volume));
            for node in 0..=*substeps {
                if node > 0 {
                    x = substep(&k, volume, x, &drive, ((node - 1) as f64 * step, step));
                }
                let row = node * inputs + first;
                for i in 0..used {
                    nodes[row + i] = x.0.content.lane(i);
                    node_pressures[row + i] = x.1.lane(i);
                }
            }
            let x = x.0;
            for (i, next) in next[first..first + used].iter_mut().enumerate() {
                *next = Input { content: x.content.lane(i), spool: x.spool.lane(i), integral: x.integral.lane(i) };
            }
        }
    }
}

impl<V: Real> Kernel for With<Read<'_>, V> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Read { chambers, exponent, at } = self.0;
        let Chambers { drives, nodes, node_pressures, volumes, acting, .. } = chambers;
        let inputs = acting.len();
        let (before, after) = (&nodes[at.node * inputs..], &nodes[(at.node + 1) * inputs..]);
        let pressures = &node_pressures[at.node * inputs..];
        for first in (0..inputs).step_by(V::LANES) {
            let index = |i: usize| (first + i).min(inputs - 1);
            let a = V::from_lanes(|i| before[index(i)]);
            let b = V::from_lanes(|i| after[index(i)]);
            let p = V::from_lanes(|i| pressures[index(i)]);
            let then = V::from_lanes(|i| drives[index(i)].volume + drives[index(i)].volume_rate * at.time);
            let now = (a + (b - a) * at.on, V::from_lanes(|i| volumes[index(i)]));
            let found = chamber::pressure_from(V::from_f64(exponent), (p, a, then), now);
            for (i, p) in acting[first..].iter_mut().take(V::LANES).enumerate() {
                *p = found.lane(i);
            }
        }
    }
}
