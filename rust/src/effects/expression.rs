//! Formulas as text: parsed into a program for a stack.
//!
//! The `syn` crate parses (its grammar is that of Rust expressions: + - * / with the usual precedence, function calls,
//! parentheses, decimal numbers); what remains here is to name what is allowed and to flatten the tree.

use crate::real::Real;
use syn::spanned::Spanned;
use syn::{BinOp, Expr, Lit, UnOp};

/// Most values on the stack.
pub const MAX_DEPTH: usize = 16;
const MAX_LENGTH: usize = 1000;
const MAX_NESTING: usize = 24;
const MAX_POWER: u32 = 16;

/// A function or a sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Unary {
    Negate,
    Abs,
    Exp,
    Sign,
    Sqrt,
    Tanh,
}

/// An operator or a function of two values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Binary {
    Add,
    Subtract,
    Multiply,
    Divide,
    Min,
    Max,
}

/// One instruction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Op {
    /// Pushes a number.
    Constant(f64),
    /// Pushes a variable.
    Variable(usize),
    /// Replaces the top.
    Unary(Unary),
    /// Replaces the two on top.
    Binary(Binary),
    /// Replaces the top by its power.
    Power(u32),
}

const UNARY: [(&str, Unary); 5] =
    [("abs", Unary::Abs), ("exp", Unary::Exp), ("sign", Unary::Sign), ("sqrt", Unary::Sqrt), ("tanh", Unary::Tanh)];
const FUNCTIONS: &str = "abs, exp, max, min, pow, sign, sqrt, tanh";

impl Unary {
    /// Its value.
    #[inline(always)]
    pub fn apply<T: Real>(self, x: T) -> T {
        match self {
            Self::Negate => -x,
            Self::Abs => x.abs(),
            Self::Exp => x.exp(),
            Self::Sign => T::select(x, T::one(), T::select(-x, -T::one(), T::zero())),
            Self::Sqrt => x.sqrt(),
            Self::Tanh => x.tanh(),
        }
    }
}

impl Binary {
    /// Its value.
    #[inline(always)]
    pub fn apply<T: Real>(self, a: T, b: T) -> T {
        match self {
            Self::Add => a + b,
            Self::Subtract => a - b,
            Self::Multiply => a * b,
            Self::Divide => a / b,
            Self::Min => a.min(b),
            Self::Max => a.max(b),
        }
    }
}

/// The program of `text` with variables `names`.
///
/// # Errors
/// What is wrong, at which character, and what is allowed.
pub fn parse(text: &str, names: &[&str]) -> Result<Vec<Op>, String> {
    if text.len() > MAX_LENGTH {
        return Err(format!("it has {} characters; at most {MAX_LENGTH} are allowed", text.len()));
    }
    // The parser recurses; what nests too deeply must not reach it.
    let (mut depth, mut signs) = (0_usize, 0);
    for c in text.chars() {
        match c {
            '(' | '[' | '{' => depth += 1,
            ')' | ']' | '}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        signs = match c {
            '-' | '!' | '*' | '&' => signs + 1,
            ' ' => signs,
            _ => 0,
        };
        if depth > MAX_NESTING || signs > 3 {
            return Err(format!("it nests too deeply; at most {MAX_NESTING} parentheses are allowed"));
        }
    }
    let tree: Expr = syn::parse_str(text).map_err(|e| {
        let end = text.trim_end().chars().count();
        let at = e.span().start().column;
        // The parser reports an unexpected end at the text's beginning.
        let at = if e.to_string().starts_with("unexpected end") { end } else { at };
        format!("at character {}: {e}; a formula such as \"-c * tanh(qd / v0)\" is needed", at + 1)
    })?;
    let mut out = Vec::new();
    flatten(&tree, names, &mut out)?;
    let mut depth = 0_usize;
    for op in &out {
        match op {
            Op::Constant(_) | Op::Variable(_) => depth += 1,
            Op::Binary(_) => depth -= 1,
            Op::Unary(_) | Op::Power(_) => {}
        }
        if depth > MAX_DEPTH {
            return Err(format!("it needs more than {MAX_DEPTH} intermediate values; split it into several effects"));
        }
    }
    Ok(out)
}

fn fault(part: &impl Spanned, what: &str) -> String {
    format!("at character {}: {what}", part.span().start().column + 1)
}

