//! The terms of M(q) q'' + C(q, q') q' + N(q, q') = tau(q, p) one by one, and d tau/dp.
//!
//! Source: paper (48)-(53); M and C as sums over composite bodies (Featherstone, ch. 6, for M; for C the form
//! sum m J_v^T dJ_v/dt + J_w^T I dJ_w/dt + J_w^T [w]x I J_w, for which dM/dt - 2C is skew-symmetric).
//! A mass along section i moves by its own subspace with the coordinates of i and by those of the sections below with theirs.
//! Matrices are row by row, coordinates are the lengths. O(n^2), which is their size.

use super::Workspace;
use super::applied::accumulate;
use super::recursion::{Inertia, body_tensor, mass_tensor};
use crate::arm::Arm;
use crate::body::PointMass;
use crate::forces::{External, ForceSet, project};
use crate::kinematics::chain::{mass_subspace_rate, pass, pass_masses, subspace_rate};
use crate::kinematics::coordinates::force_on_lengths;
use crate::kinematics::link::{Link, Motion};
use crate::kinematics::section::Subspace;
use crate::real::Real;
use crate::real::linear::{Mat3, Sym3, Vec3};

/// S^T (angular, linear) for the three columns of a subspace.
#[inline(always)]
fn transposed<T: Real>(s: &Subspace<T>, (torque, force): (Vec3<T>, Vec3<T>)) -> Vec3<T> {
    Vec3([
        s.angular[0].dot(torque) + s.linear[0].dot(force),
        s.angular[1].dot(torque) + s.linear[1].dot(force),
        s.linear[2].dot(force),
    ])
}

/// Column `k` of a subspace.
#[inline(always)]
fn column<T: Real>(s: &Subspace<T>, k: usize) -> (Vec3<T>, Vec3<T>) {
    (if k < 2 { s.angular[k] } else { Vec3::zero() }, s.linear[k])
}

/// Writes a 3 x 3 block by (u, v, l), given by columns, as a block by lengths at (3 row, 3 column) of an m x m matrix.
fn write_block<T: Real>(
    columns: [Vec3<T>; 3],
    (row, row_inverse_radius): (usize, T),
    (col, col_inverse_radius): (usize, T),
    m: usize,
    out: &mut [T],
) {
    let left = columns.map(|c| force_on_lengths(c, row_inverse_radius));
    for r in 0..3 {
        let by_lengths = force_on_lengths(Vec3([left[0].0[r], left[1].0[r], left[2].0[r]]), col_inverse_radius);
        for c in 0..3 {
            out[(3 * row + r) * m + 3 * col + c] = by_lengths.0[c];
        }
    }
}

/// M(q), (49), into `out` (m x m, row by row).
pub fn inertia_matrix_into<T: Real>(arm: &Arm<T>, q: &[T], ws: &mut Workspace<T>, out: &mut [T]) {
    pass(&arm.body, q, &[], Motion::Pose, &mut ws.links);
    pass_masses(&arm.body, &ws.links, 0, Motion::Pose, &mut ws.masses);
    inertia_matrix_of(arm, &ws.links, &ws.masses, out);
}

/// I S for the three columns of a subspace.
fn momenta_of<T: Real>(inertia: &Inertia<T>, s: &Subspace<T>) -> [(Vec3<T>, Vec3<T>); 3] {
    [0, 1, 2].map(|k| {
        let (a, l) = column(s, k);
        inertia.mul(a, l)
    })
}

/// Adds three columns of vectors to others.
fn add_columns<T: Real>(sum: &mut [Vec3<T>; 3], columns: [Vec3<T>; 3]) {
    for k in 0..3 {
        sum[k] += columns[k];
    }
}

/// The masses along section `i` with their links, of those of all sections.
fn masses_along<'a, T: Real>(
    arm: &'a Arm<T>,
    i: usize,
    masses: &'a [Link<T>],
) -> impl Iterator<Item = (&'a PointMass<T>, &'a Link<T>)> {
    let before: usize = arm.body.sections[..i].iter().map(|s| s.masses.len()).sum();
    arm.body.sections[i].masses.iter().zip(&masses[before..])
}

