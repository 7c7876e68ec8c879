//! The applied forces: [`accumulate`], the one function that sums them, elementary ones and effects.

use crate::arm::Arm;
use crate::effects::{self, EffectState};
use crate::forces::weight::weight;
use crate::forces::{External, ForceSet, Load, Wrench, act_along, axial, bellows, bending, external};
use crate::kinematics::link::Link;
use crate::real::kernel;

kernel! {
    /// Sums the forces of `set` into `loads` (overwritten), at the state in `links`.
    ///
    /// `masses`: links of the masses along the sections, after those of the heads; `p`: pressures, Pa absolute, one an input
    /// (not read without `actuation`); `outside`: what acts from outside; `state`: work space and hidden
    /// states of the effects.
    pub fn accumulate<'a, T>(
        arm: &'a Arm<T>,
        set: ForceSet,
        p: &'a [T],
        outside: Option<External<'a, T>>,
        links: &'a [Link<T>],
        masses: &'a [Link<T>],
        state: &'a mut EffectState<T>,
        loads: &'a mut [Load<T>],
    ) {
        let body = &arm.body;
        // No `fill`: see `linear`.
        for load in loads.iter_mut() {
            *load = Load::zero();
        }
        if !arm.effects.list.is_empty() {
            effects::state::add_forces(body, &arm.effects, (set.actuation, set.effects), p, links, state, loads);
        }
        let mut extra = state.bellows_force.iter();
        let mut masses = masses.iter();
        for (i, section) in body.sections.iter().enumerate() {
            let link = &links[i];
            bellows::add(body, i, section, set, p, links, &mut extra, loads);
            if set.bending {
                loads[i].on_arc += bending::on_arc(section, link.arc);
            }
            if let Some(a) = &section.axial {
                axial::add(a, (set.axial, set.damping), link, &mut loads[i]);
            }
            if set.gravity {
                loads[i].on_head.add(weight(section.mass, body.gravity, link));
                for (mass, link) in section.masses.iter().zip(&mut masses) {
                    act_along(i, &link.subspace, weight(mass.mass, body.gravity, link), loads);
                }
            }
            if set.external
                && let Some(force) = outside.and_then(|x| x.forces.get(i).copied())
            {
                loads[i].on_head.add(Wrench::at(link.position + link.rotation.mul_vec(section.force_point), force));
            }
        }
        if set.external
            && let Some(External { wrenches, .. }) = outside
            && !wrenches.is_empty()
        {
            external::add(body, links, wrenches, loads);
        }
    }
}
