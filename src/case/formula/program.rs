//! A formula compiled to a list of steps on a small stack of numbers.
//!
//! Distances need gradients: the same steps run on numbers that carry ∂/∂x, ∂/∂y, ∂/∂z along.

use super::FAR;
use super::syntax::{Arithmetic, Comparison, FormulaError, Function, Tree, too_deep};

const STACK: usize = 32;

/// One step: takes its operands from the top of the stack and leaves its result there.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    Push(f64),
    /// x, y, z, t = 0, 1, 2, 3
    Load(usize),
    Negative,
    Call(Function),
    Join(Arithmetic),
    Compare(Comparison),
    /// 1 − a
    Not,
    /// f → f / |∇f|
    Distance,
}

/// Steps that leave one number.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    steps: Box<[Step]>,
}

impl Program {
    /// Conditions count 1 or 0.
    pub fn value(tree: &Tree) -> Result<Self, FormulaError> {
        let mut steps = Vec::new();
        emit_value(tree, &mut steps);
        Self::checked(steps)
    }

    /// Of a condition: positive where it holds.
    pub fn distance(tree: &Tree) -> Result<Self, FormulaError> {
        if !tree.is_condition() {
            let message = "a condition such as z < 0.5 was expected, not a number";
            return Err(FormulaError(message.into()));
        }
        let mut steps = Vec::new();
        emit_distance(tree, &mut steps);
        Self::checked(steps)
    }

    /// The number it always gives, if no variable occurs.
    pub fn as_constant(&self) -> Option<f64> {
        let varies = self.steps.iter().any(|s| matches!(s, Step::Load(_)));
        (!varies).then(|| self.value_at([0.0; 3], 0.0))
    }

    /// The formula at (x, t).
    pub fn value_at(&self, x: [f64; 3], t: f64) -> f64 {
        self.run([x[0], x[1], x[2], t])
    }

    /// The distance at (x, t).
    pub fn distance_at(&self, x: [f64; 3], t: f64) -> f64 {
        self.run([
            Graded { value: x[0], gradient: [1.0, 0.0, 0.0] },
            Graded { value: x[1], gradient: [0.0, 1.0, 0.0] },
            Graded { value: x[2], gradient: [0.0, 0.0, 1.0] },
            Graded::constant(t),
        ])
        .value
    }

    fn checked(steps: Vec<Step>) -> Result<Self, FormulaError> {
        let mut height = 0;
        for step in &steps {
            height += match step {
                Step::Push(_) | Step::Load(_) => 1,
                Step::Join(_) | Step::Compare(_) => -1,
                Step::Negative | Step::Call(_) | Step::Not | Step::Distance => 0,
            };
            if height > STACK as i32 {
                return too_deep();
            }
        }
        assert!(height == 1, "a formula leaves one number, this one leaves {height}");
        Ok(Self { steps: steps.into() })
    }

    fn run<N: Number>(&self, variables: [N; 4]) -> N {
        let mut stack = [N::constant(0.0); STACK];
        let mut top = 0; // the stack holds `top` numbers
        for step in &self.steps {
            match *step {
                Step::Push(number) => {
                    stack[top] = N::constant(number);
                    top += 1;
                }
                Step::Load(v) => {
                    stack[top] = variables[v];
                    top += 1;
                }
                Step::Negative => stack[top - 1] = stack[top - 1].scale(-1.0),
                Step::Not => stack[top - 1] = N::constant(1.0 - stack[top - 1].value()),
                Step::Call(f) => stack[top - 1] = call(f, stack[top - 1]),
                Step::Distance => stack[top - 1] = stack[top - 1].distance(),
                Step::Join(op) => {
                    top -= 1;
                    stack[top - 1] = join(op, stack[top - 1], stack[top]);
                }
                Step::Compare(op) => {
                    top -= 1;
                    let holds = compare(op, stack[top - 1].value(), stack[top].value());
                    stack[top - 1] = N::constant(f64::from(u8::from(holds)));
                }
            }
        }
        stack[0]
    }
}

fn emit_value(tree: &Tree, steps: &mut Vec<Step>) {
    match tree {
        Tree::Number(number) => steps.push(Step::Push(*number)),
        Tree::Variable(v) => steps.push(Step::Load(*v)),
        Tree::Always(holds) => steps.push(Step::Push(f64::from(u8::from(*holds)))),
        Tree::Negative(a) => {
            emit_value(a, steps);
            steps.push(Step::Negative);
        }
        Tree::Call(f, a) => {
            emit_value(a, steps);
            steps.push(Step::Call(*f));
        }
        Tree::Not(a) => {
            emit_value(a, steps);
            steps.push(Step::Not);
        }
        Tree::Join(op, a, b) => emit_both(a, b, emit_value, Step::Join(*op), steps),
        Tree::Compare(op, a, b) => emit_both(a, b, emit_value, Step::Compare(*op), steps),
        Tree::And(a, b) => emit_both(a, b, emit_value, Step::Join(Arithmetic::Min), steps),
        Tree::Or(a, b) => emit_both(a, b, emit_value, Step::Join(Arithmetic::Max), steps),
    }
}

