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
//! lag is advanced exactly. One arm's inputs are advanced side by side in the processor's lanes (`inputs`).

pub mod chamber;
mod chambers;
pub mod controller;
mod inputs;
mod lag;
mod substep;
#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;
pub mod valve;

pub use chambers::Chambers;

use crate::body::parameters::{PneumaticsLevel, PneumaticsParameters};
use crate::error::{Error, Result};
use crate::real::Real;

/// Longest sub-step, s.
pub const SUBSTEP: f64 = 2.5e-4;
/// Longest step of the arm with pneumatics that are not ideal, s; none is needed with a lag where steps end at samples.
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
    /// Whether volumes depend on pressure, since walls of bellows give way.
    pub walls_give: bool,
    /// Volume of each input with all its bellows at the middle of their range, m^3: what the controllers reckon with, and
    /// what [`Chambers::reference`] refers to.
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
            walls_give: false,
            control_volume: middle_volumes.iter().map(|v| v + dead_volume).collect(),
        })
    }
}

impl<T: Real> Pneumatics<T> {
    /// The law of its air.
    #[inline(always)]
    pub fn air(&self) -> chamber::Air<T> {
        chamber::Air { exponent: self.exponent, ambient: self.ambient_pressure, walls_give: self.walls_give }
    }

    /// The same over another scalar, number by number.
    pub fn map<U: Real>(&self, c: impl Fn(T) -> U + Copy) -> Pneumatics<U> {
        Pneumatics { control_volume: self.control_volume.iter().map(|&v| c(v)).collect(), ..self.shared(c) }
    }

    /// The same without what differs from input to input, [`Pneumatics::control_volume`]; nothing is allocated.
    #[inline(always)]
    fn shared<U: Real>(&self, c: impl Fn(T) -> U + Copy) -> Pneumatics<U> {
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
            walls_give: self.walls_give,
            control_volume: Vec::new(),
        }
    }
}
