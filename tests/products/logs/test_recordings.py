"""A simulated flight as a recorder on board writes it: what the readers find is what was logged."""

from typer.testing import CliRunner

from beaver_ftc.cli.main import app
from beaver_ftc_logs.samples import load_flights_for_fit
from beaver_ftc_logs.vehicle import load_vehicle

TRAVEL_RAD = {"aileron": 0.5, "elevator": 0.4, "rudder": 0.3, "flap": 1.0}


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
