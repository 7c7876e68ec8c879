//! Many simulations at once: arms (parameter sets), inputs, windows of a log, over threads.
//!
//! Members that take the same steps are computed together, in the lanes of the processor's widest instruction set; which
//! ones does not depend on the threads, so the result does not either. Lanes agree with single simulations to rounding
//! where steps are of a fixed length or those of another member, else to the tolerance: the worst lane controls them.
//! A member that cannot go on keeps its place: NaN from its failure on and the error as its status.

mod block;
mod sequences;
mod sharing;

use self::block::Block;
use self::sequences::Sequences;
use self::sharing::can_share;

use crate::arm::Arm;
use crate::error::{Error, Result};
use crate::integrate::{Method, Options, Statistics};
use crate::kinematics::section::Pose;
use crate::memory::filled;
use crate::plant::input::Input;
use crate::plant::stiffness::Fastest;
use crate::real::lanes::{InstructionSet, dispatch};
use crate::run::simulation::{Simulation, initial_state};
use crate::run::watch::watched;
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// One simulation of a batch.
#[derive(Clone, Copy, Debug)]
pub struct Member<'a> {
    /// Index of its arm.
    pub arm: usize,
    /// Index of its input.
    pub input: usize,
    /// When it starts, s, on the clock of its input.
    pub start: f64,
    /// Lengths and rates at `start`, 6n; at rest under the pressures and forces of that time if none.
    pub state: Option<&'a [f64]>,
    /// Where what its bellows remember stands at `start`, one number each ([`crate::plant::Plant::moved`]); at rest if none.
    pub moved: Option<&'a [f64]>,
    /// Times of its rows, ascending, from `start` on.
    pub times: &'a [f64],
}

/// What is kept beside the lengths.
#[derive(Clone, Copy, Debug, Default)]
pub struct Channels {
    /// Rates of the lengths.
    pub velocities: bool,
    /// Origins of the heads.
    pub head_positions: bool,
    /// Orientations of the heads.
    pub orientations: bool,
    /// Lengths and heads as the sensors read them, where effects act on sensors, in place of the true ones.
    pub measured: bool,
}

/// The members' rows, one block of `rows` rows a member, NaN where a member has none.
#[derive(Clone, Debug, Default)]
pub struct BatchRows {
    /// Rows a member: those of the member that has most.
    pub rows: usize,
    /// Lengths, 3n a row, m.
    pub lengths: Vec<f64>,
    /// Rates, 3n a row, m/s, or empty.
    pub velocities: Vec<f64>,
    /// Origins of the heads in the world, 3n a row, m, or empty.
    pub head_positions: Vec<f64>,
    /// Orientations of the heads, unit quaternions (w, x, y, z) with w >= 0, 4n a row, or empty.
    pub head_orientations: Vec<f64>,
    /// Why each member ended early, if it did.
    pub failures: Vec<Option<Error>>,
    /// What each member cost.
    pub statistics: Vec<Statistics>,
}

/// A batch to run.
#[derive(Clone, Copy, Debug)]
pub struct Batch<'a> {
    /// Arms, all with the same number of sections.
    pub arms: &'a [Arc<Arm>],
    /// Inputs.
    pub inputs: &'a [Arc<Input>],
    /// The simulations.
    pub members: &'a [Member<'a>],
    /// How to integrate, all of them.
    pub options: Options,
    /// What is kept beside the lengths.
    pub channels: Channels,
    /// Whether members that can share lanes take the steps that the first of them takes alone, all of them: an adaptive
    /// method's choice of steps is then no difference between members. The error is controlled for the first.
    pub shared_steps: bool,
    /// What computes members in lanes; single members where this processor lacks it, and for [`Method::DormandPrince54`]
    /// by name, where every member takes its own steps unless they are shared.
    pub instruction_set: InstructionSet,
}

/// Most blocks that wait for more members.
const MOST_OPEN: usize = 64;
/// Arms that are looked at to choose a method.
const MOST_JUDGED: usize = 16;

