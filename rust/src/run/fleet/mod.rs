//! Many steppers in step: one arm, held pressures, in the lanes of the processor and over its cores.
//!
//! Effects that depend on time itself (formulas with t) see the time since the step's beginning.
//!
//! Steps by RK4, by the linearly implicit method for stiff arms, or by the symplectic Euler method (rates first, then
//! lengths with the new rates; Hairer, Lubich & Wanner, *Geometric Numerical Integration*, sec. I.1): of first order, and
//! one evaluation of the equations of motion in place of four. Which of them an arm is stable with: [`crate::run::stepping`].
//!
//! For learning: thousands of environments that are stepped together and reset one by one. A lane that diverges is put back to
//! rest and reported; the others do not notice. Every environment is computed by itself, so the result does not depend on
//! the number of threads.

mod block;
mod workers;

use self::block::{Build, Environments};
use self::workers::Workers;
use super::stepping::Plan;
use super::watch::watched_in;
use crate::arm::Arm;
use crate::effects::pressures::{PressureChain, Sort};
use crate::effects::upstream::History;
use crate::error::{Error, Result};
use crate::memory::reserved;
use crate::plant::input::{Input, Interpolation};
use crate::real::lanes::{InstructionSet, dispatch};
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Most environments of a fleet.
const MOST: usize = 1 << 20;
/// Numbers that an environment keeps, by numbers in its row: state, stages, parked state, work space of the dynamics. Counted
/// generously; only to refuse what cannot fit before it is begun.
const NUMBERS: usize = 64;
/// Blocks that are not worth a thread of their own.
const LEAST_BLOCKS: usize = 8;

/// Environments of one arm.
pub struct Fleet {
    blocks: Vec<Box<dyn Environments>>,
    lanes: usize,
    count: usize,
    width: usize,
    inputs: usize,
    coordinates: usize,
    workers: Option<Workers>,
}

/// Where an environment begins.
#[derive(Clone, Copy, Debug)]
pub struct Start<'a> {
    /// Lengths, m.
    pub q: &'a [f64],
    /// Pressures in the chambers and commanded, Pa absolute.
    pub p: &'a [f64],
}

impl Fleet {
    /// `count` environments of `arm`, all at `start`; steps of at most `step` s; `threads` 0: as many as cores.
    ///
    /// # Errors
    /// [`Error::Input`] for sizes or values that do not fit.
    pub fn new(
        arm: &Arc<Arm>,
        count: usize,
        start: Start<'_>,
        Plan { stepping, step }: Plan,
        threads: usize,
    ) -> Result<Self> {
        if !(step.is_finite() && step > 0.0) {
            return Err(Error::Input(format!("step: {step}; a positive number of seconds is needed")));
        }
        if !(1..=MOST).contains(&count) {
            return Err(Error::Input(format!("count: {count}; 1 to {MOST} environments are allowed")));
        }
        let set = InstructionSet::best();
        let lanes = set.lanes();
        let (inputs, coordinates) = (arm.body.inputs, arm.coordinates());
        let threads = if count <= lanes * LEAST_BLOCKS { 1 } else { threads };
        let workers = if threads == 1 { None } else { Some(Workers::new(threads)?) };
        if PressureChain::new((&arm.effects, Sort::All), arm.body.inputs, &mut History::new(0.0, start.p), 0.0)
            .is_some()
        {
            return Err(Error::Input(
                "this arm has effects on pressures, which environments that are reset one by one do not support; take them \
                 away with with_effects"
                    .to_owned(),
            ));
        }
        drop(reserved("count: the environments", &[count, NUMBERS, 2 * coordinates + inputs + 3])?);
        let none = Input::new(vec![0.0], (start.p.to_vec(), inputs), (Vec::new(), 0), Interpolation::Hold)?;
        let none = Arc::new(none);
        let blocks = dispatch(set, Build { count: count.div_ceil(lanes), arm, none: &none, start, stepping, step });
        Ok(Self { blocks, lanes, count, width: 2 * coordinates + inputs + 3, inputs, coordinates, workers })
    }

    /// Number of environments.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Numbers in a row of [`Fleet::read`].
    pub fn width(&self) -> usize {
        self.width
    }

    /// Pressure inputs.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Coordinates.
    pub fn coordinates(&self) -> usize {
        self.coordinates
    }

