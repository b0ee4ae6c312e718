"""The copy in which the core's tests run has the whole core, and nothing of the products."""

import subprocess
import sys
from pathlib import Path

from tools import core_alone

SEEN = """
import importlib.util
import beaver_ftc
from beaver_ftc import commands
names = [f"beaver_ftc_{name}" for name in ("logs", "aircraft", "live", "links", "assurance")]
print(beaver_ftc.__file__, [name for name in names if importlib.util.find_spec(name)])
print(sorted({target.partition(".")[0] for target in commands.registered().values()}))
"""


def ran(folder, code, *asked):
    """Python in the copy."""
    return subprocess.run(
        [sys.executable, "-c", code, *asked], cwd=folder, env=core_alone.lay_out(folder),
        capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_the_core_is_found_there_and_no_product(tmp_path):
    package = tmp_path / "src" / "beaver_ftc" / "__init__.py"
    assert ran(tmp_path, SEEN).stdout.splitlines() == [f"{package} []", "['beaver_ftc']"]


def test_every_file_of_the_core_and_its_tests_is_there():
    found = {Path(name) for name in core_alone.files()}
    in_sources = {path.parts[1] for path in found if path.parts[0] == "src"}
    assert in_sources == {"beaver_ftc", "begin_beaver_ftc.py"}
    assert {Path("tests/conftest.py"), Path("tests/cli/test_main.py"), Path("pyproject.toml")} <= found
    assert not [path for path in found if "products" in path.parts]
