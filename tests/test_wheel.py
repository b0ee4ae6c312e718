"""The built wheel carries the aircraft and the scenarios, and works outside the repository."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    built = subprocess.run(
        [*pip, "wheel", "--no-deps", "--wheel-dir", folder, ROOT], capture_output=True, text=True, check=False
    )
    if built.returncode:
        pytest.skip(f"no wheel without the build backend: {built.stderr.strip().splitlines()[-1]}")
    (wheel,) = folder.glob("*.whl")
    target = folder / "site"
    subprocess.run([*pip, "install", "--no-deps", "--target", target, wheel], check=True, capture_output=True)
    return target


def beaver_ftc(installed, folder, *arguments):
    start = "import sys; from beaver_ftc.cli.main import main; sys.exit(main())"
    return subprocess.run(
        [sys.executable, "-c", start, *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(installed)},
        capture_output=True,
        text=True,
        check=False,
    )


def test_it_flies_a_built_in_scenario_from_anywhere(installed, tmp_path):
    done = beaver_ftc(installed, tmp_path, "run", "elevator-partial-loss", "--no-report", "--format", "json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["passed"] is True
    assert (tmp_path / "runs" / "elevator-partial-loss" / "log.parquet").exists()


def test_it_is_the_installed_package_that_flew(installed, tmp_path):
    done = beaver_ftc(installed, tmp_path, "validate", "fault-free")
    assert done.returncode == 0, done.stderr
    assert (installed / "beaver_ftc" / "data" / "aircraft" / "beaver" / "beaver.xml").exists()
