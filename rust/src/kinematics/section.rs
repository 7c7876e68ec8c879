//! One section as a joint with three degrees of freedom: pose, motion subspace, and their rates.
//!
//! Source: paper (9), (11) with (66)-(73), restated in (u, v, l): R = exp([w]x), w = (-v, u, 0), p = l [u b, v b, a];
//! the angular part of the motion subspace is the left Jacobian of SO(3), J = 1 + b [w]x + d [w]x^2
//! (Lynch & Park, *Modern Robotics*, sec. 3.2.3).
//! Frame: everything in the section's base frame (the head frame of the section below). The pose includes the rigid
//! pieces: base_offset along z before the arc, head_offset along z after it.
//! Limits: psi <= PSI_MAX of `arc`.

use super::arc::ArcFunctions;
use crate::real::Real;
use crate::real::linear::{Mat3, Vec3};

/// Pose of the head in the section's base frame.
#[derive(Clone, Copy, Debug)]
pub struct Pose<T> {
    /// Orientation.
    pub rotation: Mat3<T>,
    /// Origin, m.
    pub position: Vec3<T>,
}

/// How the head moves with u, v, l: columns of the motion subspace. Column l has no angular part.
#[derive(Clone, Copy, Debug)]
pub struct Subspace<T> {
    /// Angular velocity per unit rate of u and v.
    pub angular: [Vec3<T>; 2],
    /// Velocity of the head's origin per unit rate of u, v and l.
    pub linear: [Vec3<T>; 3],
}

/// The part of the head's relative acceleration that is quadratic in the rates.
#[derive(Clone, Copy, Debug)]
pub struct Bias<T> {
    /// Angular, rad/s^2.
    pub angular: Vec3<T>,
    /// Linear, m/s^2.
    pub linear: Vec3<T>,
}

impl<T: Real> Bias<T> {
    /// No acceleration.
    #[inline(always)]
    pub fn zero() -> Self {
        Self { angular: Vec3::zero(), linear: Vec3::zero() }
    }
}

/// A section at (u, v, l): arc functions and what recurs.
#[derive(Clone, Copy, Debug)]
pub struct Bent<T> {
    arc: Vec3<T>,
    f: ArcFunctions<T>,
    base_offset: T,
    head_offset: T,
    /// g = l b + h a: lateral reach per unit of (u, v), with h the head offset.
    g: T,
    /// dg/ds.
    g_s: T,
    /// Derivative by s of k = l a + h cos(psi), the reach along z.
    k_s: T,
}

impl<T: Real> Bent<T> {
    /// The section with rigid pieces `base_offset` and `head_offset` at `arc` = (u, v, l).
    #[inline(always)]
    pub fn new(arc: Vec3<T>, base_offset: T, head_offset: T) -> Self {
        let [u, v, l] = arc.0;
        let f = ArcFunctions::new(u * u + v * v);
        Self {
            arc,
            f,
            base_offset,
            head_offset,
            g: head_offset.mul_add(f.a(), l * f.b()),
            g_s: head_offset.mul_add(f.a_s(), l * f.b_s()),
            k_s: l.mul_sub(f.a_s(), head_offset * f.a() * 0.5),
        }
    }

    /// Pose of the head.
    #[inline(always)]
    pub fn pose(&self) -> Pose<T> {
        let ([u, v, l], a, b, c) = (self.arc.0, self.f.a(), self.f.b(), self.f.cos());
        let (ua, va, ub) = (u * a, v * a, u * b);
        let uvb = ub * v;
        Pose {
            rotation: Mat3([
                [ub.neg_mul_add(u, T::one()), -uvb, ua],
                [-uvb, (v * v).neg_mul_add(b, T::one()), va],
                [-ua, -va, c],
            ]),
            position: Vec3([u * self.g, v * self.g, l.mul_add(a, self.head_offset.mul_add(c, self.base_offset))]),
        }
    }

    /// The motion subspace.
    #[inline(always)]
    pub fn subspace(&self) -> Subspace<T> {
        let ([u, v, _], a, b, d) = (self.arc.0, self.f.a(), self.f.b(), self.f.d());
        let (duv, ug, vg) = (d * u * v, u * self.g_s * 2.0, v * self.g_s * 2.0);
        let uvg = ug * v;
        Subspace {
            angular: [Vec3([-duv, (d * u).mul_add(u, a), -(b * v)]), Vec3([-(d * v).mul_add(v, a), duv, b * u])],
            linear: [
                Vec3([ug.mul_add(u, self.g), uvg, u * self.k_s * 2.0]),
                Vec3([uvg, vg.mul_add(v, self.g), v * self.k_s * 2.0]),
                Vec3([u * b, v * b, a]),
            ],
        }
    }

