//! The arm as a system of differential equations under its inputs: x = (q, q').

pub mod drives;
pub mod input;
mod memory;
mod past;
pub mod stiffness;

pub use memory::Memory;

use crate::arm::Arm;
use crate::body::parameters::PneumaticsLevel;
use crate::dynamics::Workspace;
use crate::dynamics::recursion::forward_dynamics_into;
use crate::effects::kinds::pressure_lag::PressureLag;
use crate::effects::pressures::{PressureChain, Sort, has_memory, has_readings};
use crate::effects::sensors::Sensors;
use crate::effects::upstream::{History, Upstream};
use crate::effects::{self, poses};
use crate::forces::External;
use crate::integrate::{Options, System};
use crate::kinematics::arc::PSI_MAX;
use crate::kinematics::coordinates::arc_from_lengths;
use crate::kinematics::link::Link;
use crate::kinematics::section::Pose;
use crate::plant::drives::Drives;
use crate::plant::input::Input;
use crate::pneumatics::{Chambers, LONGEST_STEP};
use crate::real::linear::Vec3;
use crate::real::{Real, kernel};
use std::sync::Arc;

/// An arm under an input, or several in lanes.
///
/// Pressures go from the input (or from outside, [`Plant::hold`]) through the arm's pneumatics, where it has any, into
/// the chambers; those are what pressure sensors see. Effects on pressures act between these and the bellows.
#[derive(Clone, Debug)]
pub struct Plant<T = f64> {
    /// The arm, or the arms in lanes.
    pub arm: Arc<Arm<T>>,
    drives: Drives<T>,
    ws: Workspace<T>,
    pressures: Vec<T>,
    /// Time of the pressures, and whether from the left.
    read: (f64, bool),
    step_end: f64,
    /// Pressures commanded from outside, in place of the inputs'.
    held: Option<Vec<T>>,
    /// Pneumatics between commands and chambers.
    chambers: Option<Chambers<T>>,
    /// Commands at a step's start and end, where there are chambers.
    commands: [Vec<T>; 2],
    /// Chamber pressures at the outputs since it was emptied last, one an input each; empty without pneumatics.
    pub chamber_pressures: Vec<T>,
    /// Set up when the first step begins, where the arm has effects on pressures or on sensors.
    chain: Option<PressureChain<T>>,
    /// What comes into the chain where that is not the input.
    history: Option<History<T>>,
    /// Whether gains and offsets act behind the chain.
    readings: bool,
    sensors: Option<Sensors<T>>,
    begun: bool,
    /// Whether what the inputs say before the run has been on its way when that begins.
    preceded: bool,
    /// Where what bellows remember stands when the run begins, one number a bellows, see [`Plant::moved`].
    moved: Option<Vec<T>>,
}

impl<T: Real> Plant<T> {
    /// The plant of `arm` under `input`, whose channels must be the arm's inputs.
    pub fn new(arm: Arc<Arm<T>>, input: Arc<Input>) -> Self {
        Self::in_lanes(arm, vec![(input, 0.0)])
    }

    /// The plant of arms in lanes, each under its own input: `inputs[k]` drives lane `k` (the only one all lanes) with its
    /// clock ahead of the plant's by the seconds given. See [`Drives::new`] for what they must share.
    pub fn in_lanes(arm: Arc<Arm<T>>, inputs: Vec<(Arc<Input>, f64)>) -> Self {
        let drives = Drives::new(inputs);
        let (mut ws, pressures) = (Workspace::new(&arm), vec![T::zero(); arm.body.inputs]);
        ws.effects.clock = drives.callers_clock();
        ws.wrenches = drives.wrenches();
        Self {
            arm,
            drives,
            ws,
            pressures,
            read: (f64::NAN, false),
            step_end: f64::INFINITY,
            held: None,
            chambers: None,
            commands: [Vec::new(), Vec::new()],
            chamber_pressures: Vec::new(),
            chain: None,
            history: None,
            readings: false,
            sensors: None,
            begun: false,
            preceded: false,
            moved: None,
        }
    }

