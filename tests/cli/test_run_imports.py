"""What a plain `beaver-ftc run --no-report` imports of our packages, and what answers at once does.

Modules are counted, not seconds: those are `make waits`.
"""

import subprocess
import sys

import pytest

SCENARIO = "name: plain\nduration_s: 0.5\nreference: {q: [{sine: {amplitude_deg_s: 3, frequency_hz: 0.2}}]}\n"
COMMAND = """
import sys
from beaver_ftc.cli.main import main
try:
    main()
except SystemExit as ended:
    assert not ended.code
"""
SAY = """
import sys
for name in sorted(sys.modules):
    print(name, file=sys.stderr)
"""
# What takes a process a tenth of a second or so to import, or belongs to a flight.
HEAVY = {"beaver_ftc.scenario.schema", "jsbsim", "matplotlib", "numba", "numpy", "pandas", "pyarrow", "scipy"}
BAR = 211


def modules(code, *arguments, folder=None):
    """All modules of a process that has executed this."""
    command = [sys.executable, "-c", code + SAY, *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    return done.stderr.splitlines()


@pytest.fixture(scope="module")
def imported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plain")
    (folder / "plain.yaml").write_text(SCENARIO)
    found = modules(COMMAND, "run", "plain.yaml", "--no-report", folder=folder)
    return [name for name in found if name.partition(".")[0].startswith("beaver_ftc")]


@pytest.mark.parametrize(
    ("code", "arguments", "besides", "most"),
    [
        ("import beaver_ftc", (), {"pydantic", "typer", "yaml"}, 8),
        (COMMAND, ("--help",), {"pydantic", "yaml"}, 20),
        (COMMAND, ("list",), set(), 50),
        (COMMAND, ("show", "fault-free"), set(), 30),
    ],
)
def test_what_answers_at_once_imports_nothing_heavy(code, arguments, besides, most):
    found = modules(code, *arguments)
    assert (HEAVY | besides).isdisjoint(found)
    assert len([name for name in found if name.startswith("beaver_ftc")]) <= most


def test_a_run_imports_no_product(imported):
    assert "beaver_ftc.loop.loop" in imported
    assert [name for name in imported if name.startswith("beaver_ftc_")] == []


def test_a_run_imports_at_most_as_many_modules_as_it_needs(imported):
    assert len(imported) <= BAR
