//! The instructions of NEON that `neon` uses, in ordinary numbers: what they compute can then be tested on any processor.
//!
//! Source: Arm, *Neon Intrinsics Reference*. Names and signatures are those of `std::arch::aarch64`.
//! Limits: says nothing about the instructions themselves, nor about what the compiler makes of them.

#![allow(non_camel_case_types, clippy::missing_safety_doc)]

#[derive(Clone, Copy, Debug)]
pub struct float64x2_t([f64; 2]);
#[derive(Clone, Copy)]
pub struct uint64x2_t([u64; 2]);
#[derive(Clone, Copy)]
pub struct int64x2_t([i64; 2]);

macro_rules! each {
    ($($name:ident($($a:ident: $from:ident),+) -> $to:ident = $result:expr;)+) => {
        $(pub unsafe fn $name($($a: $from),+) -> $to {
            let one = |k: usize| { $(let $a = $a.0[k];)+ $result };
            $to([one(0), one(1)])
        })+
    };
}

each! {
    vaddq_f64(a: float64x2_t, b: float64x2_t) -> float64x2_t = a + b;
    vsubq_f64(a: float64x2_t, b: float64x2_t) -> float64x2_t = a - b;
    vmulq_f64(a: float64x2_t, b: float64x2_t) -> float64x2_t = a * b;
    vdivq_f64(a: float64x2_t, b: float64x2_t) -> float64x2_t = a / b;
    vfmaq_f64(a: float64x2_t, b: float64x2_t, c: float64x2_t) -> float64x2_t = b.mul_add(c, a);
    vfmsq_f64(a: float64x2_t, b: float64x2_t, c: float64x2_t) -> float64x2_t = (-b).mul_add(c, a);
    vnegq_f64(a: float64x2_t) -> float64x2_t = -a;
    vabsq_f64(a: float64x2_t) -> float64x2_t = a.abs();
    vsqrtq_f64(a: float64x2_t) -> float64x2_t = a.sqrt();
    vcgtzq_f64(a: float64x2_t) -> uint64x2_t = if a > 0.0 { u64::MAX } else { 0 };
    vbslq_f64(mask: uint64x2_t, a: float64x2_t, b: float64x2_t) -> float64x2_t =
        f64::from_bits((a.to_bits() & mask) | (b.to_bits() & !mask));
    vandq_u64(a: uint64x2_t, b: uint64x2_t) -> uint64x2_t = a & b;
    vorrq_u64(a: uint64x2_t, b: uint64x2_t) -> uint64x2_t = a | b;
    vreinterpretq_u64_f64(a: float64x2_t) -> uint64x2_t = a.to_bits();
    vreinterpretq_f64_u64(a: uint64x2_t) -> float64x2_t = f64::from_bits(a);
    vreinterpretq_s64_f64(a: float64x2_t) -> int64x2_t = a.to_bits().cast_signed();
    vreinterpretq_f64_s64(a: int64x2_t) -> float64x2_t = f64::from_bits(a.cast_unsigned());
}

pub unsafe fn vdupq_n_f64(x: f64) -> float64x2_t {
    float64x2_t([x; 2])
}

pub unsafe fn vdupq_n_u64(x: u64) -> uint64x2_t {
    uint64x2_t([x; 2])
}

pub unsafe fn vshlq_n_s64<const N: u32>(a: int64x2_t) -> int64x2_t {
    int64x2_t(a.0.map(|a| a << N))
}

pub unsafe fn vshrq_n_u64<const N: u32>(a: uint64x2_t) -> uint64x2_t {
    uint64x2_t(a.0.map(|a| a >> N))
}

pub unsafe fn vld1q_f64(from: *const f64) -> float64x2_t {
    // SAFETY: the caller's, as for the instruction.
    float64x2_t(unsafe { [*from, *from.add(1)] })
}

pub unsafe fn vst1q_f64(to: *mut f64, a: float64x2_t) {
    // SAFETY: the caller's, as for the instruction.
    unsafe { (*to, *to.add(1)) = (a.0[0], a.0[1]) };
}