impl Batch<'_> {
    /// Runs all members over `threads` threads (0: as many as there are cores).
    ///
    /// `watch` is called on the calling thread about every 50 ms with the number of members done; true stops the batch.
    ///
    /// # Errors
    /// [`Error::Input`] for what does not fit together (nothing has run then), [`Error::Interrupted`] if `watch` said so.
    /// Errors of single members are their status.
    pub fn run(&self, threads: usize, watch: &mut impl FnMut(usize) -> bool) -> Result<BatchRows> {
        let columns = self.check()?;
        let chosen = Batch { options: self.chosen(), ..*self };
        chosen.run_checked(columns, self.options.method == Method::Auto, threads, watch)
    }

    /// The options with a method chosen, the same for all members: differences between them must not be differences
    /// between methods. The implicit one if an arm of the batch is stiff.
    fn chosen(&self) -> Options {
        if self.options.method != Method::Auto {
            return self.options;
        }
        let mut first: Vec<Option<&Member<'_>>> = vec![None; self.arms.len()];
        for member in self.members {
            first[member.arm].get_or_insert(member);
        }
        let first: Vec<_> = first.into_iter().flatten().collect();
        let is_stiff = |m: &&Member<'_>| {
            let (arm, input) = (&self.arms[m.arm], &self.inputs[m.input]);
            let start = m.start - input.origin();
            let state = m.state.map_or_else(|| initial_state(arm, input, start, None, None).ok(), |x| Some(x.to_vec()));
            state.and_then(|x| Fastest::at(arm, input, start, &x)).is_some_and(Fastest::is_stiff)
        };
        let stiff = first.iter().step_by(first.len().div_ceil(MOST_JUDGED).max(1)).any(is_stiff);
        Options { method: if stiff { Method::Rodas4 } else { Method::DormandPrince54 }, ..self.options }
    }

    fn run_checked(
        &self,
        columns: usize,
        free: bool,
        threads: usize,
        watch: &mut impl FnMut(usize) -> bool,
    ) -> Result<BatchRows> {
        let rows = self.members.iter().map(|m| m.times.len()).max().unwrap_or(0);
        let block = rows * columns;
        let nan = |wanted: bool, columns: usize, what: &str| {
            let shape = [if wanted { self.members.len() } else { 0 }, rows, columns];
            filled(what, &shape, f64::NAN)
        };
        let mut out = BatchRows {
            rows,
            lengths: nan(true, columns, "lengths of all members")?,
            velocities: nan(self.channels.velocities, columns, "velocities of all members")?,
            head_positions: nan(self.channels.head_positions, columns, "head positions of all members")?,
            head_orientations: nan(self.channels.orientations, columns / 3 * 4, "head orientations of all members")?,
            failures: vec![None; self.members.len()],
            statistics: vec![Statistics::default(); self.members.len()],
        };
        if self.members.is_empty() {
            return Ok(out);
        }
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|e| Error::Input(format!("threads: {threads}; {e}")))?;
        let (stop, done) = (AtomicBool::new(false), AtomicUsize::new(0));
        let sequences = Sequences::default();
        let blocks = self.blocks(self.slots(&mut out, block), free, &sequences, &stop);
        let work = || {
            pool.install(|| {
                blocks.into_par_iter().with_max_len(1).for_each(|block| {
                    if !stop.load(Ordering::Relaxed) {
                        let count = block.members.len();
                        dispatch(self.instruction_set, block);
                        done.fetch_add(count, Ordering::Relaxed);
                    }
                });
            });
        };
        watched(&stop, work, &mut || watch(done.load(Ordering::Relaxed)));
        if stop.into_inner() { Err(Error::Interrupted) } else { Ok(out) }
    }

    /// Where each member writes.
    fn slots<'b>(&self, out: &'b mut BatchRows, block: usize) -> Vec<Slot<'b>> {
        let size = block.max(1);
        let mut lengths = out.lengths.chunks_mut(size);
        let mut velocities = out.velocities.chunks_mut(size);
        let mut head_positions = out.head_positions.chunks_mut(size);
        let mut head_orientations = out.head_orientations.chunks_mut((block / 3 * 4).max(1));
        let rest = out.failures.iter_mut().zip(&mut out.statistics);
        rest.map(|(failure, statistics)| Slot {
            lengths: lengths.next().unwrap_or_default(),
            velocities: velocities.next().unwrap_or_default(),
            head_positions: head_positions.next().unwrap_or_default(),
            head_orientations: head_orientations.next().unwrap_or_default(),
            failure,
            statistics,
        })
        .collect()
    }

    /// The members in blocks that can share lanes.
    fn blocks<'b>(
        &'b self,
        slots: Vec<Slot<'b>>,
        free: bool,
        sequences: &'b Sequences,
        stop: &'b AtomicBool,
    ) -> Vec<Block<'b, 'b>> {
        let own_steps = self.options.method == Method::DormandPrince54 && !free && !self.shared_steps;
        let usable = !own_steps && self.instruction_set.is_available();
        let width = if usable { self.instruction_set.lanes() } else { 1 };
        let mut full = Vec::new();
        let mut open: Vec<Block<'b, 'b>> = Vec::new();
        for (member, slot) in self.members.iter().zip(slots) {
            let place = open.iter().position(|b| width > 1 && can_share(self, b.members[0].0, member));
            let index = place.unwrap_or_else(|| {
                open.push(Block { batch: self, members: Vec::with_capacity(width), sequences, stop });
                open.len() - 1
            });
            open[index].members.push((member, slot));
            if open[index].members.len() >= width {
                full.push(open.remove(index));
            }
            // Members that nobody joins must not make the search long.
            if open.len() > MOST_OPEN {
                full.push(open.remove(0));
            }
        }
        full.append(&mut open);
        full
    }

    /// A member by itself.
    fn alone(&self, member: &Member<'_>) -> Result<Simulation> {
        let (arm, input) = (self.arms[member.arm].clone(), self.inputs[member.input].clone());
        let halves = member.state.map(|x| x.split_at(x.len() / 2));
        let (q, qd) = (halves.map(|h| h.0), halves.map(|h| h.1));
        let simulation = Simulation::new(arm, input, self.options, member.start, q, qd)?;
        Ok(match member.moved {
            Some(moved) => simulation.moved(moved.to_vec()),
            None => simulation,
        })
    }

    fn run_member(&self, member: &Member<'_>, slot: Slot<'_>, sequences: &Sequences, stop: &AtomicBool) {
        let mut simulation = match self.alone(member) {
            Ok(simulation) => simulation,
            Err(error) => {
                *slot.failure = Some(error);
                return;
            }
        };
        if let Some(ends) = sequences.of(self, member, stop) {
            let start = member.start - self.inputs[member.input].origin();
            simulation = simulation.following(ends.from(start));
        }
        let (rows, result) = simulation.advance(member.times, &mut || stop.load(Ordering::Relaxed));
        let read = |is: Vec<f64>, read: Vec<f64>| if self.channels.measured && !read.is_empty() { read } else { is };
        for (to, from) in [
            (slot.lengths, read(rows.lengths, rows.measured_lengths)),
            (slot.velocities, rows.velocities),
            (slot.head_positions, read(rows.head_positions, rows.measured_head_positions)),
            (slot.head_orientations, read(rows.head_orientations, rows.measured_head_orientations)),
        ] {
            if !to.is_empty() {
                to[..from.len()].copy_from_slice(&from);
            }
        }
        *slot.failure = result.err();
        *slot.statistics = simulation.statistics();
    }

    /// The number of coordinates, all arms', if everything fits together.
    fn check(&self) -> Result<usize> {
        let wrong = |text: String| Err(Error::Input(text));
        let columns = self.arms.first().map_or(0, |a| a.coordinates());
        if let Some(k) = self.arms.iter().position(|a| a.coordinates() != columns) {
            let (found, wanted) = (self.arms[k].body.sections.len(), columns / 3);
            return wrong(format!("arm {k} has {found} sections, arm 0 has {wanted}; a batch needs equal numbers"));
        }
        for (k, m) in self.members.iter().enumerate() {
            let (Some(arm), Some(input)) = (self.arms.get(m.arm), self.inputs.get(m.input)) else {
                let (arms, inputs) = (self.arms.len(), self.inputs.len());
                return wrong(format!(
                    "member {k} wants arm {} of {arms} and input {} of {inputs}, counted from 0",
                    m.arm, m.input
                ));
            };
            let (pressures, forces) = (input.pressure_count(), input.section_force_count());
            if pressures != arm.body.inputs {
                return wrong(format!(
                    "member {k}: its input has {pressures} pressures, its arm {} inputs",
                    arm.body.inputs
                ));
            }
            if forces != 0 && forces != columns {
                return wrong(format!("member {k}: its input has {forces} force channels; 0 or {columns} are allowed"));
            }
            if !m.start.is_finite() {
                return wrong(format!("member {k}: start: {}; a finite time is needed", m.start));
            }
            if let Some(x) = m.state
                && (x.len() != 2 * columns || x.iter().any(|v| !v.is_finite()))
            {
                let wanted = 2 * columns;
                return wrong(format!("member {k}: initial state: {wanted} finite numbers are needed, found {x:?}"));
            }
            if let Some(moved) = m.moved
                && (moved.len() != arm.bellows() || moved.iter().any(|v| !v.is_finite()))
            {
                let wanted = arm.bellows();
                return wrong(format!("member {k}: moved: {wanted} finite numbers are needed, found {moved:?}"));
            }
            // Members mostly share their times, which may be many.
            let again = k > 0 && std::ptr::eq(m.times, self.members[k - 1].times);
            let ordered = again || m.times.windows(2).all(|w| w[0] <= w[1]) && m.times.iter().all(|t| t.is_finite());
            if !ordered || m.times.first().is_some_and(|t| *t < m.start) {
                let start = m.start;
                return wrong(format!("member {k}: output times must be finite, ascend and not lie before {start} s"));
            }
        }
        Ok(columns)
    }
}

