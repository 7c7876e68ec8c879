//! Forward and inverse dynamics in O(n).
//!
//! Source: paper (48) solved by the articulated-body algorithm (Featherstone, *Rigid Body Dynamics Algorithms*, ch. 7)
//! with sections as joints of three degrees of freedom; inverse dynamics by the recursive Newton-Euler algorithm (ch. 5).
//! The velocity products are evaluated first, as inertia forces of the motion without joint accelerations; the
//! articulated-body sweep then solves for the rest with no bias of its own.
//! A mass k along section i is a body beside its head that moves with the same rates: with the subspace S_k of its place,
//! the joint feels S^T I^A S + sum S_k^T I_k S_k and hands I^A + sum I_k - U D^-1 U^T down, U = I^A S + sum I_k S_k.
//! Frame: the world's, about its origin O.
//! Limits: those of the kinematics; the inertia about each joint must be positive, which a positive mass and a positive
//! section length ensure even without rotational energy.

use super::Workspace;
use super::applied::accumulate;
use crate::arm::Arm;
use crate::body::{PointMass, Section};
use crate::forces::{External, ForceSet, Load, Wrench, act_along, on_joint};
use crate::kinematics::chain::{pass, pass_masses};
use crate::kinematics::coordinates::{arc_from_lengths, force_on_lengths, lengths_from_arc};
use crate::kinematics::link::{Link, Motion};
use crate::real::linear::{Mat3, Sym3, Vec3};
use crate::real::{Real, kernel};

/// A spatial inertia about O: [[rotational, coupling], [coupling^T, translational]].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Inertia<T> {
    pub rotational: Sym3<T>,
    pub coupling: Mat3<T>,
    pub translational: Sym3<T>,
}

impl<T: Real> Inertia<T> {
    #[inline(always)]
    pub fn zero() -> Self {
        Self { rotational: Sym3::zero(), coupling: Mat3::zero(), translational: Sym3::zero() }
    }

    /// Inertia of a body of mass `m`; `rotational` is its own tensor about the centre of mass in the world.
    #[inline(always)]
    pub fn of_body(m: T, link: &Link<T>, rotational: &Sym3<T>) -> Self {
        let o = T::zero();
        Self {
            rotational: rotational.add(&Sym3::of_point_mass(m, link.center)),
            coupling: Mat3::cross_matrix(link.center * m),
            translational: Sym3([m, o, o, m, o, m]),
        }
    }

    #[inline(always)]
    pub fn add(&self, other: &Self) -> Self {
        Self {
            rotational: self.rotational.add(&other.rotational),
            coupling: self.coupling.add(&other.coupling),
            translational: self.translational.add(&other.translational),
        }
    }

    /// Momentum (or force) of a motion (angular, linear at O).
    #[inline(always)]
    pub fn mul(&self, angular: Vec3<T>, linear: Vec3<T>) -> (Vec3<T>, Vec3<T>) {
        (
            self.rotational.mul_vec(angular) + self.coupling.mul_vec(linear),
            self.coupling.transposed_mul_vec(angular) + self.translational.mul_vec(linear),
        )
    }
}

/// Three motions or forces (angular, linear), one for each rate of a section.
type Columns<T> = [(Vec3<T>, Vec3<T>); 3];

/// What the articulated-body sweep keeps of a section for its way back up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Joint<T> {
    /// Columns of I^A S: (angular, linear).
    u: Columns<T>,
    /// Inverse of S^T I^A S.
    inverse: Sym3<T>,
    /// Generalized force left after the bias forces.
    force: Vec3<T>,
}

impl<T: Real> Joint<T> {
    #[inline(always)]
    pub fn zero() -> Self {
        Self { u: [(Vec3::zero(), Vec3::zero()); 3], inverse: Sym3::zero(), force: Vec3::zero() }
    }
}