    /// The same plant with the arm's pneumatics, at rest at lengths `q` under the commands of time `t`: pressures are
    /// commands. A lag that is [`Plant::preceded`] has them as these were.
    pub fn with_pneumatics(mut self, t: f64, q: &[T]) -> Self {
        let mut p = vec![T::zero(); self.arm.body.inputs];
        self.commands_into(t, false, &mut p);
        if self.preceded && self.arm.pneumatics.is_some() && self.is_lagged() {
            self.lagged_into(t, &mut p);
        }
        let arm = &self.arm;
        self.chambers = arm.pneumatics.as_ref().map(|x| Chambers::new(x, &arm.body, q, &p));
        if self.chambers.is_some() {
            self.commands = [p.clone(), p];
        }
        self
    }

    /// Whether pneumatics lie between commands and chambers.
    pub fn has_pneumatics(&self) -> bool {
        self.chambers.is_some()
    }

    /// `options` with steps no longer than the pneumatics allow.
    pub fn suited(&self, options: Options) -> Options {
        // A lag is exact over any step along which its command is a line, and steps end where one ends.
        if !self.has_pneumatics() || self.is_lagged() {
            return options;
        }
        let (step, max_step) = (options.step.min(LONGEST_STEP), options.max_step.min(LONGEST_STEP));
        Options { step, max_step, ..options }
    }

    /// Whether the pneumatics are a lag.
    fn is_lagged(&self) -> bool {
        self.arm.pneumatics.as_ref().is_some_and(|p| p.level == PneumaticsLevel::Lag)
    }

    /// The lag between commands and chambers, where that is what lies between them.
    fn lag(&self) -> Option<PressureLag<T>> {
        let lagged = self.arm.pneumatics.as_ref().filter(|_| self.chambers.is_some() && self.is_lagged());
        lagged.map(|p| PressureLag::of_all(p.fill_time, p.vent_time, self.arm.body.inputs))
    }

    /// Commands `p` from now on, in place of the inputs' pressures.
    #[inline(always)]
    pub fn hold(&mut self, p: &[T]) {
        self.read.0 = f64::NAN;
        match &mut self.held {
            Some(held) => held.copy_from_slice(p),
            None => self.held = Some(p.to_vec()),
        }
    }

    /// Whether there are external forces.
    #[inline(always)]
    fn has_forces(&self) -> bool {
        self.drives.has_forces()
    }

    /// Whether chambers shut air in, which valves and what lies before the bellows do not delay.
    #[inline(always)]
    fn is_trapped(&self) -> bool {
        self.chambers.is_some() && !self.is_lagged()
    }

    /// Whether sensors are modelled.
    pub fn has_sensors(&self) -> bool {
        self.sensors.is_some()
    }

    /// The run begins at (`t`, `x`), with the effects' hidden states at rest, but for pressures that are
    /// [`Plant::preceded`]. The first step calls it if nobody did.
    pub fn begin(&mut self, t: f64, x: &[T]) {
        self.begun = true;
        self.read.0 = f64::NAN;
        let remembers = has_memory(&self.arm.effects);
        let since = self.since(t);
        if let (None, Some(lag)) = (&self.held, self.lag()) {
            let (effects, inputs) = (&self.arm.effects, self.arm.body.inputs);
            let sort = if remembers { Sort::All } else { Sort::Remembering };
            self.readings = !remembers && has_readings(effects);
            self.chain = PressureChain::behind_commands((effects, sort), inputs, lag, &mut self.drives, since);
            self.follow(since, t);
        } else if self.chambers.is_some() || self.held.is_some() {
            let (q, mut p) = (&x[..x.len() / 2], self.pressures.clone());
            match (&mut self.chambers, &self.arm.pneumatics) {
                (Some(chambers), Some(pneumatics)) => {
                    chambers.reference(pneumatics, &self.arm.body, (t, q), &mut p);
                }
                _ => self.commands_into(t, t >= self.step_end, &mut p),
            }
            let mut history = History::new(t, &p).on_clock(self.drives.clock());
            // What only reads the pressure of the moment needs no past; behind what does, it keeps its place.
            let apart = self.is_trapped() || !remembers;
            let sort = if apart { Sort::Remembering } else { Sort::All };
            self.chain = PressureChain::new((&self.arm.effects, sort), self.arm.body.inputs, &mut history, t);
            self.readings = apart && has_readings(&self.arm.effects);
            if let Some(chain) = &self.chain {
                history.reach(chain.horizon());
                self.history = Some(history);
            }
        } else {
            let effects = (&self.arm.effects, Sort::All);
            self.chain = PressureChain::new(effects, self.arm.body.inputs, &mut self.drives, since);
            self.follow(since, t);
        }
        self.sensors = Sensors::new(&self.arm.effects, t, x);
        self.move_memories();
    }