    /// Puts environment `k` at a start, at rest.
    pub fn reset(&mut self, k: usize, start: Start<'_>) {
        self.blocks[k / self.lanes].reset(k % self.lanes, start);
    }

    /// Holds the pressures `p` (a row an environment) for `dt` s, then writes the rows of all into `out` (see
    /// [`Fleet::read`]). `failed` says which diverged: they are back where they began last. `watch` is called on this thread
    /// about every 50 ms.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `watch` returned true: the plants then stand somewhere within the step.
    pub fn step(
        &mut self,
        p: &[f64],
        dt: f64,
        failed: &mut [bool],
        out: &mut [f64],
        watch: &mut impl FnMut() -> bool,
    ) -> Result<()> {
        let (lanes, inputs, width) = (self.lanes, self.inputs, self.width);
        failed.fill(false);
        let Some(workers) = &mut self.workers else {
            let rows = p.chunks(lanes * inputs).zip(failed.chunks_mut(lanes)).zip(out.chunks_mut(lanes * width));
            for (block, ((p, failed), out)) in self.blocks.iter_mut().zip(rows) {
                if !block.step(p, dt, failed, watch) {
                    return Err(Error::Interrupted);
                }
                block.read(out);
            }
            return Ok(());
        };
        let (blocks, stop) = (&mut self.blocks, AtomicBool::new(false));
        let work = || {
            blocks
                .par_iter_mut()
                .zip(p.par_chunks(lanes * inputs))
                .zip(failed.par_chunks_mut(lanes))
                .zip(out.par_chunks_mut(lanes * width))
                .with_min_len(LEAST_BLOCKS)
                .for_each(|(((block, p), failed), out)| {
                    let mut asked = || stop.load(Ordering::Relaxed);
                    if !asked() && block.step(p, dt, failed, &mut asked) {
                        block.read(out);
                    }
                });
        };
        watched_in(workers.here()?, &stop, work, watch);
        if stop.into_inner() { Err(Error::Interrupted) } else { Ok(()) }
    }

    /// Rows of (lengths as their sensors have them, rates, chamber pressures, tip position) into `out`: m, m/s, Pa
    /// absolute, m.
    pub fn read(&mut self, out: &mut [f64]) {
        let rows = out.chunks_mut(self.lanes * self.width);
        self.blocks.iter_mut().zip(rows).for_each(|(block, out)| block.read(out));
    }

    /// Everything that decides what comes next: a row an environment, then what all share. For [`Fleet::set_state`] of
    /// as many environments of the same arm, on any processor.
    pub fn state(&self) -> Vec<f64> {
        let (times, elapsed) = self.blocks[0].times();
        let size = self.blocks[0].size();
        let mut out = vec![0.0; self.count * size];
        let rows = out.chunks_mut(self.lanes * size);
        self.blocks.iter().zip(rows).for_each(|(block, rows)| block.save(rows));
        out.extend_from_slice(&times);
        out.push(elapsed);
        out
    }

    /// Goes on from what [`Fleet::state`] gave.
    ///
    /// # Errors
    /// [`Error::Input`] for numbers that are not those of this arm and as many environments.
    pub fn set_state(&mut self, numbers: &[f64]) -> Result<()> {
        if numbers.iter().any(|x| !x.is_finite()) {
            return Err(Error::Input("state: finite numbers are needed".to_owned()));
        }
        // Rows of environments and the shared times grow together with what sensors remember.
        let (times, states) = (self.blocks[0].times().0.len(), 2 * self.coordinates);
        let fixed = self.count * (self.blocks[0].size() - times * states) + 1;
        let each = self.count * states + 1;
        let rest = numbers.len().checked_sub(fixed);
        let kept = match rest {
            Some(rest) if rest % each == 0 && (rest == 0) == (times == 0) => rest / each,
            _ => {
                return Err(Error::Input(format!(
                    "state: it does not fit {} environments of this arm; take one that as many gave",
                    self.count
                )));
            }
        };
        let (rows, shared) = numbers.split_at(numbers.len() - kept - 1);
        let size = rows.len() / self.count;
        for (block, rows) in self.blocks.iter_mut().zip(rows.chunks(self.lanes * size)) {
            block.load(rows, &shared[..kept], shared[kept])?;
        }
        Ok(())
    }
}