/// The section's own inertia tensor in the world; zero where the arm leaves rotational energy out.
#[inline(always)]
pub(crate) fn body_tensor<T: Real>(arm: &Arm<T>, section: &Section<T>, link: &Link<T>) -> Sym3<T> {
    if !arm.body.rotational_energy {
        return Sym3::zero();
    }
    let diagonal = section.inertia;
    match section.products_of_inertia {
        None => Sym3::rotated_diagonal(&link.rotation, diagonal),
        Some(products) => Sym3::from_moments_and_products(diagonal, products).rotated(&link.rotation),
    }
}

/// The same of a mass along a section.
#[inline(always)]
pub(crate) fn mass_tensor<T: Real>(arm: &Arm<T>, mass: &PointMass<T>, link: &Link<T>) -> Sym3<T> {
    if arm.body.rotational_energy { Sym3::rotated_diagonal(&link.rotation, mass.inertia) } else { Sym3::zero() }
}

/// Inertia forces of the motion of a body of mass `m` as a wrench: what must act on it for it to move so.
#[inline(always)]
fn inertia_wrench<T: Real>(m: T, link: &Link<T>, tensor: &Sym3<T>) -> Wrench<T> {
    let (omega, alpha) = (link.angular_velocity, link.angular_acceleration);
    let arm = link.center - link.position;
    let acceleration = link.acceleration + alpha.cross(arm) + omega.cross(omega.cross(arm));
    let mut wrench = Wrench::at(link.center, acceleration * m);
    wrench.torque += tensor.mul_vec(alpha) + omega.cross(tensor.mul_vec(omega));
    wrench
}

/// q'' for given state, pressures and external forces, paper (48), into `qdd`.
///
/// `q`, `qd`, `qdd`: three a section; `p`: one an input, Pa absolute; `f_ext`: what acts from
/// outside.
#[inline(always)]
pub fn forward_dynamics_into<T: Real>(
    arm: &Arm<T>,
    q: &[T],
    qd: &[T],
    p: &[T],
    f_ext: Option<External<'_, T>>,
    ws: &mut Workspace<T>,
    qdd: &mut [T],
) {
    motion_pass(arm, q, qd, ws);
    accumulate(arm, ForceSet::ALL, p, f_ext, &ws.links, &ws.masses, &mut ws.effects, &mut ws.loads);
    solve(arm, ws, qdd);
}

/// The motion that forces and velocity products need.
#[inline(always)]
pub(crate) fn motion_needed<T: Real>(arm: &Arm<T>) -> Motion {
    // Effects may act on the velocities of heads, whether or not Coriolis forces count.
    let without = if arm.effects.list.is_empty() { Motion::Pose } else { Motion::Velocity };
    if arm.body.coriolis_forces { Motion::Bias } else { without }
}

/// The kinematics of that motion.
#[inline(always)]
fn motion_pass<T: Real>(arm: &Arm<T>, q: &[T], qd: &[T], ws: &mut Workspace<T>) {
    let motion = motion_needed(arm);
    pass(&arm.body, q, qd, motion, &mut ws.links);
    pass_masses(&arm.body, &ws.links, 0, motion, &mut ws.masses);
    if motion == Motion::Pose {
        joint_rates(arm, qd, &mut ws.links);
    }
}

/// Rates of (u, v, l) alone, for damping where velocities are left out of the rest.
#[inline(always)]
fn joint_rates<T: Real>(arm: &Arm<T>, qd: &[T], links: &mut [Link<T>]) {
    for (i, (section, link)) in arm.body.sections.iter().zip(links).enumerate() {
        link.rate = arc_from_lengths(Vec3([qd[3 * i], qd[3 * i + 1], qd[3 * i + 2]]), section.inverse_radius);
    }
}

/// Joint accelerations from the loads and the velocity products in `ws`.
#[inline(always)]
pub(crate) fn solve<T: Real>(arm: &Arm<T>, ws: &mut Workspace<T>, qdd: &mut [T]) {
    // Two kernels: the choice within the sweep costs an arm without masses along its sections 5 %.
    if ws.masses.is_empty() { solve_heads(arm, ws, qdd) } else { solve_all(arm, ws, qdd) }
}

