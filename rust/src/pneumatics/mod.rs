//! From commanded to acting pressure: valve, spool, chamber and pressure controller of every input.
//!
//! Three levels: `ideal` (the command acts), `lag` (first order, own time constants for filling and venting), `full`
//! (valve by ISO 6358, spool, polytropic chamber with the arm's own volumes, PI controller; see `valve`, `chamber`,
//! `controller`).
//!
//! Stiffer than the arm, so not integrated with it: hidden states of the plant ([`crate::integrate::System`]). When a step
//! of the arm begins, masses, spools and integrals are advanced over it in sub-steps of at most [`SUBSTEP`] with the
//! lengths moving on evenly; at each stage of the arm's method the pressure is that of the mass at that time in the stage's own
//! volume, so that trapped air acts as the spring it is, without delay. The coupling is of second order in the step.
//! Sub-steps: ROS2 (Verwer, Spee, Blom & Hundsdorfer, SIAM J. Sci. Comput. 20 (1999) 1456), linearly implicit, L-stable, of second
//! order whatever stands for the Jacobian; here that of mass and spool without the integral, two equations (`substep`). The
//! lag is advanced exactly. One arm's inputs are advanced abreast in the processor's lanes (`abreast`).

mod abreast;
pub mod chamber;
pub mod controller;
mod substep;
pub mod valve;

use crate::body::Body;
use crate::body::parameters::{PneumaticsLevel, PneumaticsParameters};
use crate::error::{Error, Result};
use crate::real::{Real, kernel};
use std::any::Any;
use substep::substep;

/// Longest sub-step, s.
pub const SUBSTEP: f64 = 2.5e-4;
/// Longest step of the arm with pneumatics that are not ideal, s; adaptive methods need none with a lag.
pub const LONGEST_STEP: f64 = 2e-3;

/// What the valves, chambers and pressure controllers of an arm are; the same for every input.
#[derive(Clone, Debug)]
pub struct Pneumatics<T> {
    /// How much is modelled.
    pub level: PneumaticsLevel,
    /// Time constant of filling, s (`lag`).
    pub fill_time: T,
    /// Time constant of venting, s (`lag`).
    pub vent_time: T,
    /// Absolute supply pressure, Pa.
    pub supply_pressure: T,
    /// Absolute pressure behind the exhaust, Pa.
    pub exhaust_pressure: T,
    /// Absolute pressure of the vacuum, Pa.
    pub vacuum_pressure: T,
    /// Whether there is a vacuum.
    pub has_vacuum: bool,
    /// Choked flow from the supply at full opening, [`valve::choked_flow`], kg/(s Pa).
    pub supply_flow: T,
    /// The same towards exhaust and vacuum.
    pub exhaust_flow: T,
    /// The valve's subsonic characteristic.
    pub flow_function: valve::FlowFunction<T>,
    /// Ambient pressure, Pa.
    pub ambient_pressure: T,
    /// Density of ambient air, kg/m^3.
    pub ambient_density: T,
    /// Mass for a pascal in a cubic metre of ambient air, polytropically: m' = `compliance` V p' at constant volume.
    pub compliance: T,
    /// Volume of an input besides its bellows, m^3.
    pub dead_volume: T,
    /// Polytropic exponent.
    pub exponent: T,
    /// One over the time constant of the spool, 1/s.
    pub spool_rate: T,
    /// Spool travel without flow, as a part of its full travel.
    pub dead_band: T,
    /// Full travel over the travel with flow, 1 / (1 - dead band).
    pub inverse_travel: T,
    /// Gain on the pressure error, 1/s.
    pub proportional_gain: T,
    /// Gain on its integral, 1/s^2.
    pub integral_gain: T,
    /// Part of the reference's rate that is fed forward.
    pub feed_forward: T,
    /// Volume of each input with all its bellows at the middle of their range, m^3: what the controllers reckon with.
    pub control_volume: Vec<T>,
}

