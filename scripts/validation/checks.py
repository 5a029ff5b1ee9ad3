"""What a check is: a name, a function that runs the program, and the lines it gives.

    @check("taylor_green", "decay of a vortex")
    def taylor_green(work):
        run = work.run(variant("taylor_green", {"time.step": 0.02}))
        yield near(work, "kinetic energy", run.history["kinetic"][-1], 0.67, relative=0.01, source="exact")

A line that fails stays: it is what the table is for.
"""

from dataclasses import asdict, dataclass


@dataclass
class Line:
    """One row of the table; numbers as they are shown."""

    case: str
    quantity: str
    reference: str
    measured: str
    tolerance: str
    source: str
    passed: bool

    def cells(self):
        verdict = "pass" if self.passed else "FAIL"
        return (self.case, self.quantity, self.reference, self.measured, self.tolerance, verdict, self.source)

    def as_dict(self):
        return asdict(self)


@dataclass
class Check:
    """A registered check; `run(work)` yields lines."""

    name: str
    about: str
    run: object


_CHECKS = {}


def check(name, about):
    """Registers the function below under a name."""

    def register(function):
        assert name not in _CHECKS, f"two checks are called {name}"
        _CHECKS[name] = Check(name, about, function)
        return function

    return register


def checks():
    """All checks by name, in the order of their files."""
    return _CHECKS


def show(value):
    return value if isinstance(value, str) else f"{value:.5g}"


def near(work, quantity, measured, reference, source, relative=None, absolute=None):
    """|measured − reference| ≤ relative |reference|, or ≤ absolute."""
    allowed = absolute if relative is None else relative * abs(reference)
    tolerance = f"±{100 * relative:g} %" if absolute is None else f"±{absolute:g}"
    passed = abs(measured - reference) <= allowed
    return Line(work.name, quantity, show(reference), show(measured), tolerance, source, bool(passed))


def at_most(work, quantity, measured, limit, source, reference=0.0):
    """measured ≤ limit; the reference is what it would be without error."""
    passed = measured <= limit
    return Line(work.name, quantity, show(reference), show(measured), f"≤ {limit:g}", source, bool(passed))


def at_least(work, quantity, measured, limit, source, reference=None):
    """measured ≥ limit."""
    shown = show(limit if reference is None else reference)
    return Line(work.name, quantity, shown, show(measured), f"≥ {limit:g}", source, bool(measured >= limit))


def between(work, quantity, measured, low, high, source):
    """low ≤ measured ≤ high, where references scatter."""
    shown = f"{low:.4g} … {high:.4g}"
    return Line(work.name, quantity, shown, show(measured), "inside", source, bool(low <= measured <= high))


def reported(work, quantity, measured, reference, source):
    """What is shown beside the reference and cannot fail."""
    return Line(work.name, quantity, show(reference), show(measured), "reported", source, True)
