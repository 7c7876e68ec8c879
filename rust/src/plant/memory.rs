//! What a plant remembers from step to step beside the state of the arm: to put it to rest, to note it, to go on from it.

use super::Plant;
use crate::error::{Error, Result};
use crate::real::Real;

/// What a plant remembers from step to step beside the state of the arm, see [`Plant::memory`].
#[derive(Clone, Debug)]
pub struct Memory<T> {
    /// Hidden states of effects, chambers, sensors with play and stages between pressures, one after the other.
    pub numbers: Vec<T>,
    /// Times, s, and rows of the pressures that effects have yet to see.
    pub inputs: Vec<f64>,
    /// Those rows, one after the other.
    pub pressures: Vec<T>,
    /// Times, s, of the states that delayed sensors have yet to see.
    pub sensors: Vec<f64>,
    /// Those states, one after the other.
    pub states: Vec<T>,
}

impl<T> Default for Memory<T> {
    fn default() -> Self {
        Self { numbers: Vec::new(), inputs: Vec::new(), pressures: Vec::new(), sensors: Vec::new(), states: Vec::new() }
    }
}

impl<T: Real> Plant<T> {
    /// Puts the lanes that `which` says to rest: at the lengths in `x`, with chambers at the commands `p`, which are held from
    /// now on. For plants without effects on pressures.
    pub fn restart(&mut self, which: impl Fn(usize) -> bool + Copy, x: &[T], p: &[T]) {
        self.hold(p);
        if let (Some(chambers), Some(pneumatics)) = (&mut self.chambers, &self.arm.pneumatics) {
            chambers.restart(pneumatics, &self.arm.body, which, &x[..x.len() / 2], p);
        }
        for (hidden, start) in self.ws.effects.hidden_mut().iter_mut().zip(self.arm.effects.start()) {
            *hidden = hidden.replaced(start, which);
        }
        if let Some(sensors) = &mut self.sensors {
            sensors.restart(which, x);
        }
    }

    /// Calls `elapsed` s after the clock's present zero its new one. For plants without effects on pressures.
    pub fn rewind(&mut self, elapsed: f64) {
        if let Some(sensors) = &mut self.sensors {
            sensors.rewind(elapsed);
        }
    }

    /// All that the plant remembers from step to step beside the state of the arm.
    pub fn memory(&self) -> Memory<T> {
        let mut memory = Memory { numbers: self.ws.effects.hidden().to_vec(), ..Memory::default() };
        if let Some(chambers) = &self.chambers {
            chambers.save(&mut memory.numbers);
        }
        if let Some(sensors) = &self.sensors {
            memory.numbers.extend_from_slice(sensors.readings());
        }
        if let Some(chain) = &self.chain {
            memory.numbers.extend_from_slice(chain.committed());
        }
        if let Some(history) = &self.history {
            let (times, rows) = history.committed();
            (memory.inputs, memory.pressures) = (times.to_vec(), rows.to_vec());
        }
        if let Some(sensors) = &self.sensors {
            (memory.sensors, memory.states) = sensors.remembered();
        }
        memory
    }

    /// Goes on at `t` from what [`Plant::memory`] gave of a plant of the same arm; this one has begun ([`Plant::begin`]).
    ///
    /// # Errors
    /// [`Error::Input`] where the sizes do not fit.
    pub fn resume(&mut self, t: f64, memory: &Memory<T>) -> Result<()> {
        let own = self.memory();
        let rows = |times: &[f64], rows: &[T], own: (&[f64], &[T])| {
            let width = own.1.len().checked_div(own.0.len()).unwrap_or(0);
            times.is_empty() == own.0.is_empty() && rows.len() == width * times.len()
        };
        if memory.numbers.len() != own.numbers.len()
            || !rows(&memory.inputs, &memory.pressures, (&own.inputs, &own.pressures))
            || !rows(&memory.sensors, &memory.states, (&own.sensors, &own.states))
        {
            return Err(Error::Input("state: it does not fit this arm; take one that this arm gave".to_owned()));
        }
        self.read.0 = f64::NAN;
        let (hidden, mut rest) = memory.numbers.split_at(self.ws.effects.hidden().len());
        self.ws.effects.hidden_mut().copy_from_slice(hidden);
        if let Some(chambers) = &mut self.chambers {
            rest = &rest[chambers.load(rest)..];
        }
        if let Some(sensors) = &mut self.sensors {
            rest = &rest[sensors.read_on(rest)..];
        }
        if let Some(chain) = &mut self.chain {
            chain.resume(t, rest);
        }
        if let Some(history) = &mut self.history {
            history.resume(&memory.inputs, &memory.pressures);
        }
        if let Some(sensors) = &mut self.sensors {
            sensors.resume(&memory.sensors, &memory.states, own.states.len() / own.sensors.len());
        }
        Ok(())
    }
}
