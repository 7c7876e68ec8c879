//! The inputs that drive the lanes of a plant, and where their readers stand.

use crate::effects::upstream::Upstream;
use crate::forces::PointWrench;
use crate::kinematics::point::Point;
use crate::plant::input::{Cursor, Input};
use crate::real::Real;
use crate::real::linear::Vec3;
use std::sync::Arc;

/// Most lanes of any scalar.
const MOST_LANES: usize = 8;

/// One input for all lanes, or one a lane.
#[derive(Clone, Debug)]
pub struct Drives<T> {
    each: Vec<Drive>,
    has_jumps: bool,
    /// The samples that the lanes' inputs stood at last, and their pressures and rises to the next samples.
    at: [usize; MOST_LANES],
    from: Vec<T>,
    rise: Vec<T>,
}

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

impl<T: Real> Drives<T> {
    /// `inputs[k]` drives lane `k` (the only one all lanes), its clock ahead of the plant's by the seconds given. All
    /// inputs have the same force channels and wrenches at the same fractions of the same sections.
    pub fn new(inputs: Vec<(Arc<Input>, f64)>) -> Self {
        let (cursor, elsewhere) = (Cursor::default(), Cursor::default());
        let has_jumps = inputs.iter().any(|(input, _)| !input.jumps().is_empty());
        let none = vec![T::zero(); inputs.first().map_or(0, |(input, _)| input.pressure_count())];
        let each = inputs.into_iter().map(|(input, offset)| Drive { input, offset, cursor, elsewhere }).collect();
        Self { each, has_jumps, at: [usize::MAX; MOST_LANES], from: none.clone(), rise: none }
    }

    /// Whether any of them jumps at any time: else limits from the left are values.
    #[inline(always)]
    pub fn has_jumps(&self) -> bool {
        self.has_jumps
    }

    /// Whether there are external forces.
    #[inline(always)]
    pub fn has_forces(&self) -> bool {
        self.each[0].input.has_forces()
    }

    /// The first time after `t` at which any of them jumps.
    pub fn next_jump(&self, t: f64) -> f64 {
        self.each.iter().map(|d| d.input.next_jump(t + d.offset) - d.offset).fold(f64::INFINITY, f64::min)
    }

    /// The first sample after `t` at which any of them may bend.
    pub fn next_bend(&self, t: f64) -> f64 {
        self.each.iter().map(|d| d.input.next_bend(t + d.offset) - d.offset).fold(f64::INFINITY, f64::min)
    }

    /// When the first sample of each lane's input is, s.
    pub fn first_samples(&self) -> T {
        // On its own clock an input begins at 0.
        T::from_lanes(|k| -self.each[if self.each.len() == 1 { 0 } else { k }].offset)
    }

    /// The first sample of all of them, s.
    pub fn first_sample(&self) -> f64 {
        self.first_samples().smallest()
    }

    /// The first one's caller's clock minus the plant's, s.
    pub fn callers_clock(&self) -> f64 {
        self.each[0].offset + self.each[0].input.origin()
    }

    /// The pressures at `t`; `before`: the limit from the left.
    #[inline(always)]
    pub fn pressures(&mut self, t: f64, before: bool, out: &mut [T]) {
        self.pressures_each([t; MOST_LANES], [before; MOST_LANES], out);
    }

    /// The pressures of every lane at a time of its own.
    #[inline(always)]
    fn pressures_each(&mut self, t: [f64; MOST_LANES], before: [bool; MOST_LANES], out: &mut [T]) {
        let places = self.places(t, before);
        let (mut at, mut weights) = ([0; MOST_LANES], [0.0; MOST_LANES]);
        for (k, place) in places.iter().enumerate() {
            (at[k], weights[k]) = *place;
        }
        if at != self.at {
            self.at = at;
            self.fetch();
        }
        let weight = if self.each.len() == 1 { T::from_f64(weights[0]) } else { T::from_lanes(|k| weights[k]) };
        for ((p, from), rise) in out.iter_mut().zip(&self.from).zip(&self.rise) {
            *p = rise.mul_add(weight, *from);
        }
    }

    /// Fetches the samples that the inputs stand at.
    #[inline(always)]
    fn fetch(&mut self) {
        let Self { each, at, from, rise, .. } = self;
        for (j, (from, rise)) in from.iter_mut().zip(rise).enumerate() {
            if let [drive] = each.as_slice() {
                let (a, b) = drive.input.segment(at[0], j);
                (*from, *rise) = (T::from_f64(a), T::from_f64(b));
            } else {
                *from = T::from_lanes(|k| each[k].input.segment(at[k], j).0);
                *rise = T::from_lanes(|k| each[k].input.segment(at[k], j).1);
            }
        }
    }

    /// Number of force channels at the sections' force points: three a section, or none.
    #[inline(always)]
    pub fn section_force_count(&self) -> usize {
        self.each[0].input.section_force_count()
    }

