//! Formulas as text: parsed into a program for a stack.
//!
//! Grammar, with the usual precedence; `name` is a variable or a number of the table:
//!
//! ```text
//! sum     = product { ("+" | "-") product }
//! product = factor { ("*" | "/") factor }
//! factor  = "-" factor | number | name | function "(" sum { "," sum } ")" | "(" sum ")"
//! ```
//!
//! The parser descends once a parenthesis or sign, of which there may be a few in one another: whatever the text, it needs
//! little stack, time that grows with the length alone, and leaves nothing behind.

use crate::real::Real;

/// Most values on the stack.
pub const MAX_DEPTH: usize = 16;
const MAX_LENGTH: usize = 1000;
const MAX_NESTING: usize = 24;
const MAX_SIGNS: usize = 3;
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
    let text: Vec<char> = text.chars().collect();
    if text.len() > MAX_LENGTH {
        return Err(format!("it has {} characters; at most {MAX_LENGTH} are allowed", text.len()));
    }
    let mut parser = Parser { text: &text, at: 0, names, nesting: 0, out: Vec::new() };
    parser.sum()?;
    if let Some(c) = parser.peek() {
        return Err(parser.unexpected(c));
    }
    let mut depth = 0_usize;
    for op in &parser.out {
        match op {
            Op::Constant(_) | Op::Variable(_) => depth += 1,
            Op::Binary(_) => depth -= 1,
            Op::Unary(_) | Op::Power(_) => {}
        }
        if depth > MAX_DEPTH {
            return Err(format!("it needs more than {MAX_DEPTH} intermediate values; split it into several effects"));
        }
    }
    Ok(parser.out)
}

/// A text being read from `at` on, and the program so far.
struct Parser<'a> {
    text: &'a [char],
    at: usize,
    names: &'a [&'a str],
    nesting: usize,
    out: Vec<Op>,
}

/// What is wrong at a character, counted from 0.
fn fault(at: usize, what: &str) -> String {
    format!("at character {}: {what}", at + 1)
}

