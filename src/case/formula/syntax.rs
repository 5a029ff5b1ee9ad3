//! From text to a tree: precedence climbing over `|| && (comparison) + - * / (sign) ^`.
//!
//! As in mathematics −2² = −4, 2³² = 2⁹ and `0 < x < 1` means both.

use crate::case::nearest::did_you_mean;
use std::ops::Range;

/// Why a text is no formula: one sentence.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct FormulaError(pub String);

/// Functions of one number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Function {
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sinh,
    Cosh,
    Tanh,
    Exp,
    Log,
    Sqrt,
    Abs,
    Floor,
}

/// What joins two numbers to a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Arithmetic {
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Min,
    Max,
}

/// What joins two numbers to a condition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Comparison {
    Less,
    LessEqual,
    Greater,
    GreaterEqual,
    Equal,
    NotEqual,
}

/// A formula's tree. Numbers and conditions are told apart by `is_condition`.
#[derive(Clone, Debug, PartialEq)]
pub enum Tree {
    Number(f64),
    /// x, y, z, t = 0, 1, 2, 3
    Variable(usize),
    Negative(Box<Tree>),
    Call(Function, Box<Tree>),
    Join(Arithmetic, Box<Tree>, Box<Tree>),
    Always(bool),
    Compare(Comparison, Box<Tree>, Box<Tree>),
    Not(Box<Tree>),
    And(Box<Tree>, Box<Tree>),
    Or(Box<Tree>, Box<Tree>),
}

impl Tree {
    pub fn is_condition(&self) -> bool {
        matches!(
            self,
            Tree::Always(_) | Tree::Compare(..) | Tree::Not(_) | Tree::And(..) | Tree::Or(..)
        )
    }
}

const VARIABLES: [&str; 4] = ["x", "y", "z", "t"];
const CONSTANTS: [(&str, Tree); 4] = [
    ("pi", Tree::Number(std::f64::consts::PI)),
    ("e", Tree::Number(std::f64::consts::E)),
    ("true", Tree::Always(true)),
    ("false", Tree::Always(false)),
];
const FUNCTIONS: [(&str, Function); 14] = [
    ("sin", Function::Sin),
    ("cos", Function::Cos),
    ("tan", Function::Tan),
    ("asin", Function::Asin),
    ("acos", Function::Acos),
    ("atan", Function::Atan),
    ("sinh", Function::Sinh),
    ("cosh", Function::Cosh),
    ("tanh", Function::Tanh),
    ("exp", Function::Exp),
    ("log", Function::Log),
    ("sqrt", Function::Sqrt),
    ("abs", Function::Abs),
    ("floor", Function::Floor),
];
const OF_TWO: [(&str, Arithmetic); 2] = [("min", Arithmetic::Min), ("max", Arithmetic::Max)];
const COMPARISONS: [(&str, Comparison); 6] = [
    ("<", Comparison::Less),
    ("<=", Comparison::LessEqual),
    (">", Comparison::Greater),
    (">=", Comparison::GreaterEqual),
    ("==", Comparison::Equal),
    ("!=", Comparison::NotEqual),
];
/// Longer ones first.
const SYMBOLS: [&str; 18] = [
    "**", "<=", ">=", "==", "!=", "&&", "||", "+", "-", "*", "/", "^", "<", ">", "!", "(", ")", ",",
];
/// Parentheses, signs and powers inside one another; keeps the parser's own stack small.
const DEEPEST: usize = 200;

/// The tree of a formula.
pub fn parse(text: &str) -> Result<Tree, FormulaError> {
    let mut parser = Parser { text, tokens: tokens(text)?, next: 0, depth: 0 };
    if parser.tokens.is_empty() {
        return fail("the formula is empty");
    }
    let tree = parser.alternatives()?;
    match parser.tokens.get(parser.next).cloned() {
        None => Ok(tree),
        Some(at) if &text[at.clone()] == ")" => {
            fail(format!("\")\" at column {} is one too many", parser.column(&at)))
        }
        Some(at) => {
            let (column, found) = (parser.column(&at), &text[at]);
            let hint = match found {
                "and" => "; and is written &&",
                "or" => "; or is written ||",
                _ => "",
            };
            fail(format!("an operator was expected at column {column}, found \"{found}\"{hint}"))
        }
    }
}

fn fail<T>(message: impl Into<String>) -> Result<T, FormulaError> {
    Err(FormulaError(message.into()))
}