    /// Second derivatives by s of g and k.
    #[inline(always)]
    fn second(&self) -> (T, T) {
        let l = self.arc.z();
        (
            self.head_offset.mul_add(self.f.a_ss(), l * self.f.b_ss()),
            l.mul_sub(self.f.a_ss(), self.head_offset * self.f.a_s() * 0.5),
        )
    }

    /// Acceleration of the head at rates (u', v', l') when u'' = v'' = l'' = 0.
    #[inline(always)]
    pub fn bias(&self, rate: Vec3<T>) -> Bias<T> {
        let ([u, v, _], [du, dv, dl]) = (self.arc.0, rate.0);
        let f = &self.f;
        let (g_ss, k_ss) = self.second();
        // sigma = ds/dt / 2, nu = its own derivative at zero acceleration, xi = u v' - v u'.
        let (sigma, nu, xi) = (v.mul_add(dv, u * du), dv.mul_add(dv, du * du), u.mul_sub(dv, v * du));
        let sigma2 = sigma * sigma * 4.0;
        let turn = f.a_s().mul_add(T::from_f64(2.0), f.d()) * sigma;
        let stretch = f.d_s().mul_add(sigma2 * 0.5, f.d() * nu);
        let g_t = self.g_s.mul_add(sigma * 2.0, f.b() * dl) * 2.0;
        let (nu2, sigma_dl4) = (nu * 2.0, sigma * dl * 4.0);
        let g_tt = g_ss.mul_add(sigma2, self.g_s.mul_add(nu2, f.b_s() * sigma_dl4));
        let k_tt = k_ss.mul_add(sigma2, self.k_s.mul_add(nu2, f.a_s() * sigma_dl4));
        let angular = [turn.mul_add(dv, stretch * v), turn.mul_add(du, stretch * u)];
        Bias {
            angular: Vec3([-angular[0], angular[1], f.b_s() * sigma * xi * 2.0]),
            linear: Vec3([g_t.mul_add(du, g_tt * u), g_t.mul_add(dv, g_tt * v), k_tt]),
        }
    }

    /// Time derivative of the motion subspace in the section's base frame, at rates (u', v', l').
    #[inline(always)]
    pub fn subspace_rate(&self, rate: Vec3<T>) -> Subspace<T> {
        let ([u, v, _], [du, dv, dl]) = (self.arc.0, rate.0);
        let f = &self.f;
        let (g_ss, k_ss) = self.second();
        let s_t = (u * du + v * dv) * 2.0;
        let (a_t, b_t, d_t) = (f.a_s() * s_t, f.b_s() * s_t, f.d_s() * s_t);
        let g_t = self.g_s * s_t + f.b() * dl;
        let g_st = g_ss * s_t + f.b_s() * dl;
        let k_st = k_ss * s_t + f.a_s() * dl;
        let cross = u * dv + v * du;
        let duv_t = d_t * u * v + f.d() * cross;
        let uvg_t = (self.g_s * cross + g_st * u * v) * 2.0;
        Subspace {
            angular: [
                Vec3([-duv_t, a_t + d_t * u * u + f.d() * u * du * 2.0, -(b_t * v + f.b() * dv)]),
                Vec3([-(a_t + d_t * v * v + f.d() * v * dv * 2.0), duv_t, b_t * u + f.b() * du]),
            ],
            linear: [
                Vec3([g_t + u * du * self.g_s * 4.0 + u * u * g_st * 2.0, uvg_t, (du * self.k_s + u * k_st) * 2.0]),
                Vec3([uvg_t, g_t + v * dv * self.g_s * 4.0 + v * v * g_st * 2.0, (dv * self.k_s + v * k_st) * 2.0]),
                Vec3([du * f.b() + u * b_t, dv * f.b() + v * b_t, a_t]),
            ],
        }
    }
}

impl<T: Real> Subspace<T> {
    /// Nothing moves.
    #[inline(always)]
    pub fn zero() -> Self {
        Self { angular: [Vec3::zero(); 2], linear: [Vec3::zero(); 3] }
    }

    /// Adds that of another joint about the same point.
    #[inline(always)]
    pub fn add(&mut self, other: &Self) {
        for k in 0..2 {
            self.angular[k] += other.angular[k];
        }
        for k in 0..3 {
            self.linear[k] += other.linear[k];
        }
    }

    /// The columns times `shares`: the motion by rates of which the joint has these shares.
    #[inline(always)]
    pub fn scaled(&self, shares: Vec3<T>) -> Self {
        let ([a, b], [c, d, e], [u, v, l]) = (self.angular, self.linear, shares.0);
        Self { angular: [a * u, b * v], linear: [c * u, d * v, e * l] }
    }

