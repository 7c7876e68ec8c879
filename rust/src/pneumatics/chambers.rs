//! The chambers of an arm from step to step: hidden states of the plant.

use super::chamber::{self, Volume};
use super::inputs::{Fill, Place, Read};
use super::lag::lagged;
use super::substep::{Drive, Input};
use super::{LONGEST_STEP, Pneumatics, SUBSTEP};
use crate::body::Body;
use crate::body::parameters::PneumaticsLevel;
use crate::real::{Real, kernel};

/// The pneumatics of an arm under way: hidden states of the plant.
#[derive(Clone, Debug)]
pub struct Chambers<T = f64> {
    /// At the start of the step.
    pub(super) now: Vec<Input<T>>,
    /// At its end.
    pub(super) next: Vec<Input<T>>,
    pub(super) drives: Vec<Drive<T>>,
    /// Contents at the ends of the sub-steps, input by input within each.
    pub(super) nodes: Vec<T>,
    /// Pressures there, with the lengths moving on evenly (`full`).
    pub(super) node_pressures: Vec<T>,
    pub(super) substeps: usize,
    start: f64,
    end: f64,
    /// Volumes at a stage, and the start's rates.
    pub(super) volumes: Vec<Volume<T>>,
    rates: Vec<Volume<T>>,
    /// Pressures on their way, work space.
    passing: Vec<T>,
}

impl<T: Real> Chambers<T> {
    /// Chambers at rest at lengths `q` with pressures `p`, valves closed.
    pub fn new(pneumatics: &Pneumatics<T>, body: &Body<T>, q: &[T], p: &[T]) -> Self {
        let zero = T::zero();
        let mut volumes = vec![Volume::rigid(zero); body.inputs];
        chamber::volumes(body, pneumatics.dead_volume, q, &mut volumes);
        let content = |p: T, v: &Volume<T>| match pneumatics.level {
            PneumaticsLevel::Full => chamber::mass(pneumatics, p, v),
            _ => p,
        };
        let now: Vec<_> = p
            .iter()
            .zip(&volumes)
            .map(|(&p, v)| Input { content: content(p, v), spool: zero, integral: zero })
            .collect();
        let still = Volume::rigid(zero);
        let idle = Drive { reference: zero, reference_rate: zero, volume: still, volume_rate: still };
        // Room for the sub-steps of the longest step, so that nothing is allocated on the way.
        let room = ((LONGEST_STEP / SUBSTEP).ceil() as usize + 2) * body.inputs;
        let mut nodes = Vec::with_capacity(room);
        nodes.extend(now.iter().map(|x| x.content));
        Self {
            next: now.clone(),
            now,
            drives: vec![idle; body.inputs],
            nodes,
            node_pressures: Vec::with_capacity(room),
            substeps: 0,
            start: 0.0,
            end: 0.0,
            rates: volumes.clone(),
            volumes,
            passing: p.to_vec(),
        }
    }

    /// Puts the lanes that `which` says to rest at lengths `q` under pressures `p`.
    pub fn restart(
        &mut self,
        pneumatics: &Pneumatics<T>,
        body: &Body<T>,
        which: impl Fn(usize) -> bool + Copy,
        q: &[T],
        p: &[T],
    ) {
        let fresh = Self::new(pneumatics, body, q, p);
        for (now, new) in self.now.iter_mut().zip(fresh.now) {
            now.content = now.content.replaced(new.content, which);
            now.spool = now.spool.replaced(new.spool, which);
            now.integral = now.integral.replaced(new.integral, which);
        }
        self.next.copy_from_slice(&self.now);
    }

    /// A step of the arm from (`t0`, lengths `q`, rates `qd`) to `t1` begins; `commands` are the commanded pressures at
    /// its start and at its end.
    #[inline(always)]
    pub fn begin_step(
        &mut self,
        pneumatics: &Pneumatics<T>,
        body: &Body<T>,
        times: (f64, f64),
        state: (&[T], &[T]),
        commands: &[Vec<T>; 2],
    ) {
        fill(self, pneumatics, body, times, state, commands);
    }