/// Numbers, names and symbols, as byte ranges.
fn tokens(text: &str) -> Result<Vec<Range<usize>>, FormulaError> {
    let mut found = Vec::new();
    let mut start = 0;
    while let Some(c) = text[start..].chars().next() {
        let rest = &text[start..];
        let length = if c.is_whitespace() {
            start += c.len_utf8();
            continue;
        } else if c.is_ascii_digit() || c == '.' {
            number_length(rest)
        } else if c.is_alphabetic() || c == '_' {
            rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len())
        } else if let Some(symbol) = SYMBOLS.iter().find(|s| rest.starts_with(**s)) {
            symbol.len()
        } else {
            let column = text[..start].chars().count() + 1;
            return fail(if c == '=' {
                format!("\"=\" at column {column} is no operator; to compare write ==")
            } else {
                format!("unknown character \"{c}\" at column {column}")
            });
        };
        found.push(start..start + length);
        start += length;
    }
    Ok(found)
}

/// Digits and points, then an exponent if one follows.
fn number_length(text: &str) -> usize {
    let digits = |from: usize, also: char| {
        text[from..]
            .find(|c: char| !c.is_ascii_digit() && c != also)
            .map_or(text.len(), |n| from + n)
    };
    let mantissa = digits(0, '.');
    let rest = text[mantissa..].strip_prefix(['e', 'E']);
    let Some(rest) = rest else { return mantissa };
    let sign = usize::from(rest.starts_with(['+', '-']));
    if rest[sign..].starts_with(|c: char| c.is_ascii_digit()) {
        digits(mantissa + 1 + sign, '0')
    } else {
        mantissa
    }
}

struct Parser<'a> {
    text: &'a str,
    tokens: Vec<Range<usize>>,
    next: usize,
    depth: usize,
}

