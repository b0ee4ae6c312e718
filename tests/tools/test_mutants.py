"""Small defects on purpose: which are made, that a seed draws the same ones, and that each goes on trial."""

import ast
import json
import subprocess
import tempfile
import time
from pathlib import Path

import pytest
from tools.mutants import reach, scope, trial
from tools.mutants.making import mutants

from beaver_ftc.control.state import control_dtype

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


def test_what_no_caller_can_see_is_not_changed(module):
    module.write_text("pairs = zip(a, b, strict=True)\nsize: Box[3] = f(x, align=True, linewidth=0.8)\n")
    assert mutants(module) == []


def test_an_array_of_a_record_becomes_shorter_since_a_longer_one_would_do_as_well(module):
    module.write_text('dtype = [("rate", "f8", (3,)), ("axes", "f8", (2, n + 2))]\nsize = f("rate", 3)\n')
    made = [(m.before, m.after) for m in mutants(module)]
    assert sorted(made) == [("2", "1"), ("2", "1"), ("3", "2"), ("3", "4"), ("n + 2", "n - 2")]
    assert sum("(2,)" in m.source() for m in mutants(module)) == 1


def test_a_mutant_is_the_module_with_one_change(module):
    (sign,) = [m for m in mutants(module) if m.before == "-total"]
    assert "return total" in sign.source()
    assert sign.source().replace("return total", "return -total").count("\n") == sign.source().count("\n")
    assert sign.name(module.parent) == "module.py: return -total: -total -> total"


def test_of_lines_that_are_alike_each_has_a_name_of_its_own(module):
    module.write_text("def f(x):\n    x += 1\n    x += 1\n")
    names = [m.name(module.parent) for m in mutants(module)]
    assert len(set(names)) == len(names) == 6


def test_a_change_elsewhere_draws_the_same_mutants(module, monkeypatch):
    monkeypatch.setattr(scope, "SOURCES", module.parent)
    before = [m.name(module.parent) for _, m in scope.drawn(1, ("module.py",))[0]]
    module.write_text(SOURCE + "\n\ndef further(x):\n    return x\n")
    assert [m.name(module.parent) for _, m in scope.drawn(1, ("module.py",))[0]] == before
    assert [m.name(module.parent) for _, m in scope.drawn(2, ("module.py",))[0]] != before


def test_half_of_what_is_drawn_is_glue_and_a_kernel_is_what_compiled_code_is_made_of():
    named = ("loop/changing.py", "diagnosis/isolation.py", "loop/frame.py")
    pairs, numbers = scope.drawn(1, [f"beaver_ftc/{name}" for name in named])
    assert [kind for kind, _ in pairs[:60]] == [scope.KERNELS, scope.GLUE] * 30
    files = {kind: {m.file.name for of, m in pairs if of == kind} for kind in numbers}
    assert files == {scope.KERNELS: {"isolation.py"}, scope.GLUE: {"changing.py", "isolation.py"}}
    assert sum(numbers.values()) == len(pairs)


def test_what_fills_the_records_of_kernels_is_glue_and_what_lays_them_out_is_not():
    of = {}
    for name in ("isolation.py", "detection/likelihood.py"):
        file = scope.CORE / "diagnosis" / name
        functions = [f for f in ast.parse(file.read_text()).body if isinstance(f, ast.FunctionDef)]
        for mutant in mutants(file):
            around = [f.name for f in functions if f.lineno <= mutant.lines[0] <= f.end_lineno]
            of.setdefault((*around, "a constant")[0], set()).add(scope.kind_of(mutant))
    assert of["configure_isolation"] == {scope.GLUE}
    assert of["a constant"] == of["whiten_step"] == {scope.KERNELS}
    frame = {scope.kind_of(mutant) for mutant in mutants(scope.CORE / "loop" / "frame.py")}
    assert frame == {"fly"}


def test_what_is_left_out_has_a_reason_and_what_is_listed_exists():
    assert sum(int(line.split()[0]) for line in scope.left_out()) < 30
    assert scope.kind(scope.CORE / "compiled" / "target.py") == "compile"
    assert scope.kind(scope.CORE / "loop" / "frame.py") == "fly"
    assert scope.stale() == []


def test_every_test_file_runs_plain_or_compiled_and_none_in_both():
    plain, compiled = map(set, map(scope.tests, (scope.PLAIN, scope.COMPILED)))
    assert not plain & compiled
    assert scope.TESTS / "diagnosis" / "test_isolation_kernels.py" in plain
    every = {file for file in scope.TESTS.rglob("test_*.py") if "acceptance" not in file.parts}
    assert plain | compiled == every


