"""How a command ends that cannot go on, or must not: a status, a line, and nothing else."""

import os
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import numpy as np
import pytest

from beaver_ftc.loop.loop import Loop
from beaver_ftc.plant.channels import TRUTH
from commands import beaver

BEAVER = Path(sys.executable).with_name("beaver-ftc")


def test_a_flight_that_is_not_finite_is_status_3(tmp_path, monkeypatch):
    begin, beta = Loop.__init__, [name for name, *_ in TRUTH].index("beta_rad")

    def begin_to_fail(self, *arguments, **options):
        begin(self, *arguments, **options)
        self.cockpit.native, self.frames["truth"]["native"] = False, 0
        read = self.cockpit.read

        def read_nonsense():
            read()
            if self.frames["k"][0] == 50:
                self.frames["truth"]["value"][0, beta] = np.nan

        self.cockpit.read = read_nonsense

    monkeypatch.setattr(Loop, "__init__", begin_to_fail)
    done = beaver("run", "elevator-partial-loss", "--no-report", cwd=tmp_path)
    (says,) = done.stderr.splitlines()
    assert done.returncode == 3
    assert "not finite at" in says
    assert list(tmp_path.rglob("*.*")) == [], "nothing is left of it"


# Undoes what nohup, or a shell that starts jobs in the background, has the tests' process ignore.
HEARD_AGAIN = """
import os, signal, sys
signal.signal(signal.SIGTERM, signal.SIG_DFL)
os.execv(sys.argv[1], sys.argv[1:])
"""


def test_tuning_that_is_ended_says_nothing(tmp_path):
    """Before its workers have started and while they fly; what the rivals ship with is as it was."""
    from beaver_ftc.diagnosis.rivals import TUNED_FILE

    before = TUNED_FILE.read_bytes()
    command = [sys.executable, "-c", HEARD_AGAIN, BEAVER, "compare", "--tune", "--workers", "2"]
    environment = {**os.environ, "COLUMNS": "80"}
    with subprocess.Popen(command, cwd=tmp_path, env=environment, stderr=subprocess.PIPE) as running:
        time.sleep(3.0)
        assert running.poll() is None
        running.send_signal(signal.SIGTERM)
        said = running.communicate(timeout=30)[1]
    assert running.returncode == 143
    assert b"Traceback" not in said
    assert b"Error" not in said
    assert TUNED_FILE.read_bytes() == before
    assert list(tmp_path.iterdir()) == []


INTERRUPTED = """
import signal, sys

class Finder:
    @staticmethod
    def find_spec(name, *_):
        if name == sys.argv[1]:
            signal.raise_signal(signal.SIGINT)

signal.signal(signal.SIGINT, signal.default_int_handler)
sys.meta_path.insert(0, Finder)
from importlib.metadata import EntryPoint
sys.exit(EntryPoint("beaver-ftc", sys.argv[2], "console_scripts").load()())
"""


@pytest.mark.parametrize(
    "imported", ["beaver_ftc", "beaver_ftc.public", "beaver_ftc.cli", "typer", "beaver_ftc.cli.main"]
)
def test_ctrl_c_during_any_import_leaves_no_trace(imported):
    """As the script that an installer writes: it imports what pyproject.toml names, and calls it."""
    pyproject = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))
    entry = pyproject["project"]["scripts"]["beaver-ftc"]
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED, imported, entry], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (130, "")
