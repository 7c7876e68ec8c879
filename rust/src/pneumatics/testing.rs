//! Pneumatics for tests.

use super::Pneumatics;
use crate::body::parameters::{PneumaticsLevel, PneumaticsParameters};

/// Parameters of the nominal order of size.
pub fn parameters(level: PneumaticsLevel) -> PneumaticsParameters {
    PneumaticsParameters {
        level,
        fill_time: Some(0.03),
        vent_time: Some(0.05),
        supply_pressure: Some(3.5e5),
        exhaust_pressure: Some(101_325.0),
        vacuum_pressure: Some(0.5e5),
        sonic_conductance: Some(2e-8),
        exhaust_conductance: None,
        critical_pressure_ratio: Some(0.35),
        air_temperature: Some(293.15),
        dead_volume: Some(1e-4),
        polytropic_exponent: Some(1.2),
        spool_time: Some(2e-3),
        spool_dead_band: Some(0.05),
        proportional_gain: Some(150.0),
        integral_gain: Some(1500.0),
        feed_forward: Some(1.0),
    }
}

/// Full pneumatics of one input.
pub fn nominal() -> Pneumatics<f64> {
    Pneumatics::new(&parameters(PneumaticsLevel::Full), 101_325.0, &[5e-4]).unwrap()
}