fn flatten(e: &Expr, names: &[&str], out: &mut Vec<Op>) -> Result<(), String> {
    match e {
        Expr::Paren(inner) => flatten(&inner.expr, names, out),
        Expr::Group(inner) => flatten(&inner.expr, names, out),
        Expr::Lit(lit) => {
            out.push(Op::Constant(number(&lit.lit).ok_or_else(|| fault(lit, "a decimal number is needed"))?));
            Ok(())
        }
        Expr::Path(path) => {
            let name = path.path.get_ident().map(ToString::to_string).unwrap_or_default();
            let Some(k) = names.iter().position(|n| *n == name) else {
                let what = format!("{name:?} is not known; {} are allowed", names.join(", "));
                return Err(fault(path, &what));
            };
            out.push(Op::Variable(k));
            Ok(())
        }
        Expr::Unary(unary) => {
            flatten(&unary.expr, names, out)?;
            match unary.op {
                UnOp::Neg(_) => out.push(Op::Unary(Unary::Negate)),
                UnOp::Deref(_) => return Err(fault(unary, "** is not allowed; write pow(x, 2)")),
                _ => return Err(fault(unary, "this sign is not allowed; + - * / are")),
            }
            Ok(())
        }
        Expr::Binary(binary) => {
            flatten(&binary.left, names, out)?;
            flatten(&binary.right, names, out)?;
            out.push(Op::Binary(match binary.op {
                BinOp::Add(_) => Binary::Add,
                BinOp::Sub(_) => Binary::Subtract,
                BinOp::Mul(_) => Binary::Multiply,
                BinOp::Div(_) => Binary::Divide,
                BinOp::BitXor(_) => return Err(fault(&binary.op, "^ is not allowed; write pow(x, 2)")),
                _ => return Err(fault(&binary.op, "this operator is not allowed; + - * / are")),
            }));
            Ok(())
        }
        Expr::Call(call) => function(call, names, out),
        _ => Err(fault(e, &format!("only numbers, names, + - * /, parentheses and {FUNCTIONS} are allowed"))),
    }
}

fn function(call: &syn::ExprCall, names: &[&str], out: &mut Vec<Op>) -> Result<(), String> {
    let name = match &*call.func {
        Expr::Path(path) => path.path.get_ident().map(ToString::to_string).unwrap_or_default(),
        _ => String::new(),
    };
    let arguments: Vec<&Expr> = call.args.iter().collect();
    let needs = |n: usize| {
        let found = arguments.len();
        if found == n { Ok(()) } else { Err(fault(call, &format!("{name} takes {n} arguments, found {found}"))) }
    };
    if let Some((_, unary)) = UNARY.iter().find(|(n, _)| *n == name) {
        needs(1)?;
        flatten(arguments[0], names, out)?;
        out.push(Op::Unary(*unary));
        return Ok(());
    }
    if !["min", "max", "pow"].contains(&name.as_str()) {
        return Err(fault(call, &format!("{name:?} is not a function; {FUNCTIONS} are allowed")));
    }
    needs(2)?;
    flatten(arguments[0], names, out)?;
    if name == "pow" {
        let power = match arguments[1] {
            Expr::Lit(lit) => number(&lit.lit),
            _ => None,
        };
        let Some(n) = power.filter(|n| n.fract() == 0.0 && (1.0..=f64::from(MAX_POWER)).contains(n)) else {
            return Err(fault(arguments[1], &format!("the power must be a whole number from 1 to {MAX_POWER}")));
        };
        out.push(Op::Power(n as u32));
        return Ok(());
    }
    flatten(arguments[1], names, out)?;
    out.push(Op::Binary(if name == "min" { Binary::Min } else { Binary::Max }));
    Ok(())
}

fn number(lit: &Lit) -> Option<f64> {
    // As it is written: no hexadecimal digits, no suffix of a type.
    let text = match lit {
        Lit::Int(i) => i.to_string(),
        Lit::Float(f) => f.to_string(),
        _ => return None,
    };
    text.parse().ok().filter(|value: &f64| value.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::kinds::formula::Program;

    fn text_of(text: &str) -> String {
        parse(text, &["q", "c"]).unwrap_err()
    }

    #[test]
    fn faults_point_at_the_formula() {
        assert!(text_of("q + x").contains("at character 5: \"x\" is not known; q, c are allowed"));
        assert!(text_of("q ** 2").contains("pow(x, 2)"), "{}", text_of("q ** 2"));
        assert!(text_of("q ^ 2").contains("at character 3: ^ is not allowed"));
        assert!(text_of("sin(q)").contains("at character 1: \"sin\" is not a function"));
        assert!(text_of("q +").contains("at character 4"), "{}", text_of("q +"));
        assert!(text_of("").contains("at character 1"));
        assert!(text_of("pow(q, c)").contains("whole number"));
        assert!(text_of("tanh(q, c)").contains("takes 1 arguments, found 2"));
        assert!(text_of("q; c").contains("at character 2"));
        assert!(text_of("0x10 * q").contains("at character 1: a decimal number is needed"));
        assert!(text_of("1f64 * q").contains("decimal") && text_of("1e999 * q").contains("decimal"));
        assert_eq!(parse("1e-3", &[]).unwrap(), [Op::Constant(1e-3)]);
        assert!(text_of("{ loop {} }").contains("at character "));
        assert!(text_of(&"(".repeat(500)).contains("nests too deeply"));
        assert!(text_of(&"-".repeat(900)).contains("nests too deeply"));
        assert!(text_of(&format!("q{}", " - (q".repeat(20) + &")".repeat(20))).contains("intermediate"));
        assert!(Program::parse("q", &["q"]).unwrap_err().contains("name of a variable"));
        assert!(Program::parse("q", &["c"]).unwrap_err().contains("does not occur"));
    }
}