    /// Lengths as their sensors have them at (`t`, `x`), within the last step, into `out`: the true ones where no sensor
    /// is modelled.
    pub fn measured_lengths_into(&self, t: f64, x: &[T], out: &mut [T]) {
        match &self.sensors {
            Some(sensors) => sensors.measure(&self.arm.effects, t, x, out),
            None => out.copy_from_slice(&x[..out.len()]),
        }
    }

    /// Whether heads are measured otherwise than they are.
    pub fn changes_heads(&self) -> bool {
        self.sensors.as_ref().is_some_and(Sensors::changes_heads)
    }

    /// Poses of the heads as they are measured at (`t`, `x`), within the last step, in order: the true ones where no sensor
    /// is modelled. `links` is work space, one a section.
    pub fn measured_heads(&self, t: f64, x: &[T], links: &mut [Link<T>], each: impl FnMut(usize, Pose<T>)) {
        match &self.sensors {
            Some(sensors) => sensors.measure_heads(&self.arm.body, &self.arm.effects, t, x, links, each),
            None => poses::seen(&self.arm.body, &self.arm.effects, &x[..x.len() / 2], links, each),
        }
    }

    /// Pressures in the chambers at `t` and lengths `q`, within the last step, into `out`; the commands as they are
    /// without pneumatics.
    #[inline(always)]
    pub fn chamber_pressures_into(&mut self, t: f64, q: &[T], out: &mut [T]) {
        match (&mut self.chambers, &self.arm.pneumatics) {
            (Some(chambers), Some(pneumatics)) => chambers.pressures(pneumatics, &self.arm.body, t, q, out),
            // At a step's end the limit from the left belongs to the step, also where a channel jumps.
            _ => self.commands_into(t, t >= self.step_end, out),
        }
    }

    /// Commanded pressures at `t` into `out`.
    #[inline(always)]
    fn commands_into(&mut self, t: f64, before: bool, out: &mut [T]) {
        match &self.held {
            Some(held) => out.copy_from_slice(held),
            None => self.drives.pressures(t, before, out),
        }
    }

    /// Reads the inputs at `t` into the work space; `q` are the lengths then.
    #[inline(always)]
    fn read_input(&mut self, t: f64, q: &[T]) {
        let before = self.drives.has_jumps() && t >= self.step_end;
        let again = self.read == (t, before);
        self.read = (t, before);
        if !again && self.has_forces() {
            self.drives.forces(t, before, &mut self.ws.external, &mut self.ws.wrenches);
        }
        // Only pressures of trapped air depend on the lengths.
        let trapped = self.is_trapped();
        if again && !trapped {
            return;
        }
        let mut pressures = std::mem::take(&mut self.pressures);
        match (&mut self.chain, &mut self.history) {
            (Some(chain), Some(history)) => chain.acting(&self.arm.effects, history, t, &mut pressures),
            (Some(chain), None) => chain.acting(&self.arm.effects, &mut self.drives, t, &mut pressures),
            (None, _) => self.chamber_pressures_into(t, q, &mut pressures),
        }
        if trapped
            && self.chain.is_some()
            && let (Some(chambers), Some(pneumatics)) = (&mut self.chambers, &self.arm.pneumatics)
        {
            chambers.released(pneumatics, &self.arm.body, q, &mut pressures);
        }
        if self.readings {
            effects::pressures::read(&self.arm.effects, &mut pressures);
        }
        self.pressures = pressures;
    }