impl Pneumatics<f64> {
    /// What `p` says. `middle_volumes`: volume of the bellows of each input at the middle of their range.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a key that the level needs and the table lacks, or a value out of range.
    pub fn new(p: &PneumaticsParameters, ambient_pressure: f64, middle_volumes: &[f64]) -> Result<Self> {
        let lag = p.level == PneumaticsLevel::Lag;
        let full = p.level == PneumaticsLevel::Full;
        let get = |key, value: Option<f64>, needed: bool, ok: fn(f64) -> bool, allowed| match value {
            Some(x) if x.is_finite() && ok(x) => Ok(x),
            None if !needed => Ok(1.0),
            found => {
                let found = found.map_or("missing".to_owned(), |x| x.to_string());
                Err(Error::Parameter { place: "pneumatics".to_owned(), key, found, allowed })
            }
        };
        let positive = |key, x, needed| get(key, x, needed, |x| x > 0.0, "a positive number is needed");
        let not_negative = |key, x, needed| get(key, x, needed, |x| x >= 0.0, "a number not below zero is needed");
        let below_one = "a number from 0 to below 1 is needed";
        let supply_conductance = positive("sonic_conductance", p.sonic_conductance, full)?;
        let exhaust_conductance = match p.exhaust_conductance {
            None => supply_conductance,
            given => positive("exhaust_conductance", given, full)?,
        };
        let dead_volume = not_negative("dead_volume", p.dead_volume, full)?;
        let temperature = positive("air_temperature", p.air_temperature, full)?;
        let ambient_pressure = if full {
            get(
                "ambient_pressure",
                Some(ambient_pressure),
                true,
                |x| x > 0.0,
                "compressed air needs an ambient pressure above zero",
            )?
        } else {
            ambient_pressure
        };
        let exponent = positive("polytropic_exponent", p.polytropic_exponent, full)?;
        let ambient_density = ambient_pressure / (temperature * chamber::GAS_CONSTANT);
        // Levels without a valve need not have these two; zero is within their range.
        let critical_ratio = match p.critical_pressure_ratio {
            None if !full => 0.0,
            given => {
                get("critical_pressure_ratio", given, full, |x| (0.0..valve::LAMINAR_RATIO).contains(&x), below_one)?
            }
        };
        let dead_band = match p.spool_dead_band {
            None if !full => 0.0,
            given => get("spool_dead_band", given, full, |x| (0.0..1.0).contains(&x), below_one)?,
        };
        Ok(Self {
            level: p.level,
            fill_time: positive("fill_time", p.fill_time, lag)?,
            vent_time: positive("vent_time", p.vent_time, lag)?,
            supply_pressure: positive("supply_pressure", p.supply_pressure, full)?,
            exhaust_pressure: positive("exhaust_pressure", p.exhaust_pressure, full)?,
            vacuum_pressure: positive("vacuum_pressure", p.vacuum_pressure, false)?,
            has_vacuum: p.vacuum_pressure.is_some(),
            supply_flow: valve::choked_flow(supply_conductance, temperature),
            exhaust_flow: valve::choked_flow(exhaust_conductance, temperature),
            flow_function: valve::FlowFunction::new(critical_ratio),
            ambient_pressure,
            ambient_density,
            compliance: ambient_density / (exponent * ambient_pressure),
            dead_volume,
            exponent,
            spool_rate: positive("spool_time", p.spool_time, full)?.recip(),
            dead_band,
            inverse_travel: (1.0 - dead_band).recip(),
            proportional_gain: not_negative("proportional_gain", p.proportional_gain, full)?,
            integral_gain: not_negative("integral_gain", p.integral_gain, full)?,
            feed_forward: not_negative("feed_forward", p.feed_forward, full)?,
            control_volume: middle_volumes.iter().map(|v| v + dead_volume).collect(),
        })
    }

    /// The same over another scalar, number by number.
    pub fn map<T: Real>(&self, c: impl Fn(f64) -> T + Copy) -> Pneumatics<T> {
        Pneumatics { control_volume: self.control_volume.iter().map(|&v| c(v)).collect(), ..self.shared(c) }
    }

