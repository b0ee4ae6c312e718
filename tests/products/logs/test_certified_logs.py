"""A log of others has a certificate as a flight of ours has: proved by what the diagnosis made of it."""

import json
from pathlib import Path

import pytest
from pyarrow import parquet
from typer.testing import CliRunner

import beaver_ftc as bf
from beaver_ftc.cli.main import app
from beaver_ftc.results.recordings import RECORDING_FILE_OF_KIND, write_recording
from beaver_ftc_assurance.certificates.check_certificate import failures
from flying import SINES

LOSS = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.5, "at_s": 1.5}
GYROS = {axis: {"noise_std_deg_s": 0.02} for axis in "pqr"}
FDI = {
    "published": {},
    "all": {"fault_class": "all"},
    "chance": {"statistical": {}, "authority": "statistical", "bounds": {"sensors": GYROS}},
}


def proved(folder):
    """Certificate, its log, and why the checker refuses it."""
    document = json.loads((folder / "certificate.json").read_text())
    table = parquet.read_table(folder / "log.parquet")
    log = {name: table[name].to_numpy() for name in table.column_names}
    scenario = (folder / "scenario.yaml").read_text()
    return document, log, [*failures(document, log, scenario)]


@pytest.mark.parametrize("faults", [[LOSS], []])
@pytest.mark.parametrize("name", FDI)
def test_a_logs_alarm_and_exclusions_are_proved(name, faults, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scenario = {
        "name": "mine", "duration_s": 3.0, "reference": SINES, "faults": faults, "fdi": FDI[name],
        "sensors": GYROS if name == "chance" else {},
    }  # fmt: skip
    folder = bf.fly(scenario).save(tmp_path, report=False)
    stops = {s: max(abs(to.min_rad), abs(to.max_rad)) for s, to in bf.aircraft("beaver").travel.items()}
    write_recording(folder / "log.parquet", stops, "table", tmp_path, ("dpt",))
    head, *rows = Path(RECORDING_FILE_OF_KIND["table"]).read_text().splitlines(keepends=True)
    kept = [
        row for row in rows if not 1.1 < float(row.split(",")[0]) < 1.3
    ]  # the fault is in the second stretch
    Path(RECORDING_FILE_OF_KIND["table"]).write_text("".join([head, *kept]))
    asked = ["--aircraft", "beaver", "--scenario", str(folder / "scenario.yaml"), "--certificate"]
    done = CliRunner().invoke(app, ["diagnose", RECORDING_FILE_OF_KIND["table"], *asked])
    assert done.exit_code == 0, done.output
    document, log, refused = proved(tmp_path / "diagnoses" / "flight")
    assert refused == []
    set_at_end = {column for column in log if "likelihood" not in column and column != "t_s"}
    set_at_end = {c for c in set_at_end if (c == "detected" or c.endswith("_excluded")) and log[c][-1] > 0}
    told = [said["column"] for said in (*document["statements"], *document["without"])]
    assert set(told) - {None} == set_at_end
    assert bool(faults) == ("detected" in set_at_end)
    assert document["begins_s"] == (1.3 if faults else 0.0)
