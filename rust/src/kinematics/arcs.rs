//! A section of several arcs, or a part of a section up to a share of its length, as a joint.
//!
//! Source: paper (6), (8), (13): arc j has the shares (beta_j u, beta_j v, lambda_j l) of the section's (u, v, l), of the one
//! in which the part ends a part of these (a part of an arc is an arc), and stands on the arc below. About one common
//! point the motion subspace of the whole is the sum of the arcs', the columns of each scaled by its shares; bias
//! accelerations add up along the arcs as along sections.
//! Frame: the section's base frame. The rigid pieces stand before the first and, for the whole, behind the last arc.
//! Limits: those of `section` for each arc.

use super::coordinates::arc_from_lengths;
use super::link::{Link, Local, Motion, step, subspace_rate_about_origin};
use super::section::{Bent, Bias, Pose, Subspace};
use crate::body::{Section, SectionArc};
use crate::real::linear::Vec3;
use crate::real::{Real, kernel};

/// Number of arcs.
#[inline(always)]
fn count<T>(section: &Section<T>) -> usize {
    section.arcs.len().max(1)
}

/// Arc `j` of a part with the shares of (u, v, l) that it has; `start` is where it begins and then where it ends.
#[inline(always)]
fn bent<T: Real>(section: &Section<T>, j: usize, arc: Vec3<T>, share: Option<T>, start: &mut T) -> (Bent<T>, Vec3<T>) {
    let one = T::one();
    let whole = SectionArc { length: one, bending: one, relative_radius: one, relative_area: one };
    let own = if section.arcs.is_empty() { whole } else { section.arcs[j] };
    let part = match share {
        None => one,
        Some(end) => ((end - *start) / own.length).max(T::zero()).min(one),
    };
    *start += own.length;
    let (bending, length) = (own.bending * part, own.length * part);
    let shares = Vec3([bending, bending, length]);
    let base = if j == 0 { section.base_offset } else { T::zero() };
    let head = if share.is_none() && j + 1 == count(section) { section.head_offset } else { T::zero() };
    (Bent::new(arc.times(shares), base, head), shares)
}

/// What one arc adds to the chain of them: the section's rates move it by its shares.
#[inline(always)]
fn link_of<T: Real>(bent: &Bent<T>, shares: Vec3<T>, arc: Vec3<T>, rate: Vec3<T>, motion: Motion) -> Local<T> {
    let bias = if motion == Motion::Bias { bent.bias(rate.times(shares)) } else { Bias::zero() };
    Local { arc, rate, pose: bent.pose(), subspace: bent.subspace().scaled(shares), bias }
}

/// `section` of several arcs at three lengths, with their rates.
#[inline(always)]
pub(super) fn local_of_lengths<T: Real>(
    section: &Section<T>,
    lengths: Vec3<T>,
    rates: Vec3<T>,
    motion: Motion,
) -> Local<T> {
    let arc = arc_from_lengths(lengths, section.inverse_radius);
    let rate = arc_from_lengths(rates, section.inverse_radius);
    local(section, arc, rate, None, motion)
}

/// `section`, or its part up to a share of its length, at (u, v, l) and their rates.
#[inline(always)]
pub(super) fn local<T: Real>(
    section: &Section<T>,
    arc: Vec3<T>,
    rate: Vec3<T>,
    share: Option<T>,
    motion: Motion,
) -> Local<T> {
    let mut local = Local::zero();
    local_into(section, arc, rate, share, motion, &mut local);
    local
}

kernel! {
    /// The section at `arc` = (u, v, l) and `rate`, or its part up to `share` of its length, into `out`.
    pub(super) fn local_into<'a, T>(
        section: &'a Section<T>,
        arc: Vec3<T>,
        rate: Vec3<T>,
        share: Option<T>,
        motion: Motion,
        out: &'a mut Local<T>,
    ) {
        let (mut link, mut start) = (Link::base(), T::zero());
        let mut subspace = Subspace::zero();
        for j in 0..count(section) {
            let (bent, shares) = bent(section, j, arc, share, &mut start);
            link = step(&link, &link_of(&bent, shares, arc, rate, motion), Vec3::zero(), motion);
            subspace.add(&link.subspace);
        }
        *out = Local {
            arc,
            rate,
            pose: Pose { rotation: link.rotation, position: link.position },
            subspace: subspace.moved(link.position),
            bias: Bias { angular: link.angular_acceleration, linear: link.acceleration },
        };
    }
}

/// Motion subspace and its time derivative in the section's base frame, of the whole or of the part up to `share`.
pub(super) fn subspace_and_rate<T: Real>(
    section: &Section<T>,
    arc: Vec3<T>,
    rate: Vec3<T>,
    share: Option<T>,
) -> (Subspace<T>, Subspace<T>) {
    if section.arcs.is_empty() && share.is_none() {
        let bent = Bent::new(arc, section.base_offset, section.head_offset);
        return (bent.subspace(), bent.subspace_rate(rate));
    }
    let (mut below, mut start) = (Link::base(), T::zero());
    let (mut subspace, mut derivative) = (Subspace::zero(), Subspace::zero());
    for j in 0..count(section) {
        let (bent, shares) = bent(section, j, arc, share, &mut start);
        let local = link_of(&bent, shares, arc, rate, Motion::Velocity);
        let link = step(&below, &local, Vec3::zero(), Motion::Velocity);
        let own = bent.subspace_rate(rate.times(shares)).scaled(shares);
        subspace.add(&link.subspace);
        derivative.add(&subspace_rate_about_origin(&below, &link, &local.subspace, &own));
        below = link;
    }
    // From the origin to the end of the arcs, which moves.
    let mut moved = derivative.moved(below.position);
    for k in 0..2 {
        moved.linear[k] += subspace.angular[k].cross(below.velocity);
    }
    (subspace.moved(below.position), moved)
}
