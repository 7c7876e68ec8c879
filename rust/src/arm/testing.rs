//! Random arms and states for property tests.

use crate::arm::Arm;
use crate::body::parameters::{
    ArmParameters, AxialParameters, BaseParameters, BellowsParameters, ForceModel, PointMassParameters,
    SectionArcParameters, SectionParameters,
};
use proptest::prelude::*;

/// Unit numbers in [0, 1) from which a state is made once the arm's size is known.
#[derive(Clone, Debug)]
pub struct Seed(Vec<f64>);

/// Strategy for states.
pub fn states() -> impl Strategy<Value = Seed> {
    prop::collection::vec(0.0..1.0_f64, 64).prop_map(Seed)
}

impl Seed {
    /// Lengths between 0.1 and 0.3 m.
    pub fn lengths(&self, arm: &Arm) -> Vec<f64> {
        self.0[..arm.coordinates()].iter().map(|x| 0.1 + 0.2 * x).collect()
    }
    /// Rates between -0.5 and 0.5 m/s.
    pub fn rates(&self, arm: &Arm) -> Vec<f64> {
        self.0[16..16 + arm.coordinates()].iter().map(|x| x - 0.5).collect()
    }
    /// Other numbers between -1 and 1.
    pub fn numbers(&self, count: usize) -> Vec<f64> {
        self.0[32..32 + count].iter().map(|x| 2.0 * x - 1.0).collect()
    }
    /// Pressures between 0.7 and 2.2 bar.
    pub fn pressures(&self, arm: &Arm) -> Vec<f64> {
        self.0[48..48 + arm.body.inputs].iter().map(|x| 0.7e5 + 1.5e5 * x).collect()
    }
}

/// Three arcs that differ, for about half of the sections.
fn arcs(x: &[f64], force_model: ForceModel) -> Vec<SectionArcParameters> {
    if x[0] < 0.5 {
        return Vec::new();
    }
    let share = |a: f64, b: f64, c: f64| [a, b, c].map(|k| (k + 0.2) / (a + b + c + 0.6));
    let (length, bending) = (share(x[1], x[2], x[3]), share(x[4], x[5], x[6]));
    let conjugate = force_model == ForceModel::WorkConjugate;
    let arc = |k: usize| SectionArcParameters {
        length: length[k],
        bending: bending[k],
        relative_radius: 0.8 + 0.4 * x[7 + k],
        relative_area: if conjugate { 0.7 + 0.6 * x[9 - k] } else { 1.0 },
    };
    (0..3).map(arc).collect()
}

/// Two masses along about half of the sections.
fn masses(x: &[f64]) -> Vec<PointMassParameters> {
    if x[0] < 0.5 {
        return Vec::new();
    }
    let mass = |k: usize| PointMassParameters {
        share: x[1 + k],
        mass: 0.1 + 0.3 * x[3 + k],
        inertia: [1e-3 * x[5 + k], 2e-3 * x[6 + k], 3e-3 * x[7 - k]],
        offset: [0.04 * (x[4 + k] - 0.5), 0.04 * (x[5 - k] - 0.5), 0.04 * (x[3 - k] - 0.5)],
    };
    (0..2).map(mass).collect()
}

fn section(index: usize, x: &[f64], force_model: ForceModel) -> SectionParameters {
    let radius = 0.05 + 0.07 * x[0];
    let bellows = (0..3)
        .map(|k| BellowsParameters {
            angle: (120.0 * f64::from(k)).to_radians(),
            radius,
            terminal_area: 0.001 + 0.002 * x[1],
            rest_length: 0.1 + 0.1 * x[2],
            stiffness: vec![500.0 + 1000.0 * x[3], 800.0 * x[4], 9000.0 * x[5]],
            damping: 5.0 + 10.0 * x[6],
            input: 3 * index + k as usize,
        })
        .collect();
    SectionParameters {
        mass: 0.2 + x[7],
        inertia: [0.002 + 0.004 * x[8], 0.003 + 0.002 * x[9], 0.002 + 0.003 * x[10]],
        force_point: None,
        center_of_mass: [0.03 * (x[11] - 0.5), 0.03 * (x[12] - 0.5), 0.05 * (x[13] - 0.5)],
        bellows_radius: radius,
        base_offset: 0.03 * x[14],
        head_offset: 0.03 * x[15],
        bending_stiffness: [1.0 + 3.0 * x[16], 0.3 * x[17], 0.2 * x[16] * x[17]],
        cross_bending_stiffness: None,
        bending_plane: 0.0,
        axial: None,
        length_range: [0.1, 0.3],
        bellows,
        arcs: arcs(&x[18..], force_model),
        masses: masses(&x[28..]),
    }
}