/// The same from a pass.
pub(crate) fn inertia_matrix_of<T: Real>(arm: &Arm<T>, links: &[Link<T>], masses: &[Link<T>], out: &mut [T]) {
    let m = arm.coordinates();
    let mut composite = Inertia::zero();
    for i in (0..links.len()).rev() {
        let (section, link) = (&arm.body.sections[i], &links[i]);
        composite = composite.add(&Inertia::of_body(section.mass, link, &body_tensor(arm, section, link)));
        let mut momenta = momenta_of(&composite, &link.subspace);
        let mut own = momenta.map(|w| transposed(&link.subspace, w));
        for (mass, link) in masses_along(arm, i, masses) {
            let inertia = Inertia::of_body(mass.mass, link, &mass_tensor(arm, mass, link));
            let along = momenta_of(&inertia, &link.subspace);
            add_columns(&mut own, along.map(|w| transposed(&link.subspace, w)));
            for (sum, w) in momenta.iter_mut().zip(along) {
                sum.0 += w.0;
                sum.1 += w.1;
            }
            composite = composite.add(&inertia);
        }
        for j in 0..=i {
            let columns = if j == i { own } else { momenta.map(|w| transposed(&links[j].subspace, w)) };
            let (rj, ri) = (arm.body.sections[j].inverse_radius, section.inverse_radius);
            write_block(columns, (j, rj), (i, ri), m, out);
            for r in 0..3 {
                for c in 0..3 {
                    out[(3 * i + c) * m + 3 * j + r] = out[(3 * j + r) * m + 3 * i + c];
                }
            }
        }
    }
}

/// The velocity-dependent companion of an inertia in C: [[rotational, 0], [translational, 0]] acting on S.
#[derive(Clone, Copy)]
struct Gyration<T> {
    rotational: Mat3<T>,
    translational: Mat3<T>,
}

impl<T: Real> Gyration<T> {
    fn of_body(mass: T, link: &Link<T>, tensor: &Mat3<T>) -> Self {
        let moving = Mat3::cross_matrix(link.center_velocity() * -mass);
        let spin = Mat3::cross_matrix(link.angular_velocity).mul_mat(tensor);
        Self { rotational: Mat3::cross_matrix(link.center).mul_mat(&moving).add(&spin), translational: moving }
    }
}

/// An inertia with its companion.
#[derive(Clone, Copy)]
struct Moving<T> {
    inertia: Inertia<T>,
    gyration: Gyration<T>,
}

impl<T: Real> Moving<T> {
    fn zero() -> Self {
        let gyration = Gyration { rotational: Mat3::zero(), translational: Mat3::zero() };
        Self { inertia: Inertia::zero(), gyration }
    }

    fn of_body(mass: T, link: &Link<T>, tensor: &Sym3<T>) -> Self {
        let gyration = Gyration::of_body(mass, link, &tensor.to_mat());
        Self { inertia: Inertia::of_body(mass, link, tensor), gyration }
    }

    fn add(&mut self, other: &Self) {
        self.inertia = self.inertia.add(&other.inertia);
        self.gyration.rotational = self.gyration.rotational.add(&other.gyration.rotational);
        self.gyration.translational = self.gyration.translational.add(&other.gyration.translational);
    }

    /// Its part of C between the coordinates of `row` and those of `col`, whose time derivative is `rate`.
    fn coriolis(&self, row: &Subspace<T>, col: &Subspace<T>, rate: &Subspace<T>) -> [Vec3<T>; 3] {
        [0, 1, 2].map(|k| {
            let ((a, _), (a_t, l_t)) = (column(col, k), column(rate, k));
            let (torque, force) = self.inertia.mul(a_t, l_t);
            let torque = torque + self.gyration.rotational.mul_vec(a);
            let force = force + self.gyration.translational.mul_vec(a);
            transposed(row, (torque, force))
        })
    }
}

