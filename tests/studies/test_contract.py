"""What every study promises at the command line: help, a mistake in a line, a document, and its files."""

import json

import pytest

from beaver_ftc.commands import COMMANDS, StudyCommand
from beaver_ftc.plugins import loaded
from commands import beaver
from flying import loss

STUDIES = {name: study for name, target in COMMANDS.items() if isinstance(study := loaded(target), type)}
SHORT = {
    "name": "short", "duration_s": 3.0, "rate_hz": 20,
    "reference": {"q": [{"sine": {"amplitude_deg_s": 5.0, "frequency_hz": 0.5}}]},
    "faults": [loss(at_s=1.5)],
}  # fmt: skip
MISTAKES = {  # of each study a line that it cannot answer, and what is said of it
    "linearise": (["nothing"], "nothing"),
    "reproduce": (["--workers", "0"], "--workers"),
    "matrix": (["--pitch-lost", "--declared"], "exclude each other"),
    "sensitivity": (["nothing"], "nothing"),
    "bench": (["--rounds", "0"], "--rounds"),
    "verify": (["--faults", "-1"], "--faults"),
    "detectability": (["short.yaml", "--surface", "flap"], "allowed: aileron, elevator, rudder"),
}


@pytest.fixture
def call(tmp_path):
    (tmp_path / "short.yaml").write_text(json.dumps(SHORT))
    return lambda *line: beaver(*line, cwd=tmp_path)


@pytest.mark.parametrize("name", STUDIES)
def test_help_has_every_option_and_what_it_is_for(name, call):
    done, study = call(name, "--help"), STUDIES[name]
    text = " ".join(done.stdout.split())
    assert issubclass(study, StudyCommand)
    assert done.returncode == 0
    assert study.__doc__.splitlines()[0] in text
    options = (name.replace("_", "-") for name in study.__dataclass_fields__ if name != "scenario")
    assert all(f"--{option}" in text for option in options if option != "workers" or "processes" in text)
    assert ("--plugin" in text) == study.PLUGINS


@pytest.mark.parametrize("name", STUDIES)
def test_a_mistake_is_said_and_exits_with_2(name, call, tmp_path):
    line, says = MISTAKES[name]
    done = call(name, *line)
    assert (done.returncode, done.stdout) == (2, "")
    assert says in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "runs").exists()
