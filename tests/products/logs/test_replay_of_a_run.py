"""The log of a flight of ours, diagnosed again: the verdicts of the flight, to the bit."""

import json

import pytest
from pyarrow import parquet

import beaver_ftc as bf
from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs.replay import replay_run_log
from products.logs import small

DECLARED = {"rate_hz": 50, "actuators": "servo", "fdi": {"sharpen": "none"}}
WITHDRAWN = {"design_model": {"linearised": True}, "fdi": {"bounds": {"coefficients": 0.05}}}


def flown(folder, changes):
    flight = bf.fly(bf.load("elevator-partial-loss").with_({"duration_s": 16.0, **changes}))
    flight.save(folder, report=False)
    return folder / "elevator-partial-loss", flight


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return flown(tmp_path_factory.mktemp("runs"), {})


@pytest.mark.parametrize("changes", [{}, DECLARED, WITHDRAWN], ids=["as usual", "declared", "withdrawn"])
def test_detection_and_isolation_are_those_of_the_flight(changes, tmp_path):
    folder, flight = flown(tmp_path, changes)
    columns, verdict = replay_run_log(folder / "log.parquet")
    told = [verdict[key] for key in ("as_flown", "rows_that_differ", "left_out")]
    assert told == [True, 0, []]
    assert verdict["detection_s"] == pytest.approx(flight.detection.time_s)
    assert columns["faulty"].tolist() == [int(flag) for flag in flight.log["detected"]]


def test_a_reading_that_the_log_lacks_is_told(tmp_path):
    fault = {"type": "bias", "sensor": "alpha", "magnitude": 6, "at_s": 1.0}
    folder, _ = flown(tmp_path, {"faults": [fault], "duration_s": 2.0})
    _, verdict = replay_run_log(folder / "log.parquet")
    assert verdict["left_out"] == ["the fault of alpha: the log has the true value"]


def test_a_changed_log_is_not_as_flown(run, tmp_path):
    """One rate of one row is off: the replay reads the log, it does not copy the flight's verdict."""
    folder, flight = run
    table = parquet.read_table(folder / "log.parquet").to_pandas()
    at = table.index[table["t_s"] >= 5.0][0]
    table.loc[at, "q_measured_rad_s"] += 0.2
    for name in ("scenario.yaml", "metrics.json"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    table.to_parquet(tmp_path / "log.parquet")
    _, verdict = replay_run_log(tmp_path / "log.parquet")
    assert verdict["as_flown"] is False
    assert verdict["detection_s"] == pytest.approx(5.0, abs=0.02)
    assert flight.detection.time_s > 5.1


@pytest.mark.parametrize(
    ("rows", "stamp", "says"),
    [(0, None, "has 0 rows, allowed: at least 2"), (600, 3.0, "t_s: row 501: time does not increase")],
    ids=["empty", "back"],
)
def test_a_damaged_log_is_told(run, tmp_path, rows, stamp, says):
    folder, _ = run
    table = parquet.read_table(folder / "log.parquet").to_pandas()[:rows]
    if stamp is not None:
        table.loc[500, "t_s"] = stamp
    (tmp_path / "scenario.yaml").write_bytes((folder / "scenario.yaml").read_bytes())
    table.to_parquet(tmp_path / "log.parquet")
    with pytest.raises(BadInput, match=says):
        replay_run_log(tmp_path / "log.parquet")


@pytest.mark.parametrize("text", ["{", "null", "{}", '{"detection": 3}', "[" * 100_000])
def test_damaged_metrics_beside_the_log_are_told(run, tmp_path, text):
    folder, _ = run
    for name in ("scenario.yaml", "log.parquet"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    (tmp_path / "metrics.json").write_text(text)
    with pytest.raises(
        BadInput, match=r"metrics\.json: cannot be read, allowed: the metrics\.json of the flight"
    ):
        replay_run_log(tmp_path / "log.parquet")


def test_the_command_writes_rows_and_verdict(run, tmp_path):
    folder, flight = run
    done = small.run("diagnose", folder / "log.parquet", "--out", tmp_path, "--format", "json")
    (verdict,) = json.loads(done.stdout)["flights"]
    assert verdict["as_flown"] is True
    rows = parquet.read_table(tmp_path / folder.name / "diagnosis.parquet")
    assert rows.column_names[:3] == ["t_s", "faulty", "named"]
    assert rows.num_rows == len(flight.log)


def test_two_flights_of_one_name_are_refused(run, tmp_path):
    log = run[0] / "log.parquet"
    with pytest.raises(BadInput, match="two flights are named elevator-partial-loss"):
        small.run("diagnose", log, log, "--out", tmp_path)


def test_another_table_wants_a_model(tmp_path):
    path = tmp_path / "flight.csv"
    path.write_text("t_s,p\n0,1\n1,2\n")
    with pytest.raises(BadInput, match="--model is missing"):
        small.run("diagnose", path, "--out", tmp_path)
