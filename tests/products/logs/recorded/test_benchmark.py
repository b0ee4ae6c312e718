"""The benchmark on recorded flights, on data sets of our own making."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from beaver_ftc.cli.main import app
from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs.detectors import detector_names
from beaver_ftc_logs.recorded import other_days
from beaver_ftc_logs.recorded.benchmark import OUR_METHOD_TITLE, load_data_sets
from products.logs import synthetic


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two labelled flights of the synthetic wing."""
    root = tmp_path_factory.mktemp("flights")
    (root / "wing").mkdir()
    (root / "wing" / "vehicle.yaml").write_text(synthetic.VEHICLE)
    parts = ((60, 130, 1.0, 0.5), (170, 230, 0.0, 1.0))
    for seed in (21, 22):
        flown = synthetic.fly(280.0, parts=parts, seed=seed)
        synthetic.write_csv(root / "wing" / f"flight-{seed}.csv", flown)
    return root


@pytest.fixture(scope="module")
def document(folder, tmp_path_factory):
    """What the command says."""
    arguments = ["compare", "--flights", str(folder), "--out", str(tmp_path_factory.mktemp("compared"))]
    return json.loads(CliRunner().invoke(app, [*arguments, "--format", "json"]).stdout)


def test_every_method_has_a_row_and_ours_is_right(document):
    (part,) = document["sets"]
    rows = {row["method"]: row for row in part["rows"]}
    assert len(rows) == len(detector_names())  # no freeze rule: this vehicle names no servo outputs
    assert rows[OUR_METHOD_TITLE]["classes"] > 0.9
    assert rows[OUR_METHOD_TITLE]["mean_error"] < 0.03
    sliding = next(row for name, row in rows.items() if name.startswith("sliding"))
    assert 0.5 < sliding["classes"] < rows[OUR_METHOD_TITLE]["classes"]


def test_other_days_have_a_row_each_and_a_worst(folder, monkeypatch, tmp_path, changed):
    days = other_days.random_days(2, range(2))
    monkeypatch.setattr(other_days, "one_change_days", lambda mixer, commands: days[:1])
    monkeypatch.setattr(other_days, "random_days", lambda surfaces, seeds: days[1:])
    page = tmp_path / "page.md"
    page.write_text("<!-- other days: begin -->\n<!-- other days: end -->\n")
    arguments = ["compare", "--flights", str(folder), "--other-days", "--format", "json"]
    done = CliRunner().invoke(app, [*arguments, "--leaderboard", str(page)])
    document = json.loads(done.stdout)["other_days"]
    assert not changed(document, relative=1e-3)
    (part,) = document["sets"]
    assert all(row["classes"] > 0.7 for row in part["rows"])
    assert "| drawn, not looked at: worst |" in page.read_text()


def test_one_thing_changes_a_day(changed):
    mixer = np.array([[0.5, 0.4], [0.5, -0.6]])
    assert not changed([vars(day) for day in other_days.one_change_days(mixer, ["roll", "pitch"])])


def test_drawn_days_differ_as_they_say():
    """Standard deviations of 600 days; of the absolute of a normal number, its own."""
    drawn = other_days.random_days(2, range(600))

    def sd(name, change=np.asarray, middle=True):
        values = change(np.array([getattr(day, name) for day in drawn]))
        return values.std() if middle else np.sqrt((values**2).mean())

    found = [
        sd("trim_shift_commands"), sd("neutral_shift_commands"), sd("surface_gains", np.log),
        sd("common_gain", np.log), sd("command_delay_s"), sd("motion_scale", np.log),
        sd("noise_ratio", lambda of: of - 1.0, middle=False), sd("trim_drift_sd_commands", middle=False),
    ]  # fmt: skip
    assert found == pytest.approx([0.015, 0.01, 0.03, 0.1, 0.02, 0.25, 0.3, 0.006], rel=0.1)
    assert min(day.noise_ratio for day in drawn) >= 1.0


def test_other_days_without_a_folder():
    done = CliRunner().invoke(app, ["compare", "--other-days", "--benchmark"])
    assert "--other-days: allowed: only with --flights FOLDER" in str(done.exception)


def test_a_folder_without_flights_is_refused(tmp_path):
    with pytest.raises(BadInput, match="holds no data set"):
        load_data_sets(tmp_path)
    with pytest.raises(BadInput, match="no such folder"):
        load_data_sets(tmp_path / "none")