impl<'a> Parser<'a> {
    fn peek(&self) -> Option<&'a str> {
        self.tokens.get(self.next).map(|r| &self.text[r.clone()])
    }

    fn take(&mut self, token: &str) -> bool {
        let found = self.peek() == Some(token);
        self.next += usize::from(found);
        found
    }

    fn column(&self, at: &Range<usize>) -> usize {
        self.text[..at.start].chars().count() + 1
    }

    fn alternatives(&mut self) -> Result<Tree, FormulaError> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return too_deep();
        }
        let mut tree = self.together()?;
        while self.take("||") {
            let right = self.together()?;
            tree = Tree::Or(condition("||", "left", tree)?, condition("||", "right", right)?);
        }
        self.depth -= 1;
        Ok(tree)
    }

    fn together(&mut self) -> Result<Tree, FormulaError> {
        let mut tree = self.comparison()?;
        while self.take("&&") {
            let right = self.comparison()?;
            tree = Tree::And(condition("&&", "left", tree)?, condition("&&", "right", right)?);
        }
        Ok(tree)
    }

    /// `a < b <= c` is `a < b && b <= c`.
    fn comparison(&mut self) -> Result<Tree, FormulaError> {
        let mut left = self.sum()?;
        let mut all: Option<Tree> = None;
        while let Some((_, op)) = self.peek().and_then(|p| COMPARISONS.iter().find(|c| c.0 == p)) {
            self.next += 1;
            let right = self.sum()?;
            let this = Tree::Compare(*op, Box::new(left), Box::new(right.clone()));
            all = Some(match all {
                None => this,
                Some(before) => Tree::And(Box::new(before), Box::new(this)),
            });
            left = right;
        }
        Ok(all.unwrap_or(left))
    }

    fn sum(&mut self) -> Result<Tree, FormulaError> {
        let mut tree = self.product()?;
        loop {
            let op = match self.peek() {
                Some("+") => Arithmetic::Add,
                Some("-") => Arithmetic::Subtract,
                _ => return Ok(tree),
            };
            self.next += 1;
            tree = Tree::Join(op, Box::new(tree), Box::new(self.product()?));
        }
    }

    fn product(&mut self) -> Result<Tree, FormulaError> {
        let mut tree = self.signed()?;
        loop {
            let op = match self.peek() {
                Some("*") => Arithmetic::Multiply,
                Some("/") => Arithmetic::Divide,
                _ => return Ok(tree),
            };
            self.next += 1;
            tree = Tree::Join(op, Box::new(tree), Box::new(self.signed()?));
        }
    }

    fn signed(&mut self) -> Result<Tree, FormulaError> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return too_deep();
        }
        let tree = if self.take("-") {
            Tree::Negative(Box::new(self.signed()?))
        } else if self.take("+") {
            self.signed()?
        } else if self.take("!") {
            let inner = self.signed()?;
            if !inner.is_condition() {
                return fail("\"!\" negates a condition such as z < 0.5, not a number");
            }
            Tree::Not(Box::new(inner))
        } else {
            let base = self.atom()?;
            if self.take("^") || self.take("**") {
                // Right to left; the exponent may have a sign.
                Tree::Join(Arithmetic::Power, Box::new(base), Box::new(self.signed()?))
            } else {
                base
            }
        };
        self.depth -= 1;
        Ok(tree)
    }

    fn atom(&mut self) -> Result<Tree, FormulaError> {
        let Some(token) = self.peek() else {
            return fail("the formula ends where a number was expected");
        };
        let at = self.tokens[self.next].clone();
        self.next += 1;
        let first = token.chars().next().expect("tokens are not empty");
        if first.is_ascii_digit() || first == '.' {
            return match token.parse() {
                Ok(number) => Ok(Tree::Number(number)),
                Err(_) => fail(format!("\"{token}\" is no number")),
            };
        }
        if first.is_alphabetic() || first == '_' {
            return self.name(token);
        }
        if token == "(" {
            let tree = self.alternatives()?;
            return if self.take(")") { Ok(tree) } else { self.unclosed() };
        }
        fail(format!("a number was expected at column {}, found \"{token}\"", self.column(&at)))
    }

    fn name(&mut self, name: &str) -> Result<Tree, FormulaError> {
        if let Some(v) = VARIABLES.iter().position(|v| *v == name) {
            return Ok(Tree::Variable(v));
        }
        if let Some((_, tree)) = CONSTANTS.iter().find(|c| c.0 == name) {
            return Ok(tree.clone());
        }
        let of_one = FUNCTIONS.iter().find(|f| f.0 == name);
        let of_two = OF_TWO.iter().find(|f| f.0 == name);
        let wanted = match (of_one, of_two) {
            (None, None) => {
                let names = VARIABLES.into_iter().chain(CONSTANTS.iter().map(|c| c.0));
                let names = names.chain(FUNCTIONS.iter().map(|f| f.0));
                let names: Vec<&str> = names.chain(OF_TWO.iter().map(|f| f.0)).collect();
                return fail(format!(
                    "unknown name \"{name}\"; {}",
                    did_you_mean(name, &names, "names")
                ));
            }
            (Some(_), _) => 1,
            (None, Some(_)) => 2,
        };
        if !self.take("(") {
            let argument = if wanted == 1 { "argument" } else { "arguments" };
            return fail(format!("{name} needs its {argument} in parentheses"));
        }
        let mut arguments = vec![self.alternatives()?];
        while self.take(",") {
            arguments.push(self.alternatives()?);
        }
        if !self.take(")") {
            return self.unclosed();
        }
        let given = arguments.len();
        if given != wanted {
            let plural = if wanted == 1 { "" } else { "s" };
            return fail(format!("{name} takes {wanted} argument{plural}, {given} given"));
        }
        let mut arguments = arguments.into_iter().map(Box::new);
        let mut argument = || arguments.next().expect("their number was checked");
        Ok(match (of_one, of_two) {
            (Some((_, f)), _) => Tree::Call(*f, argument()),
            (None, Some((_, f))) => Tree::Join(*f, argument(), argument()),
            (None, None) => unreachable!("unknown names were refused above"),
        })
    }

    fn unclosed<T>(&self) -> Result<T, FormulaError> {
        match self.tokens.get(self.next) {
            None => fail("a closing parenthesis is missing"),
            Some(at) => fail(format!(
                "an operator or a closing parenthesis was expected at column {}, found \"{}\"",
                self.column(at),
                &self.text[at.clone()]
            )),
        }
    }
}

fn condition(op: &str, side: &str, tree: Tree) -> Result<Box<Tree>, FormulaError> {
    if tree.is_condition() {
        Ok(Box::new(tree))
    } else {
        fail(format!("\"{op}\" joins conditions such as z < 0.5; the {side} one is a number"))
    }
}

/// The error of formulas that would need too much stack.
pub fn too_deep<T>() -> Result<T, FormulaError> {
    fail("the formula is nested too deeply")
}
