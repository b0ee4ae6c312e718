"""A simulated flight as a recorder on board writes it: what the readers find is what was logged."""

import numpy as np
import pytest
from pyarrow import parquet
from typer.testing import CliRunner

import beaver_ftc as bf
from beaver_ftc.cli.main import app
from beaver_ftc.results.exports import RECORDING_FILE_OF_KIND, write_recording
from beaver_ftc_logs.samples import load_flights_for_fit
from beaver_ftc_logs.vehicle import load_vehicle

TRAVEL_RAD = {"aileron": 0.5, "elevator": 0.4, "rudder": 0.3, "flap": 1.0}


@pytest.fixture(scope="module")
def log_path(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flown")
    bf.fly(bf.load("elevator-partial-loss").with_({"duration_s": 16.0})).save(folder, report=False)
    return folder / "elevator-partial-loss" / "log.parquet"


@pytest.fixture(params=RECORDING_FILE_OF_KIND)
def samples(request, log_path, tmp_path):
    """The recording as `identify` gets it, at the log's own rate."""
    pytest.importorskip("pyulog")
    pytest.importorskip("pymavlink")
    write_recording(log_path, TRAVEL_RAD, request.param, tmp_path)
    vehicle = tmp_path / "vehicle.yaml"
    vehicle.write_text(vehicle.read_text() + "max_rate_hz: 100\n")
    return load_flights_for_fit([tmp_path / RECORDING_FILE_OF_KIND[request.param]], load_vehicle(vehicle))[0]


def test_rates_and_commands_come_back(samples, log_path):
    table = parquet.read_table(log_path)
    assert samples.dt_s == pytest.approx(0.01, abs=1e-6)
    np.testing.assert_allclose(samples.t_s - samples.t_s[0], table["t_s"], atol=2e-6)
    for i, axis in enumerate("pqr"):
        np.testing.assert_allclose(samples.rates[:, i], table[f"{axis}_measured_rad_s"], rtol=1e-12, atol=0)
    for i, (surface, travel) in enumerate(TRAVEL_RAD.items()):
        np.testing.assert_allclose(samples.commands[:, i] * travel, table[f"{surface}_cmd_rad"], rtol=1e-12)


def test_run_writes_the_log_and_its_vehicle_file(tmp_path):
    scenario = tmp_path / "short.yaml"
    scenario.write_text("name: short\nduration_s: 4\n")
    done = CliRunner().invoke(
        app, ["run", str(scenario), "--no-report", "--out", str(tmp_path), "--as", "table"]
    )
    assert done.exit_code == 0, done.output
    folder = tmp_path / "short"
    vehicle = load_vehicle(folder / "vehicle.yaml")
    samples = load_flights_for_fit([folder / "flight.csv"], vehicle)[0]
    assert len(samples.t_s) > 50
    assert list(vehicle.surfaces) == ["aileron", "elevator", "rudder", "flap"]


def test_an_unknown_kind_of_recording_is_refused(tmp_path):
    done = CliRunner().invoke(app, ["run", "elevator-partial-loss", "--out", str(tmp_path), "--as", "rosbag"])
    assert done.exit_code == 2
    assert not list(tmp_path.iterdir())