fn emit_distance(tree: &Tree, steps: &mut Vec<Step>) {
    match tree {
        Tree::Always(holds) => steps.push(Step::Push(if *holds { FAR } else { -FAR })),
        Tree::Not(a) => {
            emit_distance(a, steps);
            steps.push(Step::Negative);
        }
        Tree::And(a, b) => emit_both(a, b, emit_distance, Step::Join(Arithmetic::Min), steps),
        Tree::Or(a, b) => emit_both(a, b, emit_distance, Step::Join(Arithmetic::Max), steps),
        Tree::Compare(op, a, b) => {
            let difference = Step::Join(Arithmetic::Subtract);
            match op {
                Comparison::Less | Comparison::LessEqual => {
                    emit_both(b, a, emit_value, difference, steps);
                }
                Comparison::Greater | Comparison::GreaterEqual => {
                    emit_both(a, b, emit_value, difference, steps);
                }
                // Holds on (or off) a surface: a sheet of no thickness.
                Comparison::Equal | Comparison::NotEqual => {
                    emit_both(a, b, emit_value, difference, steps);
                    steps.push(Step::Call(Function::Abs));
                    if *op == Comparison::Equal {
                        steps.push(Step::Negative);
                    }
                }
            }
            steps.push(Step::Distance);
        }
        number => unreachable!("conditions hold only conditions, not {number:?}"),
    }
}

fn emit_both(
    a: &Tree,
    b: &Tree,
    emit: fn(&Tree, &mut Vec<Step>),
    then: Step,
    steps: &mut Vec<Step>,
) {
    emit(a, steps);
    emit(b, steps);
    steps.push(then);
}

/// What the steps run on.
trait Number: Copy {
    fn constant(value: f64) -> Self;
    fn value(self) -> f64;
    /// f(self), where f has this value and this derivative.
    fn chain(self, value: f64, derivative: impl FnOnce() -> f64) -> Self;
    fn scale(self, factor: f64) -> Self;
    fn add(self, b: Self) -> Self;
    fn multiply(self, b: Self) -> Self;
    fn distance(self) -> Self;
}

impl Number for f64 {
    fn constant(value: f64) -> Self {
        value
    }
    fn value(self) -> f64 {
        self
    }
    fn chain(self, value: f64, _: impl FnOnce() -> f64) -> Self {
        value
    }
    fn scale(self, factor: f64) -> Self {
        self * factor
    }
    fn add(self, b: Self) -> Self {
        self + b
    }
    fn multiply(self, b: Self) -> Self {
        self * b
    }
    fn distance(self) -> Self {
        self
    }
}

/// A number and its gradient.
#[derive(Clone, Copy)]
struct Graded {
    value: f64,
    gradient: [f64; 3],
}

impl Number for Graded {
    fn constant(value: f64) -> Self {
        Self { value, gradient: [0.0; 3] }
    }
    fn value(self) -> f64 {
        self.value
    }
    fn chain(self, value: f64, derivative: impl FnOnce() -> f64) -> Self {
        // Where nothing varies an infinite derivative (√0) does not matter.
        if self.gradient == [0.0; 3] {
            return Self::constant(value);
        }
        let derivative = derivative();
        Self { value, gradient: self.gradient.map(|g| derivative * g) }
    }
    fn scale(self, factor: f64) -> Self {
        Self { value: factor * self.value, gradient: self.gradient.map(|g| factor * g) }
    }
    fn add(self, b: Self) -> Self {
        let gradient = std::array::from_fn(|i| self.gradient[i] + b.gradient[i]);
        Self { value: self.value + b.value, gradient }
    }
    fn multiply(self, b: Self) -> Self {
        let gradient =
            std::array::from_fn(|i| self.gradient[i] * b.value + self.value * b.gradient[i]);
        Self { value: self.value * b.value, gradient }
    }
    /// f / |∇f|, at most `FAR` from zero; the sign of f alone where ∇f vanishes.
    fn distance(self) -> Self {
        let steepness = self.gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
        let distance = if steepness > 0.0 && steepness.is_finite() {
            (self.value / steepness).clamp(-FAR, FAR)
        } else if self.value.is_nan() {
            f64::NAN
        } else if self.value > 0.0 {
            FAR
        } else {
            -FAR
        };
        Self::constant(distance)
    }
}

