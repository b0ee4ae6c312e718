"""`beaver-ftc sweep --rare`: what it answers, and what it does not go with."""

import json
from pathlib import Path

import pytest

from beaver_ftc.cli import Format
from beaver_ftc.cli.sweep import Arguments, Backend, Objective, command
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies.sweep.subset_simulation import Chains

SWEEP = """\
name: mine
base: {name: b, duration_s: 0.4, rate_hz: 50, expect: {no_departure: true, pre_fault_rms_deg_s: {q: 0.01}}}
vary: {initial.airspeed_mps: {uniform: [40, 50]}}
runs: 3
"""


@pytest.fixture
def file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Chains.__init__, "__defaults__", (2, 10))
    (tmp_path / "mine.yaml").write_text(SWEEP)
    return "mine.yaml"


def test_what_cannot_be_reached_is_no_failure(file, capsys):
    command(Arguments(file, rare="no_departure", workers=1, format=Format.json))
    said = json.loads(capsys.readouterr().out)
    assert (said["probability"], said["expectation"], said["plain"]["of"]) == (None, "no_departure", 20)
    command(Arguments(file, rare="pre_fault_rms_deg_s.q", workers=1))
    assert capsys.readouterr().out.startswith("mine: pre_fault_rms_deg_s.q not met\n  probability  ")


@pytest.mark.parametrize(
    ("other", "name"),
    [
        ({"search": Objective.delay}, "search"),
        ({"replay": 1}, "replay"),
        ({"junit": Path("j.xml")}, "junit"),
        ({"ray_address": "auto"}, "ray-address"),
        ({"backend": Backend.ray}, "backend"),
        ({"keep_logs": "all"}, "keep-logs"),
        ({"certificate": True}, "certificate"),
    ],
)
def test_what_it_does_not_go_with(other, name, file):
    with pytest.raises(BadInput, match=f"^--rare and --{name} exclude each other"):
        command(Arguments(file, rare="no_departure", **other))
