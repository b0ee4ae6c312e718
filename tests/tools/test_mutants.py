"""Small defects on purpose: which are made, that a seed draws the same ones, and that each goes on trial."""

import pytest
from tools.mutants import scope, trial
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


def test_half_of_what_is_drawn_is_glue_and_a_kernel_is_what_compiled_code_is_made_of():
    named = ("loop/changing.py", "diagnosis/isolation.py", "loop/frame.py")
    pairs, numbers = scope.drawn(1, [f"beaver_ftc/{name}" for name in named])
    assert [kind for kind, _ in pairs[:60]] == [scope.KERNELS, scope.GLUE] * 30
    files = {kind: {m.file.name for of, m in pairs if of == kind} for kind in numbers}
    assert files == {scope.KERNELS: {"isolation.py"}, scope.GLUE: {"changing.py", "isolation.py"}}
    assert sum(numbers.values()) == len(pairs)


def test_what_is_left_out_has_a_reason_and_what_is_listed_exists():
    assert sum(int(line.split()[0]) for line in scope.left_out()) < 30
    assert scope.kind(scope.CORE / "compiled" / "target.py") == "compile"
    assert scope.kind(scope.CORE / "loop" / "frame.py") == "fly"
    assert scope.stale() == []


def test_every_test_file_runs_plain_or_compiled_and_none_in_both():
    plain, compiled = map(set, map(scope.tests, (scope.PLAIN, scope.COMPILED)))
    assert not plain & compiled
    assert scope.TESTS / "diagnosis" / "test_surroundings_kernels.py" in plain
    every = {file for file in scope.TESTS.rglob("test_*.py") if "acceptance" not in file.parts}
    assert plain | compiled == every


def test_a_child_that_never_ends_hangs_and_one_that_fails_kills():
    def forever():
        while True:
            pass

    assert trial.in_a_child(forever, 0.2) == trial.HANGS
    assert trial.in_a_child(lambda: 0, 5.0) == trial.SURVIVED
    assert trial.in_a_child(lambda: 1, 5.0) == trial.KILLED