    #[inline(always)]
    fn fill(
        &mut self,
        pneumatics: &Pneumatics<T>,
        body: &Body<T>,
        (t0, t1): (f64, f64),
        (q, qd): (&[T], &[T]),
        commands: &[Vec<T>; 2],
    ) {
        let h = t1 - t0;
        self.start = t0;
        self.end = t1;
        let lag = pneumatics.level == PneumaticsLevel::Lag;
        if !lag {
            chamber::volumes(body, pneumatics.dead_volume, q, &mut self.volumes);
            chamber::volume_rates(body, (q, qd), &mut self.rates);
        }
        for (j, drive) in self.drives.iter_mut().enumerate() {
            let (from, to) = (commands[0][j], commands[1][j]);
            *drive = Drive {
                reference: from,
                reference_rate: (to - from) * (1.0 / h),
                volume: self.volumes[j],
                volume_rate: self.rates[j],
            };
        }
        self.nodes.clear();
        self.nodes.extend(self.now.iter().map(|x| x.content));
        self.next.copy_from_slice(&self.now);
        if lag {
            self.substeps = 1;
            for (next, drive) in self.next.iter_mut().zip(&self.drives) {
                next.content = lagged(pneumatics, next.content, drive, h);
            }
            return;
        }
        // An even number puts a node on the stages in the middle of a step.
        self.substeps = 2 * ((0.5 * h / SUBSTEP - 1e-9).ceil().max(1.0) as usize);
        let (inputs, count) = (self.now.len(), self.substeps);
        self.nodes.resize((count + 1) * inputs, T::zero());
        self.node_pressures.resize((count + 1) * inputs, T::zero());
        let step = h / count as f64;
        T::side_by_side(inputs, Fill { chambers: self, pneumatics, step });
    }

    /// The acting pressures at time `t` of the step begun last, at lengths `q`, into `out`.
    #[inline(always)]
    pub fn pressures(&mut self, pneumatics: &Pneumatics<T>, body: &Body<T>, t: f64, q: &[T], out: &mut [T]) {
        read(self, pneumatics, body, t, q, out);
    }

    #[inline(always)]
    fn read(&mut self, pneumatics: &Pneumatics<T>, body: &Body<T>, t: f64, q: &[T], out: &mut [T]) {
        let elapsed = (t - self.start).clamp(0.0, self.end - self.start);
        if pneumatics.level == PneumaticsLevel::Lag {
            // From the node, not from `now`: an output may be asked for after the step was committed.
            for ((p, start), drive) in out.iter_mut().zip(&self.nodes).zip(&self.drives) {
                *p = lagged(pneumatics, *start, drive, elapsed);
            }
            return;
        }
        chamber::volumes(body, pneumatics.dead_volume, q, &mut self.volumes);
        if self.substeps == 0 {
            for ((p, content), volume) in out.iter_mut().zip(&self.nodes).zip(&self.volumes) {
                *p = chamber::pressure(pneumatics, *content, volume);
            }
            return;
        }
        let place = elapsed / (self.end - self.start) * self.substeps as f64;
        let k = (place as usize).min(self.substeps - 1);
        let at =
            Place { node: k, time: k as f64 / self.substeps as f64 * (self.end - self.start), on: place - k as f64 };
        T::side_by_side(out.len(), Read { chambers: self, air: pneumatics.air(), at, out });
    }

    /// Pressures at the ends of the sub-steps of the step begun last, as [`Chambers::reference`] has them.
    #[inline(always)]
    pub fn predicted(&mut self, pneumatics: &Pneumatics<T>, mut each: impl FnMut(f64, &[T])) {
        // The lag bends within a step; as many pieces as the chambers have.
        let lag = pneumatics.level == PneumaticsLevel::Lag;
        let h = self.end - self.start;
        let pieces = if lag { (h / SUBSTEP).ceil().max(1.0) as usize } else { self.substeps };
        let inputs = self.drives.len();
        for k in 0..=pieces {
            let elapsed = h * k as f64 / pieces as f64;
            for j in 0..inputs {
                self.passing[j] = if lag {
                    lagged(pneumatics, self.nodes[j], &self.drives[j], elapsed)
                } else {
                    let volume = Volume::rigid(pneumatics.control_volume[j]);
                    chamber::pressure(pneumatics, self.nodes[k * inputs + j], &volume)
                };
            }
            each(self.start + elapsed, &self.passing);
        }
    }