kernel! {
    /// The same for arms all of whose mass is at the heads.
    fn solve_heads<'a, T>(arm: &'a Arm<T>, ws: &'a mut Workspace<T>, qdd: &'a mut [T]) {
        sweep::<T, false>(arm, ws, qdd);
    }
}

kernel! {
    /// The same for arms with masses along their sections.
    fn solve_all<'a, T>(arm: &'a Arm<T>, ws: &'a mut Workspace<T>, qdd: &'a mut [T]) {
        sweep::<T, true>(arm, ws, qdd);
    }
}

/// Down the arm and up again.
#[inline(always)]
fn sweep<T: Real, const MASSES: bool>(arm: &Arm<T>, ws: &mut Workspace<T>, qdd: &mut [T]) {
    let Workspace { links, masses, loads, joints, .. } = ws;
    let (links, loads, joints) = (links.as_slice(), loads.as_slice(), joints.as_mut_slice());
    let mut masses = masses.as_slice();
    let mut inertia = Inertia::zero();
    let mut bias = Wrench::zero();
    for (i, section) in arm.body.sections.iter().enumerate().rev() {
        let (link, load) = (&links[i], &loads[i]);
        let tensor = body_tensor(arm, section, link);
        inertia = inertia.add(&Inertia::of_body(section.mass, link, &tensor));
        if arm.body.coriolis_forces {
            bias.add(inertia_wrench(section.mass, link, &tensor));
        }
        bias.torque -= load.on_head.torque;
        bias.force -= load.on_head.force;
        let joint;
        if MASSES {
            let (below, own) = masses.split_at(masses.len() - section.masses.len());
            masses = below;
            joint = reduce_with_masses(arm, section, (link, own), load, &mut inertia, &mut bias);
        } else {
            joint = reduce(&inertia, &bias, link, load);
        }
        if i > 0 {
            (inertia, bias) = hand_down(&inertia, &bias, &joint);
        }
        joints[i] = joint;
    }
    let (mut angular, mut linear) = (Vec3::zero(), Vec3::zero());
    for (i, section) in arm.body.sections.iter().enumerate() {
        let (joint, s) = (&joints[i], &links[i].subspace);
        let u = &joint.u;
        let carried = [power(angular, linear, &u[0]), power(angular, linear, &u[1]), power(angular, linear, &u[2])];
        let rate = joint.inverse.mul_vec(joint.force - Vec3(carried));
        let (da, dl) = s.twist(rate);
        angular += da;
        linear += dl;
        let lengths = lengths_from_arc(rate, section.bellows_radius);
        qdd[3 * i..3 * i + 3].copy_from_slice(&lengths.0);
    }
}

/// I^A S, (S^T I^A S)^-1 and the joint's remaining force.
#[inline(always)]
fn reduce<T: Real>(inertia: &Inertia<T>, bias: &Wrench<T>, link: &Link<T>, load: &Load<T>) -> Joint<T> {
    let (u, joint_inertia) = reduced(inertia, link);
    Joint { u, inverse: joint_inertia.inverse(), force: load.on_arc - on_joint(link, bias) }
}

/// I S and S^T I S.
#[inline(always)]
fn reduced<T: Real>(inertia: &Inertia<T>, link: &Link<T>) -> (Columns<T>, Sym3<T>) {
    let s = &link.subspace;
    let along_l = s.linear[2];
    let u = [
        inertia.mul(s.angular[0], s.linear[0]),
        inertia.mul(s.angular[1], s.linear[1]),
        (inertia.coupling.mul_vec(along_l), inertia.translational.mul_vec(along_l)),
    ];
    let ([a, b], [f, g, _]) = (s.angular, s.linear);
    let (first, second) = ([power(a, f, &u[0]), power(a, f, &u[1]), power(a, f, &u[2])], power(b, g, &u[1]));
    (u, Sym3([first[0], first[1], first[2], second, power(b, g, &u[2]), along_l.dot(u[2].1)]))
}

