import numpy as np
import pandas as pd
import pytest

from beaver_ftc.results.exports import ACMI_RATE_HZ, write_acmi
from beaver_ftc.results.metrics import measure, metrics
from beaver_ftc.results.model import Metrics

EARTH_RADIUS_M = 6371000.0


def _parse(path):
    """Frames {time: {property: text}} of the one aircraft, and (time, text) of each bookmark [ACMI 2.2]."""
    header, *lines = path.read_text(encoding="utf-8").splitlines()
    assert (header, lines[0]) == ("FileType=text/acmi/tacview", "FileVersion=2.2")
    time, frames, events = None, {}, []
    for line in lines[1:]:
        if line.startswith("#"):
            time = float(line[1:])
            continue
        identity, rest = line.split(",", 1)
        if identity == "0" and rest.startswith("Event="):
            events.append((time, rest.removeprefix("Event=Bookmark|b1|")))
        elif identity == "b1" and time is not None:
            frames[time] = dict(part.split("=", 1) for part in rest.split(","))
    return frames, events


@pytest.fixture
def recording(log_path, flight, tmp_path):
    write_acmi(log_path, measure(flight), tmp_path / "flight.acmi")
    return _parse(tmp_path / "flight.acmi")


def test_recording_follows_the_flight_at_a_rate_to_look_at(recording, log_path):
    frames, _ = recording
    log = pd.read_parquet(log_path)
    times = np.array(list(frames))
    assert np.diff(times) == pytest.approx(1 / ACMI_RATE_HZ)
    assert times[-1] == pytest.approx(log["t_s"].iloc[-1], abs=1 / ACMI_RATE_HZ)
    for time in (0.0, times[len(times) // 2]):
        row = log.iloc[round(time * 100)]
        longitude, latitude, altitude, roll, pitch, yaw = map(float, frames[time]["T"].split("|"))
        assert np.radians(latitude - 45) * EARTH_RADIUS_M == pytest.approx(row["north_m"], rel=1e-3, abs=0.01)
        assert np.radians(longitude) * EARTH_RADIUS_M * np.cos(np.pi / 4) == pytest.approx(
            row["east_m"], rel=1e-3, abs=0.01
        )
        assert altitude == pytest.approx(row["altitude_m"], abs=1e-3)
        attitude = np.degrees([row["phi_rad"], row["theta_rad"], row["psi_rad"]])
        assert [roll, pitch, yaw] == pytest.approx(attitude, abs=1e-3)
        assert float(frames[time]["TAS"]) == pytest.approx(row["airspeed_mps"], abs=1e-3)


def test_a_false_alarm_is_a_bookmark_before_the_faults(log_path, flight, tmp_path):
    alarmed = metrics(flight)
    alarmed["detection"]["time_s"] = 3.0
    write_acmi(log_path, Metrics.of(alarmed), tmp_path / "flight.acmi")
    found = [(text, pytest.approx(time)) for time, text in _parse(tmp_path / "flight.acmi")[1]]
    assert found == [("detection 3.00 s", 3.0), ("fault 12.00 s", 12.0), ("isolation 12.12 s", 12.12)]