    /// The same without what differs from input to input, [`Pneumatics::control_volume`]; nothing is allocated.
    #[inline(always)]
    fn shared<T: Real>(&self, c: impl Fn(f64) -> T + Copy) -> Pneumatics<T> {
        Pneumatics {
            level: self.level,
            fill_time: c(self.fill_time),
            vent_time: c(self.vent_time),
            supply_pressure: c(self.supply_pressure),
            exhaust_pressure: c(self.exhaust_pressure),
            vacuum_pressure: c(self.vacuum_pressure),
            has_vacuum: self.has_vacuum,
            supply_flow: c(self.supply_flow),
            exhaust_flow: c(self.exhaust_flow),
            flow_function: self.flow_function.map(c),
            ambient_pressure: c(self.ambient_pressure),
            ambient_density: c(self.ambient_density),
            compliance: c(self.compliance),
            dead_volume: c(self.dead_volume),
            exponent: c(self.exponent),
            spool_rate: c(self.spool_rate),
            dead_band: c(self.dead_band),
            inverse_travel: c(self.inverse_travel),
            proportional_gain: c(self.proportional_gain),
            integral_gain: c(self.integral_gain),
            feed_forward: c(self.feed_forward),
            control_volume: Vec::new(),
        }
    }
}

/// State of one input's pneumatics.
#[derive(Clone, Copy, Debug)]
struct Input<T> {
    /// `full`: mass of air, kg. `lag`: pressure, Pa.
    content: T,
    /// Spool position.
    spool: T,
    /// Integral of the controller, Pa/s.
    integral: T,
}

/// What drives an input over a step: straight lines from its start.
#[derive(Clone, Copy, Debug)]
struct Drive<T> {
    reference: T,
    reference_rate: T,
    volume: T,
    volume_rate: T,
}

/// A moment within a step of the arm.
#[derive(Clone, Copy, Debug)]
struct Place {
    /// The node before it.
    node: usize,
    /// That node's time from the start of the step, s.
    time: f64,
    /// How far it is on the way to the next node, 0 to 1.
    on: f64,
}

/// The pneumatics of an arm under way: hidden states of the plant.
#[derive(Clone, Debug)]
pub struct Chambers<T = f64> {
    /// At the start of the step.
    now: Vec<Input<T>>,
    /// At its end.
    next: Vec<Input<T>>,
    drives: Vec<Drive<T>>,
    /// Contents at the ends of the sub-steps, input by input within each.
    nodes: Vec<T>,
    /// Pressures there, with the lengths moving on evenly (`full`).
    node_pressures: Vec<T>,
    /// Pressures read last, where inputs are advanced abreast.
    acting: Vec<T>,
    substeps: usize,
    start: f64,
    end: f64,
    /// Volumes at a stage, and the start's rates.
    volumes: Vec<T>,
    rates: Vec<T>,
}

