//! Every operation of every instruction set that this processor has, lane by lane against `f64`.

use super::*;

/// Numbers of all sizes, some special.
fn numbers() -> Vec<f64> {
    let spread = (0..4000).map(|k| (f64::from(k) * 0.618_033_988_75).fract() * 40.0 - 20.0);
    let wide = (0..3000).map(|k| f64::from(k) * 0.48 - 720.0);
    let small = (0..600).map(|k| 10.0_f64.powf(-f64::from(k) * 0.5) * if k % 2 == 0 { 1.0 } else { -1.0 });
    let near_one = (1..400).map(|k| 1.0 + 2e-3 * (f64::from(k) - 200.0) * 0.7_f64.powi(k % 40));
    let special =
        [0.0, -0.0, 0.625, -0.625, 709.7, -708.3, 1e-310, 1e300, -1e300, f64::INFINITY, f64::NEG_INFINITY, f64::NAN];
    spread.chain(wide).chain(small).chain(near_one).chain(special).collect()
}

struct Check;

fn unit_error(found: f64, expected: f64) -> f64 {
    if found == expected || (found.is_nan() && expected.is_nan()) {
        return 0.0;
    }
    ((found - expected) / expected).abs()
}

impl AnyLanes for Check {
    type Output = [f64; 3];
    fn with<T: Real>(self) -> [f64; 3] {
        struct Inner<T>(std::marker::PhantomData<T>);
        impl<T: Real> Kernel for Inner<T> {
            type Output = [f64; 3];
            #[inline(always)]
            fn run(self) -> [f64; 3] {
                let all = numbers();
                let mut worst = [0.0_f64; 3];
                for k in 0..all.len() {
                    let at = |offset: usize| all[(k * 7 + offset) % all.len()];
                    let [a, b, c] = [0, 1000, 2222].map(|o| T::from_lanes(|j| at(o + j)));
                    let elementary = [(a.exp(), f64::exp as fn(f64) -> f64), (a.tanh(), f64::tanh)];
                    for (which, (found, f)) in elementary.into_iter().enumerate() {
                        for j in 0..T::LANES {
                            let (found, expected) = (found.lane(j), f(at(j)));
                            // Subnormal results have fewer digits.
                            if expected.is_nan() || expected.abs() >= f64::MIN_POSITIVE {
                                worst[which] = worst[which].max(unit_error(found, expected));
                            } else {
                                assert!((found - expected).abs() <= 1e-323, "{found:e} {expected:e}");
                            }
                        }
                    }
                    for j in 0..T::LANES {
                        let (found, x) = (a.ln().lane(j), at(j));
                        if x.is_normal() && x > 0.0 {
                            worst[2] = worst[2].max(unit_error(found, x.ln()));
                        } else if x < 0.0 || !x.is_finite() && T::LANES > 1 {
                            assert!(found.is_nan(), "{x:e} {found:e}");
                        }
                    }
                    for j in 0..T::LANES {
                        let (x, y, z) = (at(j), at(1000 + j), at(2222 + j));
                        // Fused or rounded twice.
                        let fused = |found: f64, exact: f64, plain: f64| {
                            let same = |p: f64, q: f64| p == q || (p.is_nan() && q.is_nan());
                            assert!(same(found, exact) || same(found, plain), "{x:e} {y:e} {z:e}: {found:e}");
                        };
                        fused(a.mul_add(b, c).lane(j), x.mul_add(y, z), x * y + z);
                        fused(a.mul_sub(b, c).lane(j), x.mul_add(y, -z), x * y - z);
                        fused(a.neg_mul_add(b, c).lane(j), (-x).mul_add(y, z), z - x * y);
                        for (found, expected) in [
                            (a + b, x + y),
                            (a - b, x - y),
                            (a * b, x * y),
                            (a / b, x / y),
                            (-a, -x),
                            (a.abs(), x.abs()),
                            (a.sqrt(), x.sqrt()),
                            (T::select(a, b, c), if x > 0.0 { y } else { z }),
                            (a + 0.1, x + 0.1),
                        ] {
                            let found = found.lane(j);
                            assert!(found.to_bits() == expected.to_bits() || found.is_nan() && expected.is_nan());
                        }
                    }
                    assert_eq!(a.is_finite(), (0..T::LANES).all(|j| at(j).is_finite()));
                    let largest = (0..T::LANES).map(at).fold(f64::NEG_INFINITY, f64::max);
                    assert!(a.largest() == largest || (0..T::LANES).any(|j| at(j).is_nan()) && a.largest().is_nan());
                }
                worst
            }
        }
        T::enter(Inner::<T>(std::marker::PhantomData))
    }
}

#[test]
fn every_instruction_set_computes_what_f64_does() {
    for set in InstructionSet::ALL.into_iter().filter(|s| s.is_available()) {
        let [exp, tanh, ln] = dispatch(set, Check);
        assert!(exp < 3e-16 && tanh < 5e-16 && ln < 5e-16, "{set:?}: exp {exp:e}, tanh {tanh:e}, ln {ln:e}");
    }
}

/// Where there is no NEON its instructions are emulated.
#[test]
fn neon_computes_what_f64_does() {
    let [exp, tanh, ln] = Check.with::<Lanes<super::neon::Neon>>();
    assert!(exp < 3e-16 && tanh < 5e-16 && ln < 5e-16, "exp {exp:e}, tanh {tanh:e}, ln {ln:e}");
}

#[test]
fn names() {
    for set in InstructionSet::ALL {
        assert_eq!(InstructionSet::by_name(set.name()), Some(set));
    }
    assert!(InstructionSet::best().is_available());
}