    /// The same with the velocity of the point at `position` instead of that at the origin.
    #[inline(always)]
    pub fn moved(&self, position: Vec3<T>) -> Self {
        let ([a, b], [c, d, e]) = (self.angular, self.linear);
        Self { angular: [a, b], linear: [c + a.cross(position), d + b.cross(position), e] }
    }

    /// The same over another scalar.
    #[inline(always)]
    pub fn lifted(s: &Subspace<f64>) -> Self {
        let ([a, b], [c, d, e]) = (s.angular, s.linear);
        Self {
            angular: [Vec3::from_f64(a.0), Vec3::from_f64(b.0)],
            linear: [Vec3::from_f64(c.0), Vec3::from_f64(d.0), Vec3::from_f64(e.0)],
        }
    }

    /// Angular and linear velocity at the given rates.
    #[inline(always)]
    pub fn twist(&self, rate: Vec3<T>) -> (Vec3<T>, Vec3<T>) {
        let [du, dv, dl] = rate.0;
        (
            self.angular[1].mul_add(dv, self.angular[0] * du),
            self.linear[2].mul_add(dl, self.linear[1].mul_add(dv, self.linear[0] * du)),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::real::Dual;
    use proptest::prelude::*;

    type D = Dual<1>;

    fn along(value: Vec3<f64>, rate: Vec3<f64>) -> Vec3<D> {
        let mut out = Vec3::zero();
        for k in 0..3 {
            out.0[k] = D { value: value.0[k], derivative: [rate.0[k]] };
        }
        out
    }

    fn derivative(v: Vec3<D>) -> Vec3<f64> {
        Vec3(v.0.map(|x| x.derivative[0]))
    }

    fn close(a: Vec3<f64>, b: Vec3<f64>) -> bool {
        a.0.iter().zip(b.0).all(|(x, y)| (x - y).abs() < 1e-13 * (1.0 + x.abs()))
    }

    /// Subspace, its rate and the bias against automatic differentiation of the pose alone.
    fn check(arc: [f64; 3], rate: [f64; 3]) -> bool {
        let (arc, rate) = (Vec3(arc), Vec3(rate));
        let (base, head) = (0.03, 0.02);
        let bent = Bent::new(arc, base, head);
        let dual = Bent::new(along(arc, rate), D::from_f64(base), D::from_f64(head));
        let (omega, velocity) = bent.subspace().twist(rate);
        let pose = dual.pose();
        // [omega]x = R' R^T, paper (24).
        let mut rotation_rate = Mat3::zero();
        for i in 0..3 {
            for j in 0..3 {
                rotation_rate.0[i][j] = pose.rotation.0[i][j].derivative[0];
            }
        }
        let expected = Mat3::cross_matrix(omega).mul_mat(&bent.pose().rotation);
        let rows = (0..3).all(|i| close(Vec3(rotation_rate.0[i]), Vec3(expected.0[i])));
        let (s, s_t) = (dual.subspace(), bent.subspace_rate(rate));
        let columns = (0..2).all(|k| close(derivative(s.angular[k]), s_t.angular[k]))
            && (0..3).all(|k| close(derivative(s.linear[k]), s_t.linear[k]));
        let (alpha, acceleration) = s_t.twist(rate);
        let bias = bent.bias(rate);
        rows && columns
            && close(derivative(pose.position), velocity)
            && close(alpha, bias.angular)
            && close(acceleration, bias.linear)
    }

    #[test]
    fn straight_and_nearly_straight() {
        for e in [0.0, 1e-12, 1e-9, 1e-6, 1e-3] {
            assert!(check([e, -0.5 * e, 0.2], [0.7, -1.1, 0.3]), "at {e}");
        }
    }

    proptest! {
        #[test]
        fn anywhere(arc in (-3.0..3.0_f64, -3.0..3.0_f64, 0.05..0.4_f64), rate in prop::array::uniform3(-3.0..3.0_f64)) {
            prop_assert!(check([arc.0, arc.1, arc.2], rate));
        }

        #[test]
        fn rotation_is_orthogonal(u in -4.0..4.0_f64, v in -4.0..4.0_f64) {
            let r = Bent::new(Vec3([u, v, 0.2]), 0.0, 0.0).pose().rotation;
            for i in 0..3 {
                for j in 0..3 {
                    prop_assert!((Vec3(r.0[i]).dot(Vec3(r.0[j])) - f64::from(i == j)).abs() < 1e-13);
                }
            }
        }
    }
}
