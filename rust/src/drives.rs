//! The inputs that drive the lanes of a plant, and where their readers stand.

use crate::effects::upstream::Upstream;
use crate::input::{Cursor, Input};
use crate::linear::Vec3;
use crate::real::Real;
use std::sync::Arc;

/// Most lanes of any scalar.
const MOST_LANES: usize = 8;

/// One input for all lanes, or one a lane.
#[derive(Clone, Debug)]
pub struct Drives(Vec<Drive>);

/// An input and where its readers stand.
#[derive(Clone, Debug)]
struct Drive {
    input: Arc<Input>,
    /// Its clock minus the plant's, s.
    offset: f64,
    cursor: Cursor,
    /// Of those who look back or ahead.
    elsewhere: Cursor,
}

impl Drive {
    /// The first sample after `t` of the plant's clock.
    #[inline(always)]
    fn next_sample(&mut self, t: f64) -> f64 {
        self.input.next_sample(t + self.offset, &mut self.elsewhere) - self.offset
    }
}

impl Drives {
    /// `inputs[k]` drives lane `k` (the only one all lanes), its clock ahead of the plant's by the seconds given. Either
    /// all inputs have forces or none.
    pub fn new(inputs: Vec<(Arc<Input>, f64)>) -> Self {
        let (cursor, elsewhere) = (Cursor::default(), Cursor::default());
        Self(inputs.into_iter().map(|(input, offset)| Drive { input, offset, cursor, elsewhere }).collect())
    }

    /// Whether there are external forces.
    #[inline(always)]
    pub fn has_forces(&self) -> bool {
        self.0[0].input.has_forces()
    }

    /// The first time after `t` at which any of them jumps.
    pub fn next_jump(&self, t: f64) -> f64 {
        self.0.iter().map(|d| d.input.next_jump(t + d.offset) - d.offset).fold(f64::INFINITY, f64::min)
    }

    /// The pressures at `t`; `before`: the limit from the left.
    #[inline(always)]
    pub fn pressures<T: Real>(&mut self, t: f64, before: bool, out: &mut [T]) {
        self.pressures_each(|_| t, |_| before, out);
    }

    /// The pressures of every lane at a time of its own.
    #[inline(always)]
    fn pressures_each<T: Real>(&mut self, t: impl Fn(usize) -> f64, before: impl Fn(usize) -> bool, out: &mut [T]) {
        let places = self.places(t, before);
        match self.0.as_slice() {
            [drive] => {
                for (j, p) in out.iter_mut().enumerate() {
                    *p = T::from_f64(drive.input.pressure(places[0], j));
                }
            }
            drives => {
                for (j, p) in out.iter_mut().enumerate() {
                    *p = T::from_lanes(|k| drives[k].input.pressure(places[k], j));
                }
            }
        }
    }

    /// The forces at `t`.
    #[inline(always)]
    pub fn forces<T: Real>(&mut self, t: f64, before: bool, out: &mut [Vec3<T>]) {
        let places = self.places(|_| t, |_| before);
        let single = self.0.len() == 1;
        for (i, f) in out.iter_mut().enumerate() {
            for (c, f) in f.0.iter_mut().enumerate() {
                *f = if single {
                    T::from_f64(self.0[0].input.force(places[0], 3 * i + c))
                } else {
                    T::from_lanes(|k| self.0[k].input.force(places[k], 3 * i + c))
                };
            }
        }
    }

    /// Where each lane's input stands.
    #[inline(always)]
    fn places(&mut self, t: impl Fn(usize) -> f64, before: impl Fn(usize) -> bool) -> [(usize, f64); MOST_LANES] {
        let mut places = [(0, 0.0); MOST_LANES];
        for (k, (place, drive)) in places.iter_mut().zip(&mut self.0).enumerate() {
            *place = drive.input.weight(t(k) + drive.offset, before(k), &mut drive.cursor);
        }
        places
    }
}

impl<T: Real> Upstream<T> for Drives {
    #[inline(always)]
    fn read(&mut self, t: T, end: f64, out: &mut [T]) {
        self.pressures_each(|k| t.lane(k), |k| t.lane(k) >= end, out);
    }

    /// With the derivative by time only where one input drives all lanes.
    #[inline(always)]
    fn delayed(&mut self, t: T, channel: usize) -> T {
        match self.0.as_mut_slice() {
            [drive] => drive.input.pressure_at(t + drive.offset, channel),
            drives => T::from_lanes(|k| {
                let drive = &mut drives[k];
                // A jump counts from just after its time on, as it does in `pressure_at`.
                let place = drive.input.weight(t.lane(k) + drive.offset, true, &mut drive.elsewhere);
                drive.input.pressure(place, channel)
            }),
        }
    }

    #[inline(always)]
    fn next_sample(&mut self, t: T) -> T {
        match self.0.as_mut_slice() {
            [drive] => T::from_f64(drive.next_sample(t.lane(0))),
            drives => T::from_lanes(|k| drives[k].next_sample(t.lane(k))),
        }
    }

    fn next_jump(&self, t: f64) -> f64 {
        Self::next_jump(self, t)
    }

    fn clock(&self) -> T {
        T::from_lanes(|k| self.0[if self.0.len() == 1 { 0 } else { k }].offset)
    }
}
