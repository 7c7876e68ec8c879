//! The registry itself, places, and what is refused.

use super::*;
use crate::effects::{KINDS, Place};
use crate::error::Error;

#[test]
fn kinds_are_complete_and_their_defaults_allowed() {
    let wanted = "creep hysteresis friction quadratic_damping bending_damping bending_nonlinear bending_anisotropy section_coupling \
                  effective_area pressure_stiffness weak_bellows payload preload base_tilt tool_drag contact pressure_lag delay \
                  valve_dead_band pressure_offset pressure_gain leak supply_sag length_offset length_gain wire_backlash \
                  marker_offset work_conjugate torsion taper distributed_mass formula";
    let names: Vec<_> = KINDS.iter().map(|k| k.name).collect();
    assert_eq!(names, wanted.split_whitespace().collect::<Vec<_>>());
    for kind in KINDS {
        assert!(!kind.places.is_empty() && !kind.summary.is_empty());
        for p in kind.parameters {
            assert!(p.default.is_none_or(|d| p.range.contains(&d)), "{} {}", kind.name, p.name);
        }
    }
}

#[test]
fn places_read_as_they_are_written() {
    for text in ["all", "section 2", "bellows 32", "bellows 10_2", "bellows 1_12", "input p13", "sensors", "heads"] {
        assert_eq!(Place::parse(text).unwrap().to_string(), text);
    }
    for text in
        ["", "All", "section", "section 0", "section 02", "bellows 3", "bellows 321", "bellows 30", "input ", "tip"]
    {
        assert_eq!(Place::parse(text), None, "{text}");
    }
}

#[test]
fn faults_name_the_effect_and_what_is_allowed() {
    let fault = |effects: &[EffectParameters]| match Arm::new(&parameters(effects)) {
        Err(error @ Error::Effect { .. }) => error.to_string(),
        other => panic!("{other:?}"),
    };
    let creep = |place: &str| effect("creep", place, &[("stiffness", 10.0), ("tau", 1.0)]);
    assert!(fault(&[effect("crep", "all", &[])]).contains("found crep; one of creep, "));
    assert!(fault(&[creep("input p11")]).contains("\"all\" or \"section 2\" or \"bellows 32\" is needed"));
    assert!(fault(&[creep("section 4")]).contains("sections 1 to 3 exist"));
    assert!(fault(&[creep("bellows 14")]).contains("bellows 1 to 3 exist"));
    assert!(fault(&[effect("creep", "all", &[("tau", 1.0)])]).contains("effect 1 (creep): stiffness: found nothing"));
    assert!(fault(&[effect("creep", "all", &[("tau", 0.0), ("stiffness", 1.0)])]).contains("tau: found 0"));
    assert!(fault(&[effect("creep", "all", &[("tau", f64::NAN), ("stiffness", 1.0)])]).contains("found NaN"));
    assert!(fault(&[effect("base_tilt", "all", &[("about_z", 0.1)])]).contains("about_x, about_y are allowed"));
    assert!(fault(&[creep("all"), creep("all")]).contains("again, as effect 1"));
    assert!(fault(&[effect("pressure_gain", "input p99", &[("gain", 0.1)])]).contains("there is no input p99"));
    assert!(fault(&[effect("payload", "section 3", &[("mass", -0.45)])]).contains("must be less"));
    assert!(fault(&[effect("payload", "section 3", &[("mass", -0.4), ("x", 0.5)])]).contains("negative"));
    assert!(fault(&[effect("contact", "section 3", &[("stiffness", 1.0)])]).contains("must not all be zero"));
    assert!(fault(&[effect("section_coupling", "section 3", &[("stiffness", 1.0)])]).contains("is the last one"));
    assert!(fault(&[formula("-c * qd", "all", &[])]).contains("at character 2: \"c\" is not known"));
    assert!(fault(&[effect("formula", "all", &[])]).contains("a formula is needed"));
    // Two branches of creep are fine.
    assert!(
        Arm::new(&parameters(&[creep("all"), effect("creep", "all", &[("stiffness", 9.0), ("tau", 9.0)])])).is_ok()
    );
}