#[inline]
fn call<N: Number>(f: Function, a: N) -> N {
    let x = a.value();
    match f {
        Function::Sin => a.chain(x.sin(), || x.cos()),
        Function::Cos => a.chain(x.cos(), || -x.sin()),
        Function::Tan => a.chain(x.tan(), || 1.0 + x.tan() * x.tan()),
        Function::Asin => a.chain(x.asin(), || 1.0 / (1.0 - x * x).sqrt()),
        Function::Acos => a.chain(x.acos(), || -1.0 / (1.0 - x * x).sqrt()),
        Function::Atan => a.chain(x.atan(), || 1.0 / (1.0 + x * x)),
        Function::Sinh => a.chain(x.sinh(), || x.cosh()),
        Function::Cosh => a.chain(x.cosh(), || x.sinh()),
        Function::Tanh => a.chain(x.tanh(), || 1.0 - x.tanh() * x.tanh()),
        Function::Exp => a.chain(x.exp(), || x.exp()),
        Function::Log => a.chain(x.ln(), || 1.0 / x),
        Function::Sqrt => a.chain(x.sqrt(), || 0.5 / x.sqrt()),
        Function::Abs => a.chain(x.abs(), || x.signum()),
        Function::Floor => a.chain(x.floor(), || 0.0),
    }
}

#[inline]
fn join<N: Number>(op: Arithmetic, a: N, b: N) -> N {
    let (x, y) = (a.value(), b.value());
    match op {
        Arithmetic::Add => a.add(b),
        Arithmetic::Subtract => a.add(b.scale(-1.0)),
        Arithmetic::Multiply => a.multiply(b),
        // x·(1/y) would round twice: the quotient itself, then its derivatives.
        Arithmetic::Divide => {
            let in_a = a.chain(x / y, || 1.0 / y);
            let in_b = b.chain(0.0, || -x / (y * y));
            in_a.add(in_b)
        }
        Arithmetic::Power => {
            let power = if y == 2.0 { x * x } else { x.powf(y) };
            let in_a = a.chain(power, || y * x.powf(y - 1.0));
            let in_b = b.chain(0.0, || power * x.ln());
            in_a.add(in_b)
        }
        // A NaN on either side stays one: it must not pass as the other number.
        Arithmetic::Min => {
            if x < y || x.is_nan() {
                a
            } else {
                b
            }
        }
        Arithmetic::Max => {
            if x > y || x.is_nan() {
                a
            } else {
                b
            }
        }
    }
}

fn compare(op: Comparison, a: f64, b: f64) -> bool {
    match op {
        Comparison::Less => a < b,
        Comparison::LessEqual => a <= b,
        Comparison::Greater => a > b,
        Comparison::GreaterEqual => a >= b,
        Comparison::Equal => a == b,
        Comparison::NotEqual => a != b,
    }
}

#[cfg(test)]
mod tests {
    use super::super::syntax::parse;
    use super::*;

    /// Gradients carried along against central differences, every operation at once.
    #[test]
    fn gradients_are_those_of_finite_differences() {
        for text in [
            "sin(x*y) < cos(z)/y",
            "tan(x) + asin(x) - acos(y/2) < atan(z) * sinh(y)",
            "cosh(x)^y + tanh(z) < exp(x - 3) + log(z) - sqrt(x + y)",
            "abs(x - 1)^3 < min(y, z)*max(x, z) + floor(7*x)",
            "x^2/y - t < 2^z",
        ] {
            let tree = parse(text).unwrap();
            let Tree::Compare(Comparison::Less, a, b) = &tree else { panic!() };
            let f =
                Program::value(&Tree::Join(Arithmetic::Subtract, b.clone(), a.clone())).unwrap();
            let (p, h) = ([0.31, 0.72, 1.13], 1e-6);
            let mut slope = 0.0;
            for i in 0..3 {
                let at = |d: f64| {
                    let mut q = p;
                    q[i] += d;
                    f.value_at(q, 0.4)
                };
                slope += ((at(h) - at(-h)) / (2.0 * h)).powi(2);
            }
            let expected = f.value_at(p, 0.4) / f64::sqrt(slope);
            let distance = Program::distance(&tree).unwrap().distance_at(p, 0.4);
            assert!((distance / expected - 1.0).abs() < 1e-7, "{text}: {distance} {expected}");
        }
    }

    #[test]
    fn a_cone_is_its_own_distance_even_at_the_tip() {
        let ball = Program::distance(&parse("sqrt(x^2 + y^2 + z^2) < 0.5").unwrap()).unwrap();
        assert!((ball.distance_at([0.3, 0.0, 0.4], 0.0)).abs() < 1e-15);
        assert!((ball.distance_at([0.0, 0.2, 0.0], 0.0) - 0.3).abs() < 1e-15);
        assert!(ball.distance_at([0.0; 3], 0.0) >= 0.5);
    }
}