    /// What effects that remember pressures are to see of the chambers, at time `t` of the step begun last and lengths `q`,
    /// into `out`: with `full` the pressures that the air would have in the reference volumes
    /// ([`Pneumatics::control_volume`]), with `lag` the pressures.
    ///
    /// A tube between valve and bellows, or a lazy valve, keeps air from arriving, not the air that has arrived from being
    /// compressed by the bellows: what lags, waits or sticks is the pressure at constant volume, which the arm's motion does
    /// not change while valves are closed. If the pressure itself lagged, so would the spring that trapped air is, and a
    /// spring that lags gives more than it takes.
    pub fn reference(&mut self, pneumatics: &Pneumatics<T>, body: &Body<T>, (t, q): (f64, &[T]), out: &mut [T]) {
        self.pressures(pneumatics, body, t, q, out);
        if pneumatics.level == PneumaticsLevel::Full {
            for ((p, now), volume) in out.iter_mut().zip(&self.volumes).zip(&pneumatics.control_volume) {
                *p = chamber::pressure(pneumatics, chamber::mass(pneumatics, *p, now), &Volume::rigid(*volume));
            }
        }
    }

    /// Takes pressures in the reference volume, in place, to the volumes at lengths `q` (`full`).
    #[inline(always)]
    pub fn released(&mut self, pneumatics: &Pneumatics<T>, body: &Body<T>, q: &[T], p: &mut [T]) {
        chamber::volumes(body, pneumatics.dead_volume, q, &mut self.volumes);
        let (air, one) = (pneumatics.air(), T::one());
        for ((p, volume), reference) in p.iter_mut().zip(&self.volumes).zip(&pneumatics.control_volume) {
            *p = air.pressure_from((*p, one, Volume::rigid(*reference)), (one, *volume));
        }
    }

    /// The step was accepted.
    #[inline(always)]
    pub fn end_step(&mut self) {
        self.now.copy_from_slice(&self.next);
    }

    /// Everything that is remembered from step to step, three numbers an input, onto the end of `out`.
    pub fn save(&self, out: &mut Vec<T>) {
        out.extend(self.now.iter().flat_map(|x| [x.content, x.spool, x.integral]));
    }

    /// Goes on from what [`Chambers::save`] gave, at rest in the sense that no step has begun; returns how many numbers it took.
    pub fn load(&mut self, numbers: &[T]) -> usize {
        for (now, given) in self.now.iter_mut().zip(numbers.chunks_exact(3)) {
            *now = Input { content: given[0], spool: given[1], integral: given[2] };
        }
        self.next.copy_from_slice(&self.now);
        self.nodes.clear();
        self.nodes.extend(self.now.iter().map(|x| x.content));
        (self.substeps, self.start, self.end) = (0, 0.0, 0.0);
        3 * self.now.len()
    }

    /// Masses of air (`full`) at the end of the last accepted step, kg.
    pub fn masses(&self) -> impl Iterator<Item = T> + '_ {
        self.now.iter().map(|x| x.content)
    }
}

kernel! {
    fn fill<'a, T>(
        chambers: &'a mut Chambers<T>,
        pneumatics: &'a Pneumatics<T>, body: &'a Body<T>,
        times: (f64, f64),
        state: (&'a [T], &'a [T]),
        commands: &'a [Vec<T>; 2],
    ) {
        chambers.fill(pneumatics, body, times, state, commands);
    }
}

kernel! {
    fn read<'a, T>(chambers: &'a mut Chambers<T>, pneumatics: &'a Pneumatics<T>, body: &'a Body<T>, t: f64, q: &'a [T], out: &'a mut [T]) {
        chambers.read(pneumatics, body, t, q, out);
    }
}
