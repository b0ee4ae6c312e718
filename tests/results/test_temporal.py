"""Signal temporal logic: against rtamt, closed forms, and what is no formula."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beaver_ftc.results.temporal import MOST_CHARACTERS, MOST_DEPTH, FormulaError, parse
from samples import samples

RATE_HZ = 10.0
COMPARED = ["(a <= 0.3)", "(b - 2*a >= -0.2)", "(abs(a*b) < 0.5)", "(a / 2 + b > c)", "(0.1 >= c)"]
INTERVALS = ["[0:0.5]", "[0.2:0.7]", "[1:1]", "[0:9]", "[5,9]"]


def joined(below):
    one = st.tuples(st.sampled_from(["always", "eventually", "once", "historically"]), intervals(), below)
    two = st.tuples(below, st.sampled_from(["and", "or", "implies"]), below)
    until = st.tuples(below, intervals(), below)
    return st.one_of(
        one.map(lambda t: f"({t[0]}{t[1]}({t[2]}))"),
        two.map(lambda t: f"({t[0]} {t[1]} {t[2]})"),
        until.map(lambda t: f"({t[0]} until{t[1]} {t[2]})"),
        below.map(lambda t: f"(not ({t}))"),
    )


def intervals():
    return st.sampled_from(INTERVALS)


def log(frames, seed):
    rng = np.random.default_rng(seed)
    return {name: rng.normal(size=frames) for name in "abc"}


@settings(max_examples=samples(60))
@given(st.recursive(st.sampled_from(COMPARED), joined, max_leaves=5), st.integers(2, 40), st.integers(0, 99))
def test_robustness_is_that_of_rtamt(text, frames, seed):
    rtamt = pytest.importorskip("rtamt")
    columns = log(frames, seed)
    theirs = rtamt.StlDiscreteTimeSpecification()
    for name in columns:
        theirs.declare_var(name, "float")
    theirs.set_sampling_period(100, "ms", 0.1)
    theirs.unit = "s"
    theirs.spec = text
    theirs.parse()
    values = {name: column.tolist() for name, column in columns.items()}
    expected = theirs.evaluate({"time": list(range(frames)), **values})[0][1]
    assert parse(text).robustness(columns, RATE_HZ) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("always(a <= 3)", 3 - 4.0),
        ("always[0:0.2](a <= 3)", 3 - 2.0),
        ("eventually(a >= 3)", 1.0),
        ("eventually[0:0.2](a >= 3)", -1.0),
        ("(a >= 0) until (b >= 1)", 0.0),
        ("a - 1 - 2 <= 0", 3.0),
        ("-a * 2 <= 1", 1.0),
        ("not (a >= 1)", 1.0),
        ("a >= 1 -> a >= 2 -> a >= 3", 2.0),
        ("a <= 1 or b >= 5 and a >= 9", 1.0),
    ],
)
def test_what_a_ramp_keeps(text, expected):
    columns = {"a": np.arange(5.0), "b": np.array([0.0, 0, 0, 1, 1])}
    assert parse(text).robustness(columns, RATE_HZ) == expected


NO_FORMULA = [
        "", "a", "a + 1", "abs(a)", "a <=", "(a <= 1", "a <= 1)", "a <= 1 b", "a == 1", "always a <= 1",
        "always[0:5]", "always[5:0](a <= 1)", "always[-1:2](a <= 1)", "always[0](a <= 1)", "not a", "a and b",
        "a and (b <= 1)", "a + (b <= 1) <= 1",
        "(a <= 1) + 2 <= 3", "abs(a <= 1) >= 0", "__import__('os')", "a <= 1; b <= 1", "and <= 1",
        "a <= 1e9999999:", "a <= 1e999", "a <= " + "9" * 400,
        "always[0:1e9](a <= 1)", "(" * (MOST_DEPTH + 1) + "a <= 1", "a <= " + "1" * MOST_CHARACTERS,
]  # fmt: skip


def test_what_is_no_formula_is_said(changed):
    found = {}
    for text in NO_FORMULA:
        with pytest.raises(FormulaError) as error:
            parse(text)
        assert "\n" not in str(error.value)
        assert len(str(error.value)) < 200
        found[text[:40]] = str(error.value)
    assert not changed(found)