impl Slot<'_> {
    /// Whether heads are wanted.
    fn heads(&self) -> bool {
        !(self.head_positions.is_empty() && self.head_orientations.is_empty())
    }

    /// Writes one row: of the state's `n` lengths and `n` rates, and of the heads' poses, if there are any.
    #[inline(always)]
    fn write(&mut self, row: usize, n: usize, state: impl Fn(usize) -> f64, head: impl Fn(usize) -> Option<Pose<f64>>) {
        for (j, to) in self.lengths[row * n..(row + 1) * n].iter_mut().enumerate() {
            *to = state(j);
        }
        if !self.velocities.is_empty() {
            for (j, to) in self.velocities[row * n..(row + 1) * n].iter_mut().enumerate() {
                *to = state(n + j);
            }
        }
        if !self.head_positions.is_empty() {
            for (i, to) in self.head_positions[row * n..(row + 1) * n].chunks_exact_mut(3).enumerate() {
                to.copy_from_slice(&head(i).map_or([f64::NAN; 3], |head| head.position.0));
            }
        }
        if !self.head_orientations.is_empty() {
            let m = n / 3 * 4;
            for (i, to) in self.head_orientations[row * m..(row + 1) * m].chunks_exact_mut(4).enumerate() {
                to.copy_from_slice(&head(i).map_or([f64::NAN; 4], |head| head.quaternion()));
            }
        }
    }
}

/// Where one member's results go.
struct Slot<'a> {
    lengths: &'a mut [f64],
    velocities: &'a mut [f64],
    head_positions: &'a mut [f64],
    head_orientations: &'a mut [f64],
    failure: &'a mut Option<Error>,
    statistics: &'a mut Statistics,
}