/// C(q, q'), (50), into `out` (m x m, row by row); zero where the arm leaves Coriolis forces out.
pub fn coriolis_matrix_into<T: Real>(arm: &Arm<T>, q: &[T], qd: &[T], ws: &mut Workspace<T>, out: &mut [T]) {
    out.fill(T::zero());
    if !arm.body.coriolis_forces {
        return;
    }
    pass(&arm.body, q, qd, Motion::Velocity, &mut ws.links);
    pass_masses(&arm.body, &ws.links, 0, Motion::Velocity, &mut ws.masses);
    let (m, links) = (arm.coordinates(), &ws.links);
    let mut all = Moving::zero();
    for upper in (0..links.len()).rev() {
        let (section, link) = (&arm.body.sections[upper], &links[upper]);
        all.add(&Moving::of_body(section.mass, link, &body_tensor(arm, section, link)));
        let along: Vec<_> = masses_along(arm, upper, &ws.masses)
            .map(|(mass, link)| {
                let moving = Moving::of_body(mass.mass, link, &mass_tensor(arm, mass, link));
                (moving, &link.subspace, mass_subspace_rate(&arm.body, links, upper, mass, link))
            })
            .collect();
        let upper_rate = subspace_rate(&arm.body, links, upper);
        // Blocks (row, upper) with row <= upper and (upper, column) with column < upper share these composites.
        for other in 0..=upper {
            for (row, col) in [(other, upper), (upper, other)] {
                if row == upper && col == upper && other != upper {
                    continue;
                }
                let (own_row, own_column) = (&links[row].subspace, &links[col].subspace);
                let rate = if col == upper { upper_rate } else { subspace_rate(&arm.body, links, col) };
                let mut columns = all.coriolis(own_row, own_column, &rate);
                for (moving, s, s_t) in &along {
                    let (left, right, right_rate) = (
                        if row == upper { *s } else { own_row },
                        if col == upper { *s } else { own_column },
                        if col == upper { s_t } else { &rate },
                    );
                    add_columns(&mut columns, moving.coriolis(left, right, right_rate));
                }
                let (rr, rc) = (arm.body.sections[row].inverse_radius, arm.body.sections[col].inverse_radius);
                write_block(columns, (row, rr), (col, rc), m, out);
            }
        }
        for (moving, ..) in &along {
            all.add(moving);
        }
    }
}

/// Generalized force on the lengths of the forces in `set`, into `out`.
///
/// tau (53) is `ForceSet { actuation: true, ..NONE }`; N (52) is minus [`ForceSet::PASSIVE`]. `qd` is
/// read for damping and effects only and may then be empty, which means rest.
pub fn generalized_force_into<T: Real>(
    arm: &Arm<T>,
    set: ForceSet,
    (q, qd): (&[T], &[T]),
    p: &[T],
    f_ext: Option<External<'_, T>>,
    ws: &mut Workspace<T>,
    out: &mut [T],
) {
    let moving = !qd.is_empty() && (set.damping || !arm.effects.list.is_empty());
    let motion = if moving { Motion::Velocity } else { Motion::Pose };
    pass(&arm.body, q, qd, motion, &mut ws.links);
    pass_masses(&arm.body, &ws.links, 0, motion, &mut ws.masses);
    accumulate(arm, set, p, f_ext, &ws.links, &ws.masses, &mut ws.effects, &mut ws.loads);
    project(&ws.links, &ws.loads, |i, force| {
        let f = force_on_lengths(force, arm.body.sections[i].inverse_radius);
        out[3 * i..3 * i + 3].copy_from_slice(&f.0);
    });
}

/// d tau/dp into `out` (coordinates x inputs, row by row): tau(q, p) = A(q) (p - p_amb), for all inputs at once.
pub fn actuation_matrix_into<T: Real>(arm: &Arm<T>, q: &[T], ws: &mut Workspace<T>, out: &mut [T]) {
    pass(&arm.body, q, &[], Motion::Pose, &mut ws.links);
    let mut p = vec![arm.body.ambient_pressure; arm.body.inputs];
    actuation_columns(arm, ws, &mut p, out);
}

/// The same from a pass in the work space, without allocating: `p` (one an input) is work space.
pub fn actuation_columns<T: Real>(arm: &Arm<T>, ws: &mut Workspace<T>, p: &mut [T], out: &mut [T]) {
    let inputs = arm.body.inputs;
    let set = ForceSet { actuation: true, ..ForceSet::NONE };
    p.fill(arm.body.ambient_pressure);
    for j in 0..inputs {
        p[j] = arm.body.ambient_pressure + 1.0;
        // One pascal above ambient loses digits against 1e5 Pa; the difference actually represented is divided out.
        let unit = (p[j] - arm.body.ambient_pressure).recip();
        accumulate(arm, set, p, None, &ws.links, &ws.masses, &mut ws.effects, &mut ws.loads);
        project(&ws.links, &ws.loads, |i, force| {
            let f = force_on_lengths(force * unit, arm.body.sections[i].inverse_radius);
            for k in 0..3 {
                out[(3 * i + k) * inputs + j] = f.0[k];
            }
        });
        p[j] = arm.body.ambient_pressure;
    }
}
