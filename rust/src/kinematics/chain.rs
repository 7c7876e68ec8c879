//! The chain of sections: poses, motion subspaces, velocities and velocity-product accelerations in the world.
//!
//! Source, frame and limits: those of [`link`](super::link), which is one step of it.

use super::arcs;
use super::link::{Link, Local, Motion, step, subspace_rate_about_origin};
use super::section::Subspace;
use crate::body::{Body, PointMass};
use crate::real::linear::Vec3;
use crate::real::{Real, kernel};
use std::ops::Range;

/// Three entries of `x`, those of section `i`.
#[inline(always)]
fn three<T: Real>(x: &[T], i: usize) -> Vec3<T> {
    Vec3([x[3 * i], x[3 * i + 1], x[3 * i + 2]])
}

kernel! {
    /// The whole chain at lengths `q` and rates `qd` (3 a section each; `qd` is not read for [`Motion::Pose`]).
    pub fn pass<'a, T>(body: &'a Body<T>, q: &'a [T], qd: &'a [T], motion: Motion, links: &'a mut [Link<T>]) {
        let mut below = Link::of_base(&body.base);
        for (i, (section, link)) in body.sections.iter().zip(links.iter_mut()).enumerate() {
            let rates = if motion == Motion::Pose { Vec3::zero() } else { three(qd, i) };
            if section.arcs.is_empty() {
                let local = Local::new(section, three(q, i), rates, motion);
                below = step(&below, &local, section.center_of_mass, motion);
            } else {
                let local = arcs::local_of_lengths(section, three(q, i), rates, motion);
                below = step(&below, &local, section.center_of_mass, motion);
            }
            *link = below;
        }
    }
}

kernel! {
    /// The same from section `own.start` on, above links that stay as they are: sections of `own` at `q` and `qd` (read
    /// for every motion), those above it at their `locals`, which are noted for `own`.
    pub fn pass_again<'a, T>(
        body: &'a Body<T>,
        q: &'a [T],
        qd: &'a [T],
        motion: Motion,
        own: Range<usize>,
        locals: &'a mut [Local<T>],
        links: &'a mut [Link<T>],
    ) {
        let mut below = if own.start == 0 { Link::of_base(&body.base) } else { links[own.start - 1] };
        for (i, section) in body.sections.iter().enumerate().skip(own.start) {
            if i < own.end {
                locals[i] = if section.arcs.is_empty() {
                    Local::new(section, three(q, i), three(qd, i), motion)
                } else {
                    arcs::local_of_lengths(section, three(q, i), three(qd, i), motion)
                };
            }
            below = step(&below, &locals[i], section.center_of_mass, motion);
            links[i] = below;
        }
    }
}

/// A mass at `share` of section `i`, with its centre of mass at `offset` there, as a link of its own.
#[inline(always)]
pub fn mass_link<T: Real>(body: &Body<T>, links: &[Link<T>], i: usize, mass: &PointMass<T>, motion: Motion) -> Link<T> {
    let below = if i == 0 { Link::of_base(&body.base) } else { links[i - 1] };
    let local = arcs::local(&body.sections[i], links[i].arc, links[i].rate, Some(mass.share), motion);
    step(&below, &local, mass.offset, motion)
}

kernel! {
    /// The masses along the sections from section `from` on, section by section, after a pass of the same motion.
    fn pass_each_mass<'a, T>(
        body: &'a Body<T>,
        links: &'a [Link<T>],
        from: usize,
        motion: Motion,
        masses: &'a mut [Link<T>],
    ) {
        let mut next = 0;
        for (i, section) in body.sections.iter().enumerate() {
            for mass in &section.masses {
                if i >= from {
                    masses[next] = mass_link(body, links, i, mass, motion);
                }
                next += 1;
            }
        }
    }
}

/// The same, for arms that have some.
#[inline(always)]
pub fn pass_masses<T: Real>(body: &Body<T>, links: &[Link<T>], from: usize, motion: Motion, masses: &mut [Link<T>]) {
    if !masses.is_empty() {
        pass_each_mass(body, links, from, motion, masses);
    }
}

/// The subspaces' time derivatives about O, for the Coriolis matrix. Needs a pass with [`Motion::Velocity`] or more.
pub fn subspace_rate<T: Real>(body: &Body<T>, links: &[Link<T>], index: usize) -> Subspace<T> {
    rate_of(body, links, index, &links[index], None)
}

/// The same of a mass along section `index`.
pub fn mass_subspace_rate<T: Real>(
    body: &Body<T>,
    links: &[Link<T>],
    index: usize,
    mass: &PointMass<T>,
    link: &Link<T>,
) -> Subspace<T> {
    rate_of(body, links, index, link, Some(mass.share))
}

fn rate_of<T: Real>(body: &Body<T>, links: &[Link<T>], index: usize, link: &Link<T>, share: Option<T>) -> Subspace<T> {
    let base = Link::of_base(&body.base);
    let below = if index == 0 { &base } else { &links[index - 1] };
    let (local, rate) = arcs::subspace_and_rate(&body.sections[index], link.arc, link.rate, share);
    subspace_rate_about_origin(below, link, &local, &rate)
}
