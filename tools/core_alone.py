"""Do the core's tests pass without the products? `python -m tools.core_alone [TEST|OPTION]...`

Copies what git has, without the products' packages and tests, into a temporary folder, and runs pytest there.
Options and tests are pytest's; without a test all tests of the core run. Tests of tools, of pages and of the
wheel are about the whole repository, and stay away too.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path
from shutil import copy2

ROOT = Path(__file__).parents[1]
LEFT_OUT = (
    "src/beaver_ftc_*", "tests/products/*", "tests/kept/products/*", "tests/acceptance/*", "tests/tools/*",
    "tests/test_notebooks.py", "tests/test_references.py", "tests/test_published_bars.py",
)  # fmt: skip
# The sources of the checkout are on the path of whatever Python an editable installation belongs to.
WITHOUT_CHECKOUT = """import sys
sys.path[:] = [place for place in sys.path if place != {sources!r}]
"""


def files() -> Iterator[str]:
    """The files of the repository that the core and its tests have."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in listed.splitlines():
        if not any(fnmatch(name, pattern) for pattern in LEFT_OUT) and (ROOT / name).is_file():
            yield name


def lay_out(folder: Path) -> dict[str, str]:
    """Copy the core into a folder; returns the environment in which nothing else of ours is found."""
    for name in files():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        copy2(ROOT / name, folder / name)
    site = folder / ".site"
    site.mkdir(exist_ok=True)
    (site / "sitecustomize.py").write_text(WITHOUT_CHECKOUT.format(sources=str(ROOT / "src")))
    return os.environ | {"PYTHONPATH": os.pathsep.join(map(str, (site, folder / "src")))}


def main() -> int:
    """Exit status of pytest."""
    parser = argparse.ArgumentParser(prog="python -m tools.core_alone", description=__doc__, add_help=False)
    asked = parser.parse_known_args()[1]
    with tempfile.TemporaryDirectory(prefix="core-") as folder:
        environment = lay_out(Path(folder))
        return subprocess.run(
            [sys.executable, "-m", "pytest", *asked], cwd=folder, env=environment, check=False
        ).returncode


if __name__ == "__main__":
    sys.exit(main())
