//! Environments of a fleet in the lanes of one scalar.

use super::Start;
use crate::arm::Arm;
use crate::effects::poses;
use crate::error::Result;
use crate::integrate::{Integrator, Options, System};
use crate::kinematics::chain::pass;
use crate::kinematics::link::{Link, Motion};
use crate::plant::input::Input;
use crate::plant::{Memory, Plant};
use crate::real::lanes::AnyLanes;
use crate::real::{Kernel, Real, replace};
use crate::run::parking::Parking;
use crate::run::stepping::Stepping;
use std::fmt::Debug;
use std::sync::Arc;

/// Environments in the lanes of one scalar.
pub trait Environments: Send + Debug {
    /// Puts lane `lane` at a start, at rest there and then.
    fn reset(&mut self, lane: usize, start: Start<'_>);
    /// Holds the pressures `p`, row by row, for `dt` s; sets `failed` for lanes that diverged and are back at their start.
    /// `stop` is asked now and then; where it says so, the step ends early and the answer is false.
    fn step(&mut self, p: &[f64], dt: f64, failed: &mut [bool], stop: &mut dyn FnMut() -> bool) -> bool;
    /// Rows of (measured lengths, rates, chamber pressures, tip) into `out`.
    fn read(&mut self, out: &mut [f64]);
    /// Numbers in a row of [`Environments::save`].
    fn size(&self) -> usize;
    /// Times of the states that delayed sensors remember, s, the same for all lanes, and how long the last step was.
    fn times(&self) -> (Vec<f64>, f64);
    /// What decides what comes next, a row a lane.
    fn save(&self, out: &mut [f64]);
    /// Goes on from what [`Environments::save`] and [`Environments::times`] gave.
    fn load(&mut self, rows: &[f64], times: &[f64], elapsed: f64) -> Result<()>;
}

/// Blocks that share one arm, which then stays in the processor's caches.
pub struct Build<'a> {
    /// How many.
    pub count: usize,
    /// The arm.
    pub arm: &'a Arc<Arm>,
    /// An input without forces.
    pub none: &'a Arc<Input>,
    /// Where all begin.
    pub start: Start<'a>,
    /// Method.
    pub stepping: Stepping,
    /// Longest step, s.
    pub step: f64,
}

impl AnyLanes for Build<'_> {
    type Output = Vec<Box<dyn Environments>>;
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
            parking: Parking::new(plant, x.clone(), vec![0.0; T::LANES]).going_on(),
            links: vec![Link::base(); arm.body.sections.len()],
            lengths: q,
            chambers: p.clone(),
            starts: p.clone(),
            commands: p,
            euler: (self.stepping == Stepping::SymplecticEuler).then_some(options.step),
            derivative: x,
            arm,
        };
        (0..self.count).map(|_| -> Box<dyn Environments> { Box::new(block.clone()) }).collect()
    }
}

#[derive(Clone, Debug)]
struct Block<T> {
    arm: Arc<Arm<T>>,
    parking: Parking<T>,
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

/// One step of a block as a kernel.
struct Step<'a, T> {
    parking: &'a mut Parking<T>,
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
            return symplectic_euler(self.parking, x, self.derivative, (self.dt, step), self.stop);
        }
        self.integrator.set_time(0.0);
        // Nothing is refused (see [`Parking::going_on`]), and a fixed step has no other way to fail than to be stopped.
        self.integrator.run(self.parking, &[self.dt], &mut |_, _| {}, &mut || (self.stop)()).is_ok()
    }
}

/// Steps between two questions whether to stop.
const POLL: usize = 512;

/// Takes (q, q') in `x` over `dt` in equal steps of at most `step`, from time 0; false if `stop` said so before.
#[inline(always)]
fn symplectic_euler<T: Real>(
    parking: &mut Parking<T>,
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
        parking.begin_step(t0, t1, x);
        parking.derivative(t0, x, derivative);
        for i in 0..m {
            x[m + i] += derivative[m + i] * h;
            let rate = x[m + i];
            x[i] += rate * h;
        }
        // Never refuses (see [`Parking::going_on`]).
        let _ = parking.inspect(t0, x);
        parking.end_step(t1, x);
        if k % POLL == POLL - 1 && stop() {
            return false;
        }
    }
    true
}