    /// Takes the chambers over the step from (`t0`, `x0`) to `t1`.
    #[inline(always)]
    fn begin_chambers(&mut self, t0: f64, t1: f64, x0: &[T]) {
        if self.chambers.is_none() {
            return;
        }
        let [mut from, mut to] = std::mem::take(&mut self.commands);
        self.commands_into(t0, false, &mut from);
        self.commands_into(t1, true, &mut to);
        self.commands = [from, to];
        if let (Some(chambers), Some(pneumatics)) = (&mut self.chambers, &self.arm.pneumatics) {
            chambers.begin_step(pneumatics, &self.arm.body, (t0, t1), x0.split_at(x0.len() / 2), &self.commands);
        }
    }

    /// Notes what comes into the chain over a step, which does not depend on how the arm moves in it.
    #[inline(always)]
    fn begin_history(&mut self, t0: f64, t1: f64) {
        let Some(history) = &mut self.history else { return };
        history.begin_step();
        if let (Some(chambers), Some(pneumatics)) = (&mut self.chambers, &self.arm.pneumatics) {
            chambers.predicted(pneumatics, |t, p| history.note(t, p));
        } else if let Some(held) = &self.held {
            history.note(t0, held);
            history.note(t1, held);
        }
    }
}

impl<T: Real> System<T> for Plant<T> {
    #[inline(always)]
    fn begin_step(&mut self, t0: f64, t1: f64, x0: &[T]) {
        begin_step(self, t0, t1, x0);
    }

    #[inline(always)]
    fn end_step(&mut self, t1: f64, x1: &[T]) {
        end_step(self, t1, x1);
    }

    #[inline(always)]
    fn derivative(&mut self, t: f64, x: &[T], dx: &mut [T]) {
        derivative(self, t, x, dx);
    }
    #[inline(always)]
    fn output(&mut self, t: f64, x: &[T]) {
        if let (Some(chambers), Some(pneumatics)) = (&mut self.chambers, &self.arm.pneumatics) {
            let start = self.chamber_pressures.len();
            self.chamber_pressures.resize(start + self.arm.body.inputs, T::zero());
            chambers.pressures(pneumatics, &self.arm.body, t, &x[..x.len() / 2], &mut self.chamber_pressures[start..]);
        }
    }

    fn next_break(&mut self, t: f64) -> f64 {
        let mut jump = self.drives.next_jump(t);
        if self.chambers.is_some() && self.held.is_none() && self.is_lagged() {
            jump = jump.min(self.drives.next_bend(t));
        }
        match (&self.chain, &self.history) {
            (Some(chain), None) => jump.min(chain.next_jump(&self.drives, t)),
            _ => jump,
        }
    }

    /// Where samples of the input lie: what pneumatics and effects make of them bends little elsewhere.
    fn next_bend(&mut self, t: f64) -> f64 {
        if self.held.is_some() { f64::INFINITY } else { self.drives.next_bend(t) }
    }

    #[inline(always)]
    fn is_second_order(&self) -> bool {
        true
    }

    #[inline(always)]
    fn objection(&self, x: &[T]) -> Option<String> {
        let mut margin = T::one();
        for (i, section) in self.arm.body.sections.iter().enumerate() {
            let [u, v, l] = arc_from_lengths(Vec3([x[3 * i], x[3 * i + 1], x[3 * i + 2]]), section.inverse_radius).0;
            margin = margin.min(-(u * u + v * v) + PSI_MAX * PSI_MAX).min(l);
        }
        if margin.smallest() > 0.0 { None } else { self.reason(x) }
    }
}

