"""Small defects on purpose: which are made, that a seed draws the same ones, and that each goes on trial."""

import pytest
from tools.mutants import trial
from tools.mutants.making import mutants

SOURCE = """
def weigh(x, most: int = 3):
    total = 0.5 * x[1] - min(x[0], most)
    if not total < 2:
        note(total)
    return -total
"""


@pytest.fixture
def module(tmp_path):
    (tmp_path / "module.py").write_text(SOURCE)
    return tmp_path / "module.py"


def test_every_small_change_is_made_once(module):
    made = {(m.before, m.after) for m in mutants(module)}
    assert {
        ("0.5 * x[1]", "0.5 / x[1]"), ("0.5", "1.0"), ("x[1]", "x[0]"), ("x[0]", "x[1]"), ("1", "2"),
        ("min(x[0], most)", "max(x[0], most)"), ("total < 2", "total <= 2"), ("total < 2", "total >= 2"),
        ("not total < 2", "total < 2"), ("note(total)", "pass"), ("-total", "total"), ("3", "4"), ("2", "3"),
        ("0", "1"), ("0.5 * x[1] - min(x[0], most)", "0.5 * x[1] + min(x[0], most)"),
    } == made  # fmt: skip


def test_a_mutant_is_the_module_with_one_change(module):
    (sign,) = [m for m in mutants(module) if m.before == "-total"]
    assert "return total" in sign.source()
    assert sign.source().replace("return total", "return -total").count("\n") == sign.source().count("\n")
    assert sign.name(module.parent) == "module.py: return -total: -total -> total"


def test_a_child_that_never_ends_hangs_and_one_that_fails_kills():
    def forever():
        while True:
            pass

    assert trial.in_a_child(forever, 0.2) == trial.HANGS
    assert trial.in_a_child(lambda: 0, 5.0) == trial.SURVIVED
    assert trial.in_a_child(lambda: 1, 5.0) == trial.KILLED