impl<T: Real> Block<T> {
    /// Puts lanes back to their start; the others go on.
    fn restart(&mut self, which: impl Fn(usize) -> bool + Copy) {
        replace(&mut self.commands, &self.starts, which);
        replace(&mut self.chambers, &self.starts, which);
        replace(self.integrator.state_mut(), &self.parking.parked, which);
        self.parking.plant.restart(which, self.integrator.state(), &self.commands);
        self.measure();
    }

    /// Lengths as their sensors have them now.
    fn measure(&mut self) {
        let (t, x) = (self.integrator.time(), self.integrator.state());
        self.parking.plant.measured_lengths_into(t, x, &mut self.lengths);
    }
}

impl<T: Real> Environments for Block<T> {
    fn reset(&mut self, lane: usize, start: Start<'_>) {
        let m = start.q.len();
        for (k, x) in self.parking.parked.iter_mut().enumerate() {
            let value = if k < m { start.q[k] } else { 0.0 };
            *x = x.replaced(T::from_f64(value), |j| j == lane);
        }
        for (p, value) in self.starts.iter_mut().zip(start.p) {
            *p = p.replaced(T::from_f64(*value), |j| j == lane);
        }
        self.restart(|k| k == lane);
    }

    fn step(&mut self, p: &[f64], dt: f64, failed: &mut [bool], stop: &mut dyn FnMut() -> bool) -> bool {
        let (inputs, used) = (self.commands.len(), failed.len());
        for (j, command) in self.commands.iter_mut().enumerate() {
            *command = T::from_lanes(|k| p[k.min(used - 1) * inputs + j]);
        }
        self.parking.plant.hold(&self.commands);
        self.parking.plant.rewind(self.integrator.time());
        let (parking, integrator, derivative) = (&mut self.parking, &mut self.integrator, &mut self.derivative);
        if !T::enter(Step { parking, integrator, dt, euler: self.euler, derivative, stop }) {
            return false;
        }
        let x = self.integrator.state();
        self.parking.plant.chamber_pressures.clear();
        self.parking.plant.chamber_pressures_into(self.integrator.time(), &x[..x.len() / 2], &mut self.chambers);
        if self.parking.any() {
            self.put_back(failed);
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
        let memory = self.parking.plant.memory();
        self.own().map(<[T]>::len).iter().sum::<usize>() + memory.numbers.len() + memory.states.len()
    }

    fn times(&self) -> (Vec<f64>, f64) {
        (self.parking.plant.memory().sensors, self.integrator.time())
    }

    fn save(&self, out: &mut [f64]) {
        let memory = self.parking.plant.memory();
        let size = self.size();
        for (k, row) in out.chunks_exact_mut(size).enumerate() {
            let values = self.own().into_iter().flatten().chain(&memory.numbers).chain(&memory.states);
            row.iter_mut().zip(values).for_each(|(out, value)| *out = value.lane(k));
        }
    }

    fn load(&mut self, rows: &[f64], times: &[f64], elapsed: f64) -> Result<()> {
        let before = self.parking.plant.memory();
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
        self.parking.parked.copy_from_slice(take(sizes[1]));
        for (own, size) in
            [&mut self.starts, &mut self.commands, &mut self.chambers, &mut self.lengths].into_iter().zip(&sizes[2..])
        {
            own.copy_from_slice(take(*size));
        }
        let numbers = take(before.numbers.len()).to_vec();
        let memory = Memory { numbers, sensors: times.to_vec(), states: rest.to_vec(), ..Memory::default() };
        self.integrator.set_time(elapsed);
        self.parking.plant.hold(&self.commands);
        self.parking.plant.resume(elapsed, &memory)
    }
}

impl<T: Real> Block<T> {
    /// What decides what comes next beside the plant's memory.
    fn own(&self) -> [&[T]; 6] {
        let x = self.integrator.state();
        [x, &self.parking.parked, &self.starts, &self.commands, &self.chambers, &self.lengths]
    }
}

impl<T: Real> Block<T> {
    /// Puts lanes that diverged back to their start and says which ones.
    #[cold]
    fn put_back(&mut self, failed: &mut [bool]) {
        let bad: Vec<bool> = self.parking.failures().iter().map(Option::is_some).collect();
        for (failed, bad) in failed.iter_mut().zip(&bad) {
            *failed = *bad;
        }
        self.parking.release();
        self.restart(|k| bad[k]);
    }
}
