//! Many steppers abreast: one arm, held pressures, in the lanes of the processor and over its cores.
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

use crate::arm::Arm;
use crate::effects::poses;
use crate::effects::pressures::PressureChain;
use crate::effects::upstream::History;
use crate::error::{Error, Result};
use crate::integrate::{Integrator, Options, System};
use crate::kinematics::chain::{Link, Motion, pass};
use crate::memory::reserved;
use crate::plant::input::{Input, Interpolation};
use crate::plant::{Memory, Plant};
use crate::real::lanes::{AnyLanes, InstructionSet, dispatch};
use crate::real::{Kernel, Real, all_finite};
use crate::run::stepping::{Plan, Stepping};
use crate::run::watch::watched_in;
use rayon::prelude::*;
use std::fmt::Debug;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Most environments of a fleet.
const MOST: usize = 1 << 20;
/// Numbers that an environment keeps, by numbers in its row: state, stages, parked state, work space of the dynamics. Counted
/// generously; only to refuse what cannot fit before it is begun.
const NUMBERS: usize = 64;

/// Environments of one arm.
pub struct Fleet {
    blocks: Vec<Box<dyn Abreast>>,
    lanes: usize,
    count: usize,
    width: usize,
    inputs: usize,
    coordinates: usize,
    workers: Option<Workers>,
}

/// Threads of this process. A child that was forked has none of them: it makes its own.
struct Workers {
    pool: Option<rayon::ThreadPool>,
    threads: usize,
    process: u32,
}

impl Workers {
    fn new(threads: usize) -> Result<Self> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|e| Error::Input(format!("threads: {threads}; {e}")))?;
        Ok(Self { pool: Some(pool), threads, process: std::process::id() })
    }

    /// Those of this process.
    fn here(&mut self) -> Result<&rayon::ThreadPool> {
        if self.process != std::process::id() {
            *self = Self::new(self.threads)?;
        }
        self.pool.as_ref().ok_or_else(|| Error::Input("threads: there are none".to_owned()))
    }
}

impl Drop for Workers {
    fn drop(&mut self) {
        // Threads of another process cannot be told to end, and asking them might wait for ever.
        if self.process != std::process::id() {
            std::mem::forget(self.pool.take());
        }
    }
}

/// Where an environment begins.
#[derive(Clone, Copy, Debug)]
pub struct Start<'a> {
    /// Lengths, m.
    pub q: &'a [f64],
    /// Pressures in the chambers and commanded, Pa absolute.
    pub p: &'a [f64],
}

