"""A log whose clock jumps: a gap costs nothing, a stamp out of order is said with its row."""

import json

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs.diagnose import diagnose
from beaver_ftc_logs.findings import as_text, verdict_document
from beaver_ftc_logs.readers import read_flight
from beaver_ftc_logs.recording import rows_with_increasing_time
from beaver_ftc_logs.samples import load_flights_for_fit
from products.logs import limited, synthetic

JUMP_S = 1e6
ROWS = 1500
SHORT = {"p_rad_s": "p", "q_rad_s": "q", "r_rad_s": "r", "roll_command": "roll", "pitch_command": "pitch"}


def fast(jump_s=JUMP_S, seed=5):
    """A flight at 50 Hz, so that it is averaged, whose clock jumps in the middle."""
    columns = synthetic.fly(ROWS / synthetic.RATE_HZ, seed=seed)
    columns["t_s"] = columns["t_s"] / 5.0
    columns["t_s"][ROWS // 2 :] += jump_s
    return columns


def dataflash(path, columns):
    rows = [
        ("RATE", {"TimeUS": round(t_s * 1e6) + 1_000_000} | {SHORT[name]: columns[name][i] for name in SHORT})
        for i, t_s in enumerate(columns["t_s"])
    ]
    return synthetic.write_dataflash(path, rows)


def alfa(folder, change):
    """An ALFA folder at five times its rate, each stamp, s from the first, changed: change(t_s, row)."""
    synthetic.write_alfa(folder, duration_s=ROWS / synthetic.RATE_HZ)
    for path in folder.glob("*.csv"):
        header, *lines = path.read_text().splitlines()
        origin = 1_538_768_543_780_097_959
        for row, line in enumerate(lines):
            stamp, rest = line.split(",", 1)
            t_s = change((int(stamp) - origin) * 1e-9 / 5.0, row)
            lines[row] = f"{origin + round(t_s * 1e9)},{rest}"
        path.write_text("\n".join([header, *lines]) + "\n")
    return folder


WRITERS = {
    "csv": (synthetic.VEHICLE, synthetic.write_csv),
    "parquet": (synthetic.VEHICLE, synthetic.write_parquet),
    "ulg": (synthetic.vehicle("vehicle_rates"), synthetic.write_ulog),
    "log": (synthetic.vehicle("RATE", {"pitch_command": "pitch_comman"}), synthetic.write_ardupilot),
    "bin": (synthetic.vehicle("RATE", SHORT), dataflash),
}


def test_a_jump_of_the_clock_costs_no_memory(tmp_path):
    """Every reader through both commands, in one process of 3 GB: the jump in the time base alone wants 4."""
    pytest.importorskip("pyulog"), pytest.importorskip("pymavlink")
    end_s = ROWS / 2 / 50.0
    folder = alfa(tmp_path / "alfa", lambda t_s, row: t_s + JUMP_S * (t_s >= end_s))
    flights = [("alfa", folder)]
    for suffix in ("parquet", "ulg", "bin"):
        vehicle, write = WRITERS[suffix]
        (tmp_path / f"{suffix}.yaml").write_text(vehicle)
        flights.append((tmp_path / f"{suffix}.yaml", write(tmp_path / f"flight.{suffix}", fast())))
    commands = []
    for number, (vehicle, log) in enumerate(flights):
        model, out = tmp_path / f"{number}.json", tmp_path / f"out-{number}"
        commands.append(["identify", log, "--vehicle", vehicle, "--out", model])
        commands.append(["diagnose", log, "--model", model, "--out", out])
    statuses, said = limited.run(commands)
    assert statuses == [0] * 8, said


def test_a_gap_is_a_gap_however_long(wing, wing_model, tmp_path):
    """The same flight with 10 s and with 10,000 missing: the same samples, and the same of each said."""
    rows = []
    for number, jump_s in enumerate((10.0, 1e4)):
        path = synthetic.write_csv(tmp_path / f"{number}.csv", fast(jump_s))
        samples = load_flights_for_fit([path], wing)[0]
        model = wing_model.model_copy(update={"rate_hz": 20.0})
        rows.append((samples, diagnose(samples, model)))
        text = as_text(verdict_document(samples, model, rows[-1][1]))
        assert text.splitlines()[0].endswith(" in 30 s, 1 gap in the log left out")
    (one, said), (other, said_too) = rows
    assert one.stretch_number[0] == 0
    assert one.stretch_number[-1] == 1
    np.testing.assert_array_equal(one.stretch_number, other.stretch_number)
    np.testing.assert_allclose(one.rates, other.rates, atol=1e-12)
    np.testing.assert_allclose(said.fault_probability, said_too.fault_probability, atol=1e-9)


def test_a_time_in_another_unit_is_told(wing, tmp_path):
    """In units of 1e9 s the flight lasts no time at all."""
    columns = fast(0.0)
    columns["t_s"] = columns["t_s"] * 1e-9
    with pytest.raises(BadInput, match=r"logged at 5e\+10 Hz, allowed: up to 100000 Hz, time in seconds"):
        load_flights_for_fit([synthetic.write_csv(tmp_path / "tiny.csv", columns)], wing)


DAMAGED = 51  # the row, counted from 1, whose stamp is off


@pytest.mark.parametrize("off_s", [JUMP_S, -0.5])
@pytest.mark.parametrize("suffix", ["ulg", "log", "bin"])
def test_a_damaged_stamp_costs_its_row_and_is_said(tmp_path, suffix, off_s):
    pytest.importorskip("pyulog"), pytest.importorskip("pymavlink")
    from beaver_ftc_logs.samples import resample
    from beaver_ftc_logs.vehicle import load_vehicle

    vehicle, write = WRITERS[suffix]
    (tmp_path / "vehicle.yaml").write_text(vehicle)
    columns = fast(0.0)
    whole = read_flight(write(tmp_path / f"whole.{suffix}", columns))
    columns["t_s"][DAMAGED - 1] += off_s
    damaged = read_flight(write(tmp_path / f"damaged.{suffix}", columns))
    topic = next(iter(whole.columns)).split(".")[0]
    for name, column in damaged.columns.items():
        for field in ("t_s", "values"):
            of_all = getattr(whole.columns[name], field)
            np.testing.assert_array_equal(getattr(column, field), np.delete(of_all, DAMAGED - 1))
    samples = resample(damaged, load_vehicle(tmp_path / "vehicle.yaml"))
    said = f"{topic}: row {DAMAGED}: its stamp is out of order, the row is left out"
    assert [note for note in samples.notes if "out of order" in note] == [said]


def test_a_damaged_stamp_of_a_topic_of_alfa(tmp_path):
    folder = alfa(tmp_path / "alfa", lambda t_s, row: t_s + JUMP_S * (row == DAMAGED - 1))
    whole = alfa(tmp_path / "whole", lambda t_s, row: t_s)
    column, of_all = (read_flight(path).columns["p_rad_s"] for path in (folder, whole))
    np.testing.assert_array_equal(column.t_s, np.delete(of_all.t_s, DAMAGED - 1))
    np.testing.assert_array_equal(column.values, np.delete(of_all.values, DAMAGED - 1))
    assert "mavros-imu-data_raw: row 51: its stamp is out of order" in column.note


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_damaged_stamp_of_a_table_is_refused(tmp_path, suffix):
    columns = fast(0.0)
    columns["t_s"][DAMAGED - 1] -= 0.5
    with pytest.raises(BadInput, match="row 51: time does not increase, allowed: increasing seconds"):
        read_flight(WRITERS[suffix][1](tmp_path / f"flight.{suffix}", columns))


def test_what_was_left_out_is_in_the_verdict(wing_model, tmp_path):
    """As a file, as text and on the page; and in the account of an identification."""
    pytest.importorskip("pyulog")
    from typer.testing import CliRunner

    from beaver_ftc.cli.main import app

    (tmp_path / "px4.yaml").write_text(synthetic.vehicle("vehicle_rates"))
    columns = synthetic.fly(60.0, seed=8)
    columns["t_s"][DAMAGED - 1] += JUMP_S
    log = synthetic.write_ulog(tmp_path / "flight.ulg", columns)
    commands = (
        ["identify", log, "--vehicle", tmp_path / "px4.yaml", "--out", tmp_path / "px4.json"],
        ["diagnose", log, "--model", tmp_path / "px4.json", "--out", tmp_path / "out"],
    )
    said = "vehicle_rates: row 51: its stamp is out of order"
    for command in commands:
        done = CliRunner().invoke(app, list(map(str, command)), catch_exceptions=False)
        assert said in done.stdout
    assert said in str(json.loads((tmp_path / "out" / "flight" / "verdict.json").read_text())["notes"])
    assert said in (tmp_path / "out" / "flight" / "report.html").read_text()


def test_no_row_more_than_needed_is_left_out():
    """Against all subsequences of short logs."""
    rng = np.random.default_rng(2)
    for _ in range(200):
        t_s = rng.integers(0, 8, 8).astype(float)
        kept, _ = rows_with_increasing_time("x", t_s)
        assert (np.diff(t_s[kept]) > 0).all()
        masks = ((np.arange(256)[:, None] >> np.arange(8)) & 1).astype(bool)
        longest = max(mask.sum() for mask in masks if (np.diff(t_s[mask]) > 0).all())
        assert len(kept) == longest