/// The same for a section whose masses have the links `own`; what is carried, inertia and bias, has them in then.
#[inline(always)]
fn reduce_with_masses<T: Real>(
    arm: &Arm<T>,
    section: &Section<T>,
    (link, own): (&Link<T>, &[Link<T>]),
    load: &Load<T>,
    inertia: &mut Inertia<T>,
    bias: &mut Wrench<T>,
) -> Joint<T> {
    let (mut u, mut joint_inertia) = reduced(inertia, link);
    let mut force = load.on_arc - on_joint(link, bias);
    for (mass, link) in section.masses.iter().zip(own) {
        let tensor = mass_tensor(arm, mass, link);
        let along = Inertia::of_body(mass.mass, link, &tensor);
        let (along_u, along_inertia) = reduced(&along, link);
        for k in 0..3 {
            u[k].0 += along_u[k].0;
            u[k].1 += along_u[k].1;
        }
        joint_inertia = joint_inertia.add(&along_inertia);
        *inertia = inertia.add(&along);
        if arm.body.coriolis_forces {
            let wrench = inertia_wrench(mass.mass, link, &tensor);
            force -= on_joint(link, &wrench);
            bias.add(wrench);
        }
    }
    Joint { u, inverse: joint_inertia.inverse(), force }
}

/// u[0] k[0] + u[1] k[1] + u[2] k[2].
#[inline(always)]
fn mix<T: Real>(u: &Columns<T>, k: [T; 3]) -> (Vec3<T>, Vec3<T>) {
    (u[0].0.combined(k, u[1].0, u[2].0), u[0].1.combined(k, u[1].1, u[2].1))
}

/// The scalar product of a motion (angular, linear) and a force.
#[inline(always)]
fn power<T: Real>(angular: Vec3<T>, linear: Vec3<T>, force: &(Vec3<T>, Vec3<T>)) -> T {
    angular.dot(force.0) + linear.dot(force.1)
}

/// What the body below feels of the inertia and the bias above its joint.
#[inline(always)]
fn hand_down<T: Real>(inertia: &Inertia<T>, bias: &Wrench<T>, joint: &Joint<T>) -> (Inertia<T>, Wrench<T>) {
    let [xx, xy, xz, yy, yz, zz] = joint.inverse.0;
    let u = &joint.u;
    let k = [mix(u, [xx, xy, xz]), mix(u, [xy, yy, yz]), mix(u, [xz, yz, zz])];
    let mut out = *inertia;
    for j in 0..3 {
        let ((ka, kl), (ua, ul)) = (k[j], u[j]);
        out.rotational = out.rotational.minus_product(ka, ua);
        out.coupling = out.coupling.minus_product(ka, ul);
        out.translational = out.translational.minus_product(kl, ul);
    }
    let mut below = *bias;
    for j in 0..3 {
        below.torque = k[j].0.mul_add(joint.force.0[j], below.torque);
        below.force = k[j].1.mul_add(joint.force.0[j], below.force);
    }
    (out, below)
}

/// Inertia forces of one section, and the joint accelerations up to it as a motion about O.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Inertial<T> {
    angular: Vec3<T>,
    linear: Vec3<T>,
    /// What must act on the body for it to move so.
    wrench: Wrench<T>,
}

impl<T: Real> Inertial<T> {
    /// Nothing moves.
    #[inline(always)]
    pub fn zero() -> Self {
        Self { angular: Vec3::zero(), linear: Vec3::zero(), wrench: Wrench::zero() }
    }

    /// The same over another scalar.
    #[inline(always)]
    pub fn lifted(x: &Inertial<f64>) -> Self {
        let (angular, linear) = (Vec3::from_f64(x.angular.0), Vec3::from_f64(x.linear.0));
        Self { angular, linear, wrench: Wrench::lifted(&x.wrench) }
    }
}

/// Inertia forces of a body of mass `m` whose joints' accelerations are a motion (angular, linear) about O.
#[inline(always)]
fn wrench_of<T: Real>(
    arm: &Arm<T>,
    m: T,
    link: &Link<T>,
    tensor: &Sym3<T>,
    angular: Vec3<T>,
    linear: Vec3<T>,
) -> Wrench<T> {
    let (torque, force) = Inertia::of_body(m, link, tensor).mul(angular, linear);
    let mut wrench = Wrench { torque, force };
    if arm.body.coriolis_forces {
        wrench.add(inertia_wrench(m, link, tensor));
    }
    wrench
}