/// Environments in the lanes of one scalar.
trait Abreast: Send + Debug {
    /// Puts lane `lane` at a start, at rest there and then.
    fn reset(&mut self, lane: usize, start: Start<'_>);
    /// Holds the pressures `p`, row by row, for `dt` s; sets `failed` for lanes that diverged and are back at their start.
    /// `stop` is asked now and then; where it says so, the step ends early and the answer is false.
    fn step(&mut self, p: &[f64], dt: f64, failed: &mut [bool], stop: &mut dyn FnMut() -> bool) -> bool;
    /// Rows of (measured lengths, rates, chamber pressures, tip) into `out`.
    fn read(&mut self, out: &mut [f64]);
    /// Numbers in a row of [`Abreast::save`].
    fn size(&self) -> usize;
    /// Times of the states that delayed sensors remember, s, the same for all lanes, and how long the last step was.
    fn times(&self) -> (Vec<f64>, f64);
    /// What decides what comes next, a row a lane.
    fn save(&self, out: &mut [f64]);
    /// Goes on from what [`Abreast::save`] and [`Abreast::times`] gave.
    fn load(&mut self, rows: &[f64], times: &[f64], elapsed: f64) -> Result<()>;
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
        if PressureChain::new(&arm.effects, arm.body.inputs, &mut History::new(0.0, start.p), 0.0).is_some() {
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

/// Blocks that are not worth a thread of their own.
const LEAST_BLOCKS: usize = 8;
/// Blocks that share one arm, which then stays in the processor's caches.
struct Build<'a> {
    count: usize,
    arm: &'a Arc<Arm>,
    none: &'a Arc<Input>,
    start: Start<'a>,
    stepping: Stepping,
    step: f64,
}

impl AnyLanes for Build<'_> {
    type Output = Vec<Box<dyn Abreast>>;
    fn with<T: Real>(self) -> Self::Output {
        let arm = Arc::new(self.arm.lift::<T>());
        let constant = |x: &[f64]| x.iter().map(|&x| T::from_f64(x)).collect::<Vec<T>>();
        let (q, p) = (constant(self.start.q), constant(self.start.p));
        let mut x = q.clone();
        x.resize(2 * q.len(), T::zero());
        let mut plant = Plant::new(arm.clone(), self.none.clone());
        plant.hold(&p);
        let mut plant = plant.with_pneumatics(0.0, &q);
        plant.begin(0.0, &x);
        let options = plant.suited(Options { method: self.stepping.method(), step: self.step, ..Options::default() });
        let block = Block {
            integrator: Integrator::new(options, 0.0, &x),
            guard: Guard { plant, parked: x.clone(), failed: false },
            links: vec![Link::base(); arm.body.sections.len()],
            lengths: q,
            chambers: p.clone(),
            starts: p.clone(),
            commands: p,
            euler: (self.stepping == Stepping::SymplecticEuler).then_some(options.step),
            derivative: x,
            arm,
        };
        (0..self.count).map(|_| -> Box<dyn Abreast> { Box::new(block.clone()) }).collect()
    }
}

#[derive(Clone, Debug)]
struct Block<T> {
    arm: Arc<Arm<T>>,
    guard: Guard<T>,
    integrator: Integrator<T>,
    links: Vec<Link<T>>,
    /// As their sensors have them.
    lengths: Vec<T>,
    /// Chamber pressures, those at the start, and commands.
    chambers: Vec<T>,
    starts: Vec<T>,
    commands: Vec<T>,
    /// Longest step of the symplectic Euler method, if it is that, and its work space.
    euler: Option<f64>,
    derivative: Vec<T>,
}

/// A plant whose steps are always accepted: lanes that diverge are put back to their start.
#[derive(Clone, Debug)]
struct Guard<T> {
    plant: Plant<T>,
    parked: Vec<T>,
    failed: bool,
}

impl<T: Real> System<T> for Guard<T> {
    #[inline(always)]
    fn begin_step(&mut self, t0: f64, t1: f64, x0: &[T]) {
        self.plant.begin_step(t0, t1, x0);
    }
    #[inline(always)]
    fn derivative(&mut self, t: f64, x: &[T], dx: &mut [T]) {
        self.plant.derivative(t, x, dx);
    }
    #[inline(always)]
    fn end_step(&mut self, t1: f64, x1: &[T]) {
        self.plant.end_step(t1, x1);
    }
    #[inline(always)]
    fn inspect(&mut self, _t0: f64, x1: &mut [T]) -> Option<String> {
        // The rest of the step of a lane that failed is of no use to anyone; it only must stay finite.
        if !all_finite(x1) || self.plant.objection(x1).is_some() {
            self.failed = true;
        }
        None
    }
}

/// One step of a block as a kernel.
struct Step<'a, T> {
    guard: &'a mut Guard<T>,
    integrator: &'a mut Integrator<T>,
    dt: f64,
    euler: Option<f64>,
    derivative: &'a mut [T],
    stop: &'a mut dyn FnMut() -> bool,
}

impl<T: Real> Kernel for Step<'_, T> {
    /// Whether the step was taken to its end.
    type Output = bool;
    #[inline(always)]
    fn run(self) -> bool {
        // Every step begins at time 0, so that its rounding does not depend on how long the others have been going.
        if let Some(step) = self.euler {
            self.integrator.set_time(self.dt);
            let x = self.integrator.state_mut();
            return symplectic_euler(self.guard, x, self.derivative, (self.dt, step), self.stop);
        }
        self.integrator.set_time(0.0);
        // Nothing is refused (see Guard), and a fixed step has no other way to fail than to be stopped.
        self.integrator.run(self.guard, &[self.dt], &mut |_, _| {}, &mut || (self.stop)()).is_ok()
    }
}