impl<T: Real> Plant<T> {
    /// Which section is beyond what the model allows, if one is.
    #[cold]
    #[inline(never)]
    fn reason(&self, x: &[T]) -> Option<String> {
        for (i, section) in self.arm.body.sections.iter().enumerate() {
            let [u, v, l] = arc_from_lengths(Vec3([x[3 * i], x[3 * i + 1], x[3 * i + 2]]), section.inverse_radius).0;
            if (u * u + v * v).largest() > PSI_MAX * PSI_MAX {
                return Some(format!("section {} bends by more than one and a half turns", i + 1));
            }
            if l.smallest() <= 0.0 {
                return Some(format!("section {}'s mean length is not positive", i + 1));
            }
        }
        None
    }
}

impl<T: Real> Plant<T> {
    #[inline(always)]
    fn begin_step_here(&mut self, t0: f64, t1: f64, x0: &[T]) {
        self.step_end = t1;
        if !self.begun {
            self.begin(t0, x0);
        }
        // Pressures of chambers and of the chain belong to the step.
        if self.chain.is_some() || self.chambers.is_some() {
            self.read.0 = f64::NAN;
        }
        self.begin_chambers(t0, t1, x0);
        self.begin_history(t0, t1);
        match (&mut self.chain, &mut self.history) {
            (Some(chain), Some(history)) => chain.begin_step(&self.arm.effects, history, t0, t1),
            (Some(chain), None) => chain.begin_step(&self.arm.effects, &mut self.drives, t0, t1),
            (None, _) => {}
        }
        self.ws.effects.begin_step(&self.arm.body, t0, x0);
    }

    #[inline(always)]
    fn end_step_here(&mut self, t1: f64, x1: &[T]) {
        self.ws.effects.end_step(&self.arm.body, &self.arm.effects, t1, x1);
        match (&mut self.chain, &mut self.history) {
            (Some(chain), Some(history)) => {
                chain.end_step(&self.arm.effects, history, t1);
                history.end_step();
            }
            (Some(chain), None) => chain.end_step(&self.arm.effects, &mut self.drives, t1),
            (None, _) => {}
        }
        if let Some(chambers) = &mut self.chambers {
            chambers.end_step();
        }
        if let Some(sensors) = &mut self.sensors {
            sensors.end_step(t1, x1);
        }
    }

    #[inline(always)]
    fn derivative_here(&mut self, t: f64, x: &[T], dx: &mut [T]) {
        self.ws.effects.time = t;
        let n = x.len() / 2;
        let (q, qd) = x.split_at(n);
        self.read_input(t, q);
        let (dq, dqd) = dx.split_at_mut(n);
        dq.copy_from_slice(qd);
        let (forces, wrenches) = (std::mem::take(&mut self.ws.external), std::mem::take(&mut self.ws.wrenches));
        let count = self.drives.section_force_count() / 3;
        let f_ext = self.has_forces().then_some(External { forces: &forces[..count], wrenches: &wrenches });
        let (arm, p, ws) = (&self.arm, self.pressures.as_slice(), &mut self.ws);
        forward_dynamics_into(arm, q, qd, p, f_ext, ws, dqd);
        (self.ws.external, self.ws.wrenches) = (forces, wrenches);
    }
}

kernel! {
    fn begin_step<'a, T>(plant: &'a mut Plant<T>, t0: f64, t1: f64, x0: &'a [T]) {
        plant.begin_step_here(t0, t1, x0);
    }
}

kernel! {
    fn end_step<'a, T>(plant: &'a mut Plant<T>, t1: f64, x1: &'a [T]) {
        plant.end_step_here(t1, x1);
    }
}

kernel! {
    fn derivative<'a, T>(plant: &'a mut Plant<T>, t: f64, x: &'a [T], dx: &'a mut [T]) {
        plant.derivative_here(t, x, dx);
    }
}