kernel! {
    /// Inertia forces of the motion in `links` and `masses` with joint accelerations `qdd`, from section `from` on; those
    /// below stay.
    pub(crate) fn inertia_forces<'a, T>(
        arm: &'a Arm<T>,
        qdd: &'a [T],
        from: usize,
        links: &'a [Link<T>],
        masses: &'a [Link<T>],
        inertial: &'a mut [Inertial<T>],
        mass_wrenches: &'a mut [Wrench<T>],
    ) {
        let mut next = 0;
        for section in &arm.body.sections[..from] {
            next += section.masses.len();
        }
        // Joint accelerations as a motion about O, which grows up the chain: A = sum S q''.
        let Inertial { mut angular, mut linear, .. } = if from == 0 { Inertial::zero() } else { inertial[from - 1] };
        for (i, section) in arm.body.sections.iter().enumerate().skip(from) {
            let link = &links[i];
            let lengths = Vec3([qdd[3 * i], qdd[3 * i + 1], qdd[3 * i + 2]]);
            let accelerations = arc_from_lengths(lengths, section.inverse_radius);
            for mass in &section.masses {
                let link = &masses[next];
                let (da, dl) = link.subspace.twist(accelerations);
                let tensor = mass_tensor(arm, mass, link);
                mass_wrenches[next] = wrench_of(arm, mass.mass, link, &tensor, angular + da, linear + dl);
                next += 1;
            }
            let (da, dl) = link.subspace.twist(accelerations);
            angular += da;
            linear += dl;
            let tensor = body_tensor(arm, section, link);
            let wrench = wrench_of(arm, section.mass, link, &tensor, angular, linear);
            inertial[i] = Inertial { angular, linear, wrench };
        }
    }
}

kernel! {
    /// Forces on the lengths that the motion leaves over, into `out`: loads less inertia forces. Zero for the motion that
    /// the loads bring about.
    pub(crate) fn left_over<'a, T>(
        arm: &'a Arm<T>,
        links: &'a [Link<T>],
        masses: &'a [Link<T>],
        loads: &'a mut [Load<T>],
        inertial: &'a [Inertial<T>],
        mass_wrenches: &'a [Wrench<T>],
        out: &'a mut [T],
    ) {
        let mut next = 0;
        for (i, section) in arm.body.sections.iter().enumerate() {
            for _ in &section.masses {
                act_along(i, &masses[next].subspace, mass_wrenches[next].reversed(), loads);
                next += 1;
            }
        }
        for (load, inertial) in loads.iter_mut().zip(inertial) {
            load.on_head.torque -= inertial.wrench.torque;
            load.on_head.force -= inertial.wrench.force;
        }
        crate::forces::project(links, loads, |i, force| {
            let f = force_on_lengths(force, arm.body.sections[i].inverse_radius);
            out[3 * i..3 * i + 3].copy_from_slice(&f.0);
        });
    }
}

/// The actuation force tau needed for the acceleration `qdd`: M q'' + C q' + N, into `tau`.
#[inline(always)]
pub fn inverse_dynamics_into<T: Real>(
    arm: &Arm<T>,
    q: &[T],
    qd: &[T],
    qdd: &[T],
    f_ext: Option<External<'_, T>>,
    ws: &mut Workspace<T>,
    tau: &mut [T],
) {
    motion_pass(arm, q, qd, ws);
    accumulate(arm, ForceSet::PASSIVE, &[], f_ext, &ws.links, &ws.masses, &mut ws.effects, &mut ws.loads);
    inertia_forces(arm, qdd, 0, &ws.links, &ws.masses, &mut ws.inertial, &mut ws.mass_wrenches);
    left_over(arm, &ws.links, &ws.masses, &mut ws.loads, &ws.inertial, &ws.mass_wrenches, tau);
    for f in tau {
        *f = -*f;
    }
}