/// Steps between two questions whether to stop.
const POLL: usize = 512;

/// Takes (q, q') in `x` over `dt` in equal steps of at most `step`, from time 0; false if `stop` said so before.
#[inline(always)]
fn symplectic_euler<T: Real>(
    guard: &mut Guard<T>,
    x: &mut [T],
    derivative: &mut [T],
    (dt, step): (f64, f64),
    stop: &mut dyn FnMut() -> bool,
) -> bool {
    let m = x.len() / 2;
    let count = (dt / step - 1e-9).ceil().max(1.0);
    let h = dt / count;
    for k in 0..count as usize {
        let (t0, t1) = (k as f64 * h, (k + 1) as f64 * h);
        guard.begin_step(t0, t1, x);
        guard.derivative(t0, x, derivative);
        for i in 0..m {
            x[m + i] += derivative[m + i] * h;
            let rate = x[m + i];
            x[i] += rate * h;
        }
        // Never refuses (see Guard).
        let _ = guard.inspect(t0, x);
        guard.end_step(t1, x);
        if k % POLL == POLL - 1 && stop() {
            return false;
        }
    }
    true
}

/// Puts `new` into the lanes of `x` that `which` says.
fn put<T: Real>(which: impl Fn(usize) -> bool, new: &[T], x: &mut [T]) {
    for (x, n) in x.iter_mut().zip(new) {
        *x = T::from_lanes(|k| if which(k) { n.lane(k) } else { x.lane(k) });
    }
}

impl<T: Real> Block<T> {
    /// Puts lanes back to their start; the others go on.
    fn restart(&mut self, which: impl Fn(usize) -> bool + Copy) {
        put(which, &self.starts, &mut self.commands);
        put(which, &self.starts, &mut self.chambers);
        put(which, &self.guard.parked, self.integrator.state_mut());
        self.guard.plant.restart(which, self.integrator.state(), &self.commands);
        self.measure();
    }

    /// Lengths as their sensors have them now.
    fn measure(&mut self) {
        let (t, x) = (self.integrator.time(), self.integrator.state());
        self.guard.plant.measured_lengths_into(t, x, &mut self.lengths);
    }
}

impl<T: Real> Abreast for Block<T> {
    fn reset(&mut self, lane: usize, start: Start<'_>) {
        let m = start.q.len();
        for (k, x) in self.guard.parked.iter_mut().enumerate() {
            let value = if k < m { start.q[k] } else { 0.0 };
            *x = T::from_lanes(|j| if j == lane { value } else { x.lane(j) });
        }
        for (p, value) in self.starts.iter_mut().zip(start.p) {
            *p = T::from_lanes(|j| if j == lane { *value } else { p.lane(j) });
        }
        self.restart(|k| k == lane);
    }

    fn step(&mut self, p: &[f64], dt: f64, failed: &mut [bool], stop: &mut dyn FnMut() -> bool) -> bool {
        let (inputs, used) = (self.commands.len(), failed.len());
        for (j, command) in self.commands.iter_mut().enumerate() {
            *command = T::from_lanes(|k| p[k.min(used - 1) * inputs + j]);
        }
        self.guard.plant.hold(&self.commands);
        self.guard.plant.rewind(self.integrator.time());
        let (guard, integrator, derivative) = (&mut self.guard, &mut self.integrator, &mut self.derivative);
        if !T::enter(Step { guard, integrator, dt, euler: self.euler, derivative, stop }) {
            return false;
        }
        let x = self.integrator.state();
        self.guard.plant.chamber_pressures.clear();
        self.guard.plant.chamber_pressures_into(self.integrator.time(), &x[..x.len() / 2], &mut self.chambers);
        if self.guard.failed {
            self.guard.failed = false;
            self.find(failed);
        }
        self.measure();
        true
    }

