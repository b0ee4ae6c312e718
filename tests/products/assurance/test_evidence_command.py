"""`beaver-ftc evidence`: exit statuses, what it prints and writes, one flight again."""

import json

import pytest
import typer

from beaver_ftc.cli import Format
from beaver_ftc_assurance.commands.evidence import Arguments, command

PLAN = """\
name: mine
flights:
  own: {duration_s: 0.4}
requirements:
  - {id: A, over: [own], expect: {no_departure: true}}
  - {id: B, over: [own], formula: "always(altitude_m <= LIMIT)"}
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def ended(limit=5000, **options):
        (tmp_path / "plan.yaml").write_text(PLAN.replace("LIMIT", str(limit)))
        with pytest.raises(typer.Exit) as end:
            command(Arguments("plan.yaml", workers=1, **options))
        return end.value.exit_code

    return ended


def test_one_not_met_and_that_flight_again(here, tmp_path, capsys):
    assert here(1000, out=tmp_path / "there", format=Format.json) == 1
    document = json.loads(capsys.readouterr().out)
    assert [each["verdict"] for each in document["requirements"]] == ["met", "not met"]
    assert document["requirements"][1]["worst"]["command"] == "beaver-ftc evidence plan.yaml --replay own"
    assert document["folder"] == str(tmp_path / "there")
    assert (tmp_path / "there" / "evidence.json").exists()
    assert here(1000, replay="own", no_report=True) == 1
    assert "B not met: robustness -829" in capsys.readouterr().out
    assert (tmp_path / "runs" / "own" / "log.parquet").exists()
    assert here(5000, replay="own", no_report=True, format=Format.json) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["requirements"][0] == "A met: no departure: yes, asked yes"
