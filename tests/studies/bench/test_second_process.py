"""A second process translates a half of a kernel: the same comes of it, and without it nothing is lost."""

import importlib

import numpy as np
import pytest

from beaver_ftc import second_process
from beaver_ftc.compiled import compile_into

MODULE = """
import numpy as np
from beaver_ftc.compiled import kernel

SHIFTS = np.array([0.25, -3.0])

@kernel
def shift(x, i):
    return x + SHIFTS[i]

@kernel
def apart(values):
    total = 0.0
    for i in range(values.size):
        total += np.sqrt(abs(shift(values[i], i % 2)))
    return total

@kernel
def here(values):
    values[0] = shift(values[0], 1)

def whole(values):
    here(values)
    return apart(values) + shift(values[1], 0)
"""
VALUES = np.array([1.5, -2.0, 7.25])


@pytest.fixture
def made(tmp_path, monkeypatch):
    """The module above, and its outermost kernel, made of two halves."""
    name = f"halves_{tmp_path.name.replace('-', '_')}"
    (tmp_path / f"{name}.py").write_text(MODULE)
    monkeypatch.syspath_prepend(tmp_path)
    module = importlib.import_module(name)
    whole = compile_into(tmp_path / "cache", module.whole)
    whole.halves = lambda values: ([(module.apart, (values,))], [(module.here, (values,))])
    return module, whole


def translated_apart(kernel):
    return [
        f"v{second_process.FIRST_NUMBER}"[:-2] in of.fndesc.mangled_name for of in kernel.overloads.values()
    ]


def expected():
    first = VALUES[0] - 3.0
    return np.sqrt([abs(first + 0.25), 5.0, 7.5]).sum() - 1.75


def test_a_half_comes_from_the_other_process_and_the_whole_is_right_and_kept(made, tmp_path):
    module, whole = made
    assert whole(VALUES.copy()) == expected()
    assert translated_apart(module.apart) == [True]
    assert translated_apart(module.here) == [False]
    again = compile_into(tmp_path / "cache", module.whole)
    assert again(VALUES.copy()) == expected()
    assert sum(again.stats.cache_hits.values()) == 1


@pytest.mark.parametrize(
    ("what", "value"),
    [
        ("PROGRAM", "raise SystemExit(3)"),
        ("PROGRAM", "import os; os.kill(os.getpid(), 9)"),
        ("_cores", lambda: 1),
        ("PATIENCE_S", 0.0),
    ],
)
def test_without_the_other_process_this_one_does_it_all(made, monkeypatch, what, value):
    module, whole = made
    monkeypatch.setattr(second_process, what, value)
    assert whole(VALUES.copy()) == expected()
    assert translated_apart(module.apart) == [False]


def test_a_kernel_that_is_not_the_one_of_its_name_is_translated_here(made, monkeypatch):
    module, whole = made
    usual, other = module.apart, compile_into(None, lambda values: values[2])
    monkeypatch.setattr(module, "apart", other)
    assert whole(VALUES.copy()) == VALUES[2] - 1.75
    assert not usual.overloads


def test_a_number_in_the_text_makes_no_function_of_its_own(made):
    module, whole = made
    whole(VALUES.copy())
    assert len(module.shift.overloads) == 1