    /// Wrenches at the points where the inputs have some; where these differ in offset, in lanes.
    pub fn wrenches(&self) -> Vec<PointWrench<T>> {
        let points = |k: usize| self.each[if self.each.len() == 1 { 0 } else { k }].input.points();
        let lifted = |(j, point): (usize, &Point<f64>)| {
            let offset = Vec3([0, 1, 2].map(|c| T::from_lanes(|k| points(k)[j].offset.0[c])));
            let point = Point { section: point.section, fraction: point.fraction, offset };
            PointWrench { point, force: Vec3::zero(), moment: Vec3::zero() }
        };
        points(0).iter().enumerate().map(lifted).collect()
    }

    /// The forces at `t`, at the sections' force points (if there are some) and of wrenches.
    #[inline(always)]
    pub fn forces(&mut self, t: f64, before: bool, out: &mut [Vec3<T>], wrenches: &mut [PointWrench<T>]) {
        let places = self.places([t; MOST_LANES], [before; MOST_LANES]);
        let count = self.section_force_count();
        for (i, f) in out.iter_mut().enumerate().take(count / 3) {
            *f = self.three(&places, 3 * i);
        }
        for (j, wrench) in wrenches.iter_mut().enumerate() {
            wrench.force = self.three(&places, count + 6 * j);
            wrench.moment = self.three(&places, count + 6 * j + 3);
        }
    }

    /// Three force channels from `first` on.
    #[inline(always)]
    fn three(&self, places: &[(usize, f64); MOST_LANES], first: usize) -> Vec3<T> {
        let mut out = Vec3::zero();
        for (c, f) in out.0.iter_mut().enumerate() {
            *f = if self.each.len() == 1 {
                T::from_f64(self.each[0].input.force(places[0], first + c))
            } else {
                T::from_lanes(|k| self.each[k].input.force(places[k], first + c))
            };
        }
        out
    }

    /// Where each lane's input stands.
    #[inline(always)]
    fn places(&mut self, t: [f64; MOST_LANES], before: [bool; MOST_LANES]) -> [(usize, f64); MOST_LANES] {
        let mut places = [(0, 0.0); MOST_LANES];
        for (k, (place, drive)) in places.iter_mut().zip(&mut self.each).enumerate() {
            *place = drive.input.weight(t[k] + drive.offset, before[k], &mut drive.cursor);
        }
        places
    }
}

/// The number in each lane. What takes a closure is given these: closures may stay out of line, where lanes are slow.
#[inline(always)]
fn each_lane<T: Real>(t: T) -> [f64; MOST_LANES] {
    let mut out = [0.0; MOST_LANES];
    for (k, out) in out.iter_mut().enumerate().take(T::LANES) {
        *out = t.lane(k);
    }
    out
}

impl<T: Real> Upstream<T> for Drives<T> {
    #[inline(always)]
    fn read(&mut self, t: T, end: f64, out: &mut [T]) {
        let t = each_lane(t);
        let mut before = [false; MOST_LANES];
        for (before, t) in before.iter_mut().zip(t) {
            *before = t >= end;
        }
        self.pressures_each(t, before, out);
    }

    /// With the derivative by time only where one input drives all lanes.
    #[inline(always)]
    fn delayed(&mut self, t: T, channel: usize) -> T {
        if let [drive] = self.each.as_mut_slice() {
            return drive.input.pressure_at(t + drive.offset, channel);
        }
        let t = each_lane(t);
        T::from_lanes(|k| {
            let drive = &mut self.each[k];
            // A jump counts from just after its time on, as it does in `pressure_at`.
            let place = drive.input.weight(t[k] + drive.offset, true, &mut drive.elsewhere);
            drive.input.pressure(place, channel)
        })
    }

    #[inline(always)]
    fn all_delayed(&mut self, t: T, out: &mut [T]) {
        if let [drive] = self.each.as_mut_slice() {
            return drive.input.pressures_at(t + drive.offset, 0, out);
        }
        for (channel, out) in out.iter_mut().enumerate() {
            *out = self.delayed(t, channel);
        }
    }

    #[inline(always)]
    fn next_sample(&mut self, t: T) -> T {
        let t = each_lane(t);
        match self.each.as_mut_slice() {
            [drive] => T::from_f64(drive.next_sample(t[0])),
            drives => T::from_lanes(|k| drives[k].next_sample(t[k])),
        }
    }

    fn next_jump(&self, t: f64) -> f64 {
        Self::next_jump(self, t)
    }

    fn next_bend(&self, t: f64) -> f64 {
        Self::next_bend(self, t)
    }

    fn clock(&self) -> T {
        T::from_lanes(|k| self.each[if self.each.len() == 1 { 0 } else { k }].offset)
    }
}