impl<T: Real> Chambers<T> {
    /// Chambers at rest at lengths `q` with pressures `p`, valves closed.
    pub fn new(pneumatics: &Pneumatics<T>, body: &Body<T>, q: &[T], p: &[T]) -> Self {
        let zero = T::zero();
        let mut volumes = vec![zero; body.inputs];
        chamber::volumes(body, pneumatics.dead_volume, q, false, &mut volumes);
        let content = |p: T, v: T| match pneumatics.level {
            PneumaticsLevel::Full => chamber::mass(pneumatics, p, v),
            _ => p,
        };
        let now: Vec<_> = p
            .iter()
            .zip(&volumes)
            .map(|(&p, &v)| Input { content: content(p, v), spool: zero, integral: zero })
            .collect();
        let idle = Drive { reference: zero, reference_rate: zero, volume: zero, volume_rate: zero };
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
            acting: p.to_vec(),
            substeps: 0,
            start: 0.0,
            end: 0.0,
            rates: volumes.clone(),
            volumes,
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
        let put = |new: T, old: T| T::from_lanes(|k| if which(k) { new.lane(k) } else { old.lane(k) });
        for (now, new) in self.now.iter_mut().zip(fresh.now) {
            now.content = put(new.content, now.content);
            now.spool = put(new.spool, now.spool);
            now.integral = put(new.integral, now.integral);
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
            chamber::volumes(body, pneumatics.dead_volume, q, false, &mut self.volumes);
            chamber::volumes(body, pneumatics.dead_volume, qd, true, &mut self.rates);
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
        if let Some(chambers) = (self as &mut dyn Any).downcast_mut::<Chambers<f64>>()
            && let Some(pneumatics) = (pneumatics as &dyn Any).downcast_ref::<Pneumatics<f64>>()
        {
            abreast::fill(chambers, pneumatics, h / count as f64);
            return;
        }
        let Self { now, next, drives, nodes, node_pressures, .. } = self;
        let step = h / count as f64;
        for j in 0..inputs {
            let (drive, volume) = (&drives[j], pneumatics.control_volume[j]);
            let mut x = (now[j], chamber::pressure(pneumatics, now[j].content, drive.volume));
            (nodes[j], node_pressures[j]) = (x.0.content, x.1);
            for k in 0..count {
                x = substep(pneumatics, volume, x, drive, (k as f64 * step, step));
                let place = (k + 1) * inputs + j;
                (nodes[place], node_pressures[place]) = (x.0.content, x.1);
            }
            next[j] = x.0;
        }
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
        chamber::volumes(body, pneumatics.dead_volume, q, false, &mut self.volumes);
        if self.substeps == 0 {
            for ((p, content), volume) in out.iter_mut().zip(&self.nodes).zip(&self.volumes) {
                *p = chamber::pressure(pneumatics, *content, *volume);
            }
            return;
        }
        let place = elapsed / (self.end - self.start) * self.substeps as f64;
        let k = (place as usize).min(self.substeps - 1);
        let at =
            Place { node: k, time: k as f64 / self.substeps as f64 * (self.end - self.start), on: place - k as f64 };
        if let Some(chambers) = (self as &mut dyn Any).downcast_mut::<Chambers<f64>>()
            && let Some(pneumatics) = (pneumatics as &dyn Any).downcast_ref::<Pneumatics<f64>>()
        {
            abreast::read(chambers, pneumatics, at);
            out.copy_from_slice(&self.acting);
            return;
        }
        let inputs = out.len();
        for (j, p) in out.iter_mut().enumerate() {
            let (a, b) = (self.nodes[k * inputs + j], self.nodes[(k + 1) * inputs + j]);
            let volume = self.drives[j].volume + self.drives[j].volume_rate * at.time;
            let node = (self.node_pressures[k * inputs + j], a, volume);
            *p = chamber::pressure_from(pneumatics.exponent, node, (a + (b - a) * at.on, self.volumes[j]));
        }
    }

    /// Pressures at the ends of the sub-steps of the step begun last, with the lengths moving on evenly.
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
                let drive = &self.drives[j];
                self.volumes[j] = if lag {
                    lagged(pneumatics, self.nodes[j], drive, elapsed)
                } else {
                    chamber::pressure(
                        pneumatics,
                        self.nodes[k * inputs + j],
                        drive.volume + drive.volume_rate * elapsed,
                    )
                };
            }
            each(self.start + elapsed, &self.volumes);
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

/// The lagged pressure after `elapsed` under a reference that moves evenly: exact, also where it meets the reference, from
/// which on the other time constant holds.
#[inline(always)]
fn lagged<T: Real>(pneumatics: &Pneumatics<T>, p: T, drive: &Drive<T>, elapsed: f64) -> T {
    let (zero, elapsed) = (T::zero(), T::from_f64(elapsed));
    let (ahead, rate) = (p - drive.reference, drive.reference_rate);
    let time = T::select(-ahead, pneumatics.fill_time, pneumatics.vent_time);
    // Past the transient the pressure follows the reference's line, `time` behind it: on the other side of the reference
    // if that moves towards the pressure.
    let behind = rate * time;
    let meets = ahead * rate;
    let ratio = T::select(meets, ahead / T::select(rate * rate, behind, T::one()), zero);
    let at_once = T::select(rate * rate, zero, elapsed);
    let meeting = T::select(-meets, elapsed, T::select(meets, time * (ratio.max(zero) + 1.0).ln(), at_once));
    let before = meeting.min(elapsed);
    let rest = elapsed - before;
    let first = (ahead + behind) * (-(before / time)).exp() - behind;
    let other = T::select(rate, pneumatics.fill_time, pneumatics.vent_time);
    let second = rate * other * ((-(rest / other)).exp() - 1.0);
    drive.reference + rate * elapsed + T::select(rest, second, first)
}

#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;