def test_a_child_that_never_ends_hangs_and_one_that_fails_kills():
    def forever():
        while True:
            pass

    assert trial.in_a_child(forever, 0.2) == trial.HANGS
    assert trial.in_a_child(lambda: 0, 5.0) == trial.SURVIVED
    assert trial.in_a_child(lambda: 1, 5.0) == trial.KILLED


OF_LINES = """
LIMIT, OTHER = 3, 4
TWICE = 2 * OTHER


def weigh(x):
    if x:
        return LIMIT
    return TWICE
"""


def test_tests_of_a_line_are_those_that_execute_it_or_read_what_it_gives_a_value(module, monkeypatch):
    monkeypatch.setattr(reach, "ROOT", module.parent)
    module.write_text(OF_LINES)
    known = {
        "seconds": {"a": 0.1, "b": 0.2},
        "left_out": {"takes too long": 2},
        "lines": {"module.py": {"7": ["a", "b"], "8": ["a"]}},
    }
    found = reach.Reach([known])
    assert found.of("module.py", (8, 7)) == {"a"}
    assert found.of("module.py", (9, 9)) == set()
    assert found.of("module.py", (3, 3)) == {"a", "b"}  # nobody is known to read it
    module.write_text(OF_LINES.replace("LIMIT, OTHER = 3, 4", "LIMIT = 3"))
    scope._tree.cache_clear()
    assert found.of("module.py", (2, 2)) == {"a"}
    assert found.of("other.py", (3, 3)) == set()
    assert found.left_out["takes too long"] == 2


def test_what_is_kept_once_a_process_is_forgotten_so_that_each_test_is_known_to_execute_it():
    shape = control_dtype(3)
    reach.forget()
    assert control_dtype.cache_info().currsize == 0
    assert control_dtype(3) == shape


def test_tests_of_a_module_without_functions_are_those_of_what_imports_it():
    watch, user = (
        "src/beaver_ftc/diagnosis/monitors/redundancy.py",
        "src/beaver_ftc/diagnosis/schemes/__init__.py",
    )
    lines = {user: {"1": [], "150": ["b"]}, "src/beaver_ftc/design/model.py": {"20": ["a"]}}
    found = reach.Reach([{"seconds": {}, "left_out": {}, "lines": lines}])
    assert found.of(watch, (60, 40)) == {"b"}


SHARED = """
import time
import pytest
from beaver_ftc.documents.errors import suggestion


@pytest.fixture(scope="module")
def found():
    return suggestion("elevatr", ["elevator"])


def test_first(found):
    pass


def test_other(found):
    assert "elevator" in found


def test_without():
    pass


@pytest.mark.parametrize("case", [0, 1])
def test_slow(case):
    with open(__file__ + ".tried", "a") as note:
        note.write("x")
    end = time.process_time() + 1.2
    while time.process_time() < end:
        pass
"""


@pytest.fixture
def shared_file(monkeypatch):
    """A test file inside tests/, and where what is found of it is kept."""
    with tempfile.TemporaryDirectory(dir=scope.ROOT / "tests" / "tools") as folder:
        file, kept = Path(folder) / "test_of_a_fixture.py", Path(folder) / "kept.json"
        file.write_text(SHARED)
        monkeypatch.setattr(reach, "_kept", lambda mode, file: kept)
        monkeypatch.setitem(reach.SLOW_S, scope.PLAIN, 1.0)
        yield file, kept


def test_what_a_shared_fixture_executes_every_test_executes_that_uses_it(shared_file):
    """Each may be run alone. What was too slow once is not tried again while its file is the same."""
    file, kept = shared_file
    name = file.relative_to(scope.ROOT).as_posix()
    for _ in range(2):
        assert reach._measure(scope.PLAIN, file) is False
        found = json.loads(kept.read_text())
        assert set(found["seconds"]) == {f"{name}::test_{of}" for of in ("first", "other", "without")}
        assert found["slow"] == [f"{name}::test_slow"]
        assert found["left_out"] == {"takes too long": 2}
        lines = found["lines"]["src/beaver_ftc/documents/errors.py"].values()
        assert max(lines, key=len) == [f"{name}::test_first", f"{name}::test_other"]
    assert Path(f"{file}.tried").read_text() == "x"


def test_a_child_leaves_no_process_behind(tmp_path):
    """One that it has started, and that would go on for minutes."""
    note = tmp_path / "pid"

    def starts_another():
        note.write_text(str(subprocess.Popen(["sleep", "300"]).pid))
        return 0

    assert trial.in_a_child(starts_another, 5.0) == trial.SURVIVED
    pid = int(note.read_text())
    for _ in range(200):
        state = Path(f"/proc/{pid}/stat")
        if not state.exists() or state.read_text().split()[2] == "Z":
            break
        time.sleep(0.02)
    else:
        pytest.fail("it still runs")