/// Numbers that a section is made from.
const NUMBERS: usize = 37;

fn parameters(
    sections: &[Vec<f64>],
    base: Option<BaseParameters>,
    gravity: [f64; 3],
    force_model: ForceModel,
) -> ArmParameters {
    ArmParameters {
        name: "random".to_owned(),
        base,
        gravity,
        ambient_pressure: 101_325.0,
        force_model,
        rotational_energy: true,
        coriolis_forces: true,
        inputs: (0..3 * sections.len()).map(|k| format!("p{k}")).collect(),
        pneumatics: None,
        section: sections.iter().enumerate().map(|(i, x)| section(i, x, force_model)).collect(),
        effect: Vec::new(),
    }
}

/// Bending planes and axial stiffness, each in about half of the sections.
fn hold(section: &mut SectionParameters, x: &[f64]) {
    if x[16] > 0.5 {
        section.cross_bending_stiffness = Some([1.0 + 3.0 * x[0], 0.3 * x[1], 0.2 * x[0] * x[1]]);
        section.bending_plane = 6.0 * x[2] - 3.0;
    }
    if x[17] > 0.5 {
        let stiffness = vec![300.0 + 2000.0 * x[3], 500.0 * x[4], 8000.0 * x[5]];
        section.axial = Some(AxialParameters { rest_length: 0.1 + 0.1 * x[6], stiffness, damping: 10.0 * x[7] });
    }
}

/// Strategy for the parameters of arms of 1 to 5 sections, some of several arcs and with masses along them, anywhere.
pub fn arm_parameters() -> impl Strategy<Value = ArmParameters> {
    let sections = prop::collection::vec(prop::collection::vec(0.0..1.0_f64, NUMBERS), 1..=5);
    let (triple, switch) = (prop::array::uniform3, any::<bool>);
    let base = (switch(), triple(-1.0..1.0_f64), triple(-2.0..2.0_f64))
        .prop_map(|(stated, position, rotation)| stated.then_some(BaseParameters { position, rotation }));
    (sections, base, triple(-9.81..9.81_f64), switch()).prop_map(|(sections, base, gravity, end_force)| {
        let force_model = if end_force { ForceModel::EndForce } else { ForceModel::WorkConjugate };
        let mut made = parameters(&sections, base, gravity, force_model);
        for (section, x) in made.section.iter_mut().zip(&sections) {
            hold(section, x);
        }
        made
    })
}

/// Strategy for the same with one arc a section, one bending stiffness and all mass at the heads, at the world's origin: as in the
/// paper.
pub fn plain_arm_parameters() -> impl Strategy<Value = ArmParameters> {
    arm_parameters().prop_map(|mut p| {
        p.base = None;
        for section in &mut p.section {
            (section.arcs, section.masses) = (Vec::new(), Vec::new());
            (section.cross_bending_stiffness, section.axial) = (None, None);
        }
        p
    })
}

/// Strategy for arms of 1 to 5 sections.
pub fn arms() -> impl Strategy<Value = Arm> {
    arm_parameters().prop_map(|p| Arm::new(&p).expect("the strategy makes valid arms"))
}

/// One hanging arm of `sections` sections, always the same.
pub fn fixed_parameters(sections: usize) -> ArmParameters {
    let unit = |i: usize, k: usize| 0.5 + 0.4 * ((7 * i + 3 * k) as f64).sin();
    // The rest is zero: one arc, no masses along it.
    let numbers = |i| (0..NUMBERS).map(|k| if k < 18 { unit(i, k) } else { 0.0 }).collect();
    let sections: Vec<Vec<f64>> = (0..sections).map(numbers).collect();
    parameters(&sections, None, [0.0, 0.0, 9.81], ForceModel::WorkConjugate)
}