    fn read(&mut self, out: &mut [f64]) {
        let x = self.integrator.state();
        let m = self.arm.coordinates();
        pass(&self.arm.body, &x[..m], &[], Motion::Pose, &mut self.links);
        let mut tip = self.links[self.links.len() - 1].position;
        if poses::acts(&self.arm.effects) {
            poses::heads(&self.arm.body, &self.arm.effects, &self.links, |head| tip = head.position);
        }
        let width = 2 * m + self.chambers.len() + 3;
        for (k, row) in out.chunks_exact_mut(width).enumerate() {
            let values = self.lengths.iter().chain(&x[m..]).chain(&self.chambers).chain(&tip.0);
            row.iter_mut().zip(values).for_each(|(out, value)| *out = value.lane(k));
        }
    }

    fn size(&self) -> usize {
        let memory = self.guard.plant.memory();
        self.own().map(<[T]>::len).iter().sum::<usize>() + memory.numbers.len() + memory.states.len()
    }

    fn times(&self) -> (Vec<f64>, f64) {
        (self.guard.plant.memory().sensors, self.integrator.time())
    }

    fn save(&self, out: &mut [f64]) {
        let memory = self.guard.plant.memory();
        let size = self.size();
        for (k, row) in out.chunks_exact_mut(size).enumerate() {
            let values = self.own().into_iter().flatten().chain(&memory.numbers).chain(&memory.states);
            row.iter_mut().zip(values).for_each(|(out, value)| *out = value.lane(k));
        }
    }

    fn load(&mut self, rows: &[f64], times: &[f64], elapsed: f64) -> Result<()> {
        let before = self.guard.plant.memory();
        let sizes = self.own().map(<[T]>::len);
        let size = sizes.iter().sum::<usize>() + before.numbers.len() + times.len() * 2 * self.arm.coordinates();
        let used = rows.len() / size;
        // Lanes that are left over do what the last one does.
        let all: Vec<T> = (0..size).map(|i| T::from_lanes(|k| rows[k.min(used - 1) * size + i])).collect();
        let mut rest = all.as_slice();
        let mut take = |count: usize| {
            let (piece, after) = rest.split_at(count);
            rest = after;
            piece
        };
        self.integrator.state_mut().copy_from_slice(take(sizes[0]));
        self.guard.parked.copy_from_slice(take(sizes[1]));
        for (own, size) in
            [&mut self.starts, &mut self.commands, &mut self.chambers, &mut self.lengths].into_iter().zip(&sizes[2..])
        {
            own.copy_from_slice(take(*size));
        }
        let numbers = take(before.numbers.len()).to_vec();
        let memory = Memory { numbers, sensors: times.to_vec(), states: rest.to_vec(), ..Memory::default() };
        self.integrator.set_time(elapsed);
        self.guard.plant.hold(&self.commands);
        self.guard.plant.resume(elapsed, &memory)
    }
}

impl<T: Real> Block<T> {
    /// What decides what comes next beside the plant's memory.
    fn own(&self) -> [&[T]; 6] {
        let x = self.integrator.state();
        [x, &self.guard.parked, &self.starts, &self.commands, &self.chambers, &self.lengths]
    }
}

impl<T: Real> Block<T> {
    /// Finds the lanes that diverged and puts them back.
    #[cold]
    fn find(&mut self, failed: &mut [bool]) {
        let x = self.integrator.state();
        let alone = |k: usize| -> Vec<T> {
            x.iter()
                .zip(&self.guard.parked)
                .map(|(x, p)| T::from_lanes(|j| if j == k { x.lane(k) } else { p.lane(j) }))
                .collect()
        };
        let bad: Vec<bool> = (0..T::LANES)
            .map(|k| {
                let finite = x.iter().all(|x| x.lane(k).is_finite());
                !finite || self.guard.plant.objection(&alone(k)).is_some()
            })
            .collect();
        for (failed, bad) in failed.iter_mut().zip(&bad) {
            *failed = *bad;
        }
        if bad.iter().any(|b| *b) {
            self.restart(|k| bad[k]);
        }
    }
}
