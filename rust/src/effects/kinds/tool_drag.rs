//! A hose or tool at a head: a spring and a damper to a fixed anchor, and drag of the air.
//!
//! Form: force at the head's origin F = -k (r - anchor) - c r' - d |r'| r', r and the anchor in the world.
//! Sign: resists. Validity: the spring is without length of its own (a preload is an anchor further away); passive for
//! k, c, d >= 0; |r'| is rounded off below 1 um/s.

use crate::effects::{Definition, Effect, Instant, Parameter, PlaceKind};
use crate::forces::Wrench;
use crate::real::Real;
use crate::real::linear::Vec3;

/// Hose or tool.
#[derive(Clone, Debug)]
pub struct ToolDrag<T> {
    stiffness: T,
    damping: T,
    drag: T,
    anchor: Vec3<T>,
    section: usize,
}

impl<T: Real> Effect<T> for ToolDrag<T> {
    const SUMMARY: &'static str = "hose or tool at a head: spring, damping, drag of the air";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::Section];
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new("stiffness", "N/m", 0.0..=1e4, "spring k to the anchor").or(0.0),
        Parameter::new("damping", "N s/m", 0.0..=1e3, "viscous damping c of the head").or(0.0),
        Parameter::new("drag", "N s^2/m^2", 0.0..=1e3, "quadratic drag d of the head").or(0.0),
        Parameter::new("anchor_x", "m", -10.0..=10.0, "anchor in the world").or(0.0),
        Parameter::new("anchor_y", "m", -10.0..=10.0, "anchor in the world").or(0.0),
        Parameter::new("anchor_z", "m", -10.0..=10.0, "anchor in the world").or(0.0),
    ];
    const SEVERAL: bool = true;

    fn new(definition: &Definition, values: &[T]) -> Self {
        Self {
            stiffness: values[0],
            damping: values[1],
            drag: values[2],
            anchor: Vec3([values[3], values[4], values[5]]),
            section: definition.target.sections.start,
        }
    }

    #[inline(always)]
    fn add_forces(&self, now: &mut Instant<'_, T>, _hidden: &[T]) {
        let link = &now.links[self.section];
        let (r, v) = (link.position, link.velocity);
        let speed = (v.dot(v) + 1e-12).sqrt();
        let force = (self.anchor - r) * self.stiffness - v * (self.damping + self.drag * speed);
        now.loads[self.section].on_head.add(Wrench::at(r, force));
    }
}