impl Parser<'_> {
    /// The next character that is no blank, without taking it.
    fn peek(&mut self) -> Option<char> {
        while self.text.get(self.at).is_some_and(|c| c.is_whitespace()) {
            self.at += 1;
        }
        self.text.get(self.at).copied()
    }

    /// Takes the next character if it is `wanted`.
    fn take(&mut self, wanted: char) -> bool {
        let found = self.peek() == Some(wanted);
        self.at += usize::from(found);
        found
    }

    fn needed(&self, at: usize, what: &str) -> String {
        fault(at, &format!("{what}; a formula such as \"-c * tanh(qd / v0)\" is needed"))
    }

    /// A fault at a character that cannot stand where it does.
    fn unexpected(&self, c: char) -> String {
        match c {
            '^' => fault(self.at, "^ is not allowed; write pow(x, 2)"),
            '%' | '<' | '>' | '=' | '&' | '|' | '!' | '~' => {
                fault(self.at, &format!("the operator {c} is not allowed; + - * / are"))
            }
            _ => self.needed(self.at, &format!("{c:?} was not expected here")),
        }
    }

    /// The end of the text, without the blanks there.
    fn end(&self) -> usize {
        self.text.iter().rposition(|c| !c.is_whitespace()).map_or(0, |k| k + 1)
    }

    fn sum(&mut self) -> Result<(), String> {
        self.product()?;
        while let Some(c @ ('+' | '-')) = self.peek() {
            self.at += 1;
            self.product()?;
            self.out.push(Op::Binary(if c == '+' { Binary::Add } else { Binary::Subtract }));
        }
        Ok(())
    }

    fn product(&mut self) -> Result<(), String> {
        self.factor(0)?;
        while let Some(c @ ('*' | '/')) = self.peek() {
            self.at += 1;
            if self.text.get(self.at) == Some(&'*') {
                return Err(fault(self.at, "** is not allowed; write pow(x, 2)"));
            }
            self.factor(0)?;
            self.out.push(Op::Binary(if c == '*' { Binary::Multiply } else { Binary::Divide }));
        }
        Ok(())
    }

    /// A factor after `signs` minus signs.
    fn factor(&mut self, signs: usize) -> Result<(), String> {
        let Some(c) = self.peek() else { return Err(self.needed(self.end(), "it ends too early")) };
        match c {
            '-' if signs == MAX_SIGNS => Err(fault(self.at, &format!("more than {MAX_SIGNS} signs in a row"))),
            '-' => {
                self.at += 1;
                self.factor(signs + 1)?;
                self.out.push(Op::Unary(Unary::Negate));
                Ok(())
            }
            '(' => self.nested(Self::sum),
            '.' | '0'..='9' => {
                let number = self.number()?;
                self.out.push(Op::Constant(number));
                Ok(())
            }
            c if c.is_alphabetic() || c == '_' => self.name(),
            '+' => Err(fault(self.at, "this sign is not allowed; leave it out")),
            c => Err(self.unexpected(c)),
        }
    }

    /// `inside` between parentheses, the first of which is next.
    fn nested(&mut self, inside: impl FnOnce(&mut Self) -> Result<(), String>) -> Result<(), String> {
        let open = self.at;
        self.at += 1;
        self.nesting += 1;
        if self.nesting > MAX_NESTING {
            return Err(format!("it nests too deeply; at most {MAX_NESTING} parentheses are allowed"));
        }
        inside(self)?;
        self.nesting -= 1;
        match self.peek() {
            Some(')') => {
                self.at += 1;
                Ok(())
            }
            Some(c) => Err(self.unexpected(c)),
            None => Err(self.needed(open, "this parenthesis is not closed")),
        }
    }

    /// A decimal number.
    fn number(&mut self) -> Result<f64, String> {
        let start = self.at;
        let next = |k: usize| self.text.get(k).copied().unwrap_or(' ');
        let mut end = start;
        while next(end).is_alphanumeric() || matches!(next(end), '.' | '_') {
            let exponent = matches!(next(end), 'e' | 'E') && matches!(next(end + 1), '+' | '-');
            end += if exponent && next(end + 2).is_ascii_digit() { 2 } else { 1 };
        }
        self.at = end;
        let text: String = self.text[start..end].iter().collect();
        let value = text.parse().ok().filter(|value: &f64| value.is_finite());
        value.ok_or_else(|| fault(start, "a decimal number is needed"))
    }

    /// A variable, a number of the table, or a function with its arguments.
    fn name(&mut self) -> Result<(), String> {
        let start = self.at;
        while self.text.get(self.at).is_some_and(|c| c.is_alphanumeric() || *c == '_') {
            self.at += 1;
        }
        let name: String = self.text[start..self.at].iter().collect();
        if self.peek() == Some('(') {
            return self.function(start, &name);
        }
        let Some(k) = self.names.iter().position(|n| *n == name) else {
            return Err(fault(start, &format!("{name:?} is not known; {} are allowed", self.names.join(", "))));
        };
        self.out.push(Op::Variable(k));
        Ok(())
    }

    /// The function `name`, which begins at `start`; its arguments are next.
    fn function(&mut self, start: usize, name: &str) -> Result<(), String> {
        let unary = UNARY.iter().find(|(n, _)| *n == name).map(|(_, unary)| Op::Unary(*unary));
        let binary = match name {
            "min" => Some(Op::Binary(Binary::Min)),
            "max" => Some(Op::Binary(Binary::Max)),
            _ => None,
        };
        let (Some(op), wanted) = (unary.or(binary), if unary.is_some() { 1 } else { 2 }) else {
            if name == "pow" {
                return self.nested(|inside| inside.power(start));
            }
            return Err(fault(start, &format!("{name:?} is not a function; {FUNCTIONS} are allowed")));
        };
        self.nested(|inside| inside.arguments(start, name, wanted))?;
        self.out.push(op);
        Ok(())
    }

    /// As many arguments as are `wanted`.
    fn arguments(&mut self, start: usize, name: &str, wanted: usize) -> Result<(), String> {
        let mut found = 0;
        if self.peek() != Some(')') {
            self.sum()?;
            found = 1;
            while self.take(',') {
                self.sum()?;
                found += 1;
            }
        }
        if found == wanted || !matches!(self.peek(), Some(')')) {
            return Ok(());
        }
        Err(fault(start, &format!("{name} takes {wanted} arguments, found {found}")))
    }

    /// The arguments of `pow`: anything, and how often it is multiplied.
    fn power(&mut self, start: usize) -> Result<(), String> {
        self.sum()?;
        if !self.take(',') {
            return match self.peek() {
                Some(')') => Err(fault(start, "pow takes 2 arguments, found 1")),
                Some(c) => Err(self.unexpected(c)),
                None => Err(self.needed(self.end(), "it ends too early")),
            };
        }
        let c = self.peek();
        let (at, text) = (self.at, format!("the power must be a whole number from 1 to {MAX_POWER}"));
        let power = if matches!(c, Some('.' | '0'..='9')) { self.number().ok() } else { None };
        let whole = power.filter(|n| n.fract() == 0.0 && (1.0..=f64::from(MAX_POWER)).contains(n));
        if whole.is_none() || !matches!(self.peek(), Some(')') | None) {
            return Err(fault(at, &text));
        }
        self.out.extend(whole.map(|n| Op::Power(n as u32)));
        Ok(())
    }
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
        assert!(text_of(&"-".repeat(900)).contains("at character 4: more than 3 signs"));
        assert!(text_of(&"tanh(".repeat(150)).contains("nests too deeply"));
        assert!(text_of("(q").contains("at character 1: this parenthesis"), "{}", text_of("(q"));
        assert!(text_of("q)").contains("at character 2") && text_of("q c").contains("at character 3"));
        assert!(text_of("pow(q)").contains("takes 2 arguments, found 1") && text_of("tanh()").contains("found 0"));
        assert!(text_of("q < c").contains("at character 3: the operator < is not allowed"));
        assert!(text_of("+q").contains("leave it out") && text_of("1_0").contains("decimal"));
        assert!(text_of("return q").contains("at character 1: \"return\" is not known"));
        assert!(text_of("\u{e9}(q)").contains("at character 1") && text_of("q + \u{e9}").contains("at character 5"));
        assert!(text_of(&format!("q{}", " - (q".repeat(20) + &")".repeat(20))).contains("intermediate"));
        assert!(Program::parse("q", &["q"]).unwrap_err().contains("name of a variable"));
        assert!(Program::parse("q", &["c"]).unwrap_err().contains("does not occur"));
    }

    /// Against values by hand.
    #[test]
    fn precedence_is_the_usual_one() {
        for (text, wanted) in [
            ("1 - 2 - 3", -4.0),
            ("8 / 4 / 2", 1.0),
            ("2 + 3 * 4", 14.0),
            ("-2 * -3 - --1", 5.0),
            ("-pow(3, 2) + pow(-2, 3)", -17.0),
            ("2 * (3 + 4) * .5", 7.0),
            ("max(min(5, 3), 2) / 1e-1 + 2E+1", 50.0),
            ("abs(-3) + sign(-7) + sqrt(16.) + exp(0)", 7.0),
        ] {
            let mut stack: Vec<f64> = Vec::new();
            for op in parse(text, &[]).unwrap() {
                match op {
                    Op::Constant(c) => stack.push(c),
                    Op::Variable(_) => unreachable!(),
                    Op::Unary(u) => {
                        let x = stack.pop().unwrap();
                        stack.push(u.apply(x));
                    }
                    Op::Binary(b) => {
                        let (y, x) = (stack.pop().unwrap(), stack.pop().unwrap());
                        stack.push(b.apply(x, y));
                    }
                    Op::Power(n) => {
                        let x = stack.pop().unwrap();
                        stack.push(x.powi(n as i32));
                    }
                }
            }
            assert!(stack.len() == 1 && (stack[0] - wanted).abs() < 1e-12, "{text}: {stack:?}");
        }
    }

    proptest::proptest! {
        /// Any text has a program or a fault; it does not panic, and needs little stack.
        #[test]
        fn any_text_is_answered(parts in proptest::collection::vec(proptest::sample::select(vec![
            "q", "c", "qd", "1", "2.5", "1e", "-", "+", "*", "/", "**", "(", ")", ",", ".", "_", "pow(", "min(", "tanh(",
            "return ", "if ", "<", ">", "::", "|", "{", "}", "[", "]", "'", "\"", "#", "\u{e9}", " ", "\n", "\0", "0x", "e+3",
        ]), 0..300)) {
            let text = parts.concat();
            let small = std::thread::Builder::new().stack_size(128 << 10);
            let result = small.spawn(move || parse(&text, &["q", "qd", "c"])).unwrap().join().unwrap();
            if let Err(text) = result {
                proptest::prop_assert!(!text.is_empty());
            }
        }
    }
}
