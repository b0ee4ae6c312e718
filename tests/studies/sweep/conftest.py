import os
import subprocess
import sys
from pathlib import Path

import pytest

from beaver_ftc.scenario.sweeps import Sweep, load_sweep_text

SHORT = """\
name: short
base: elevator-partial-loss
set: {duration_s: 1, expect: {}, "faults[0].at_s": 0.5}
runs: 48
seed: 3
vary:
  faults[0].magnitude: {uniform: [0.05, 1.0]}
  faults[0].actuator: {choice: [aileron, elevator, rudder]}
  initial.airspeed_mps: {normal: [45, 3], within: [36, 54]}
"""


def sweep_of(text: str = SHORT, **replaced: str) -> Sweep:
    for old, new in replaced.items():
        text = text.replace(old, new)
    return load_sweep_text(text, "short.yaml")


@pytest.fixture
def short() -> Sweep:
    return sweep_of()


@pytest.fixture
def small_batches(monkeypatch):
    """Batches of a few flights, so that a short sweep has many of them."""
    monkeypatch.setattr("beaver_ftc.studies.sweep.campaign.FRAMES_A_BATCH", 400)


COMMAND_LINE = """
import sys
import beaver_ftc.studies.sweep.campaign as source
source.FRAMES_A_BATCH = 400
from beaver_ftc.cli.main import main
if __name__ == "__main__":
    main()
"""


@pytest.fixture
def start(tmp_path):
    """Start `beaver-ftc sweep` as a process of its own, in the test's folder, with small batches."""
    script = tmp_path / "command.py"
    script.write_text(COMMAND_LINE)

    def begin(*arguments: str) -> subprocess.Popen:
        return subprocess.Popen(
            [sys.executable, str(script), "sweep", *map(str, arguments)],
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"},
        )

    return begin


def parts_in(folder: Path) -> int:
    return len(list(folder.glob("parts/*.parquet")))
