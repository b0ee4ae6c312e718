"""Every field that leaves a log, held against the log: a table of fields a format, and no field beside them.

In the log of these tests no two columns are alike, so that one taken for another shows.
"""

import math

import numpy as np
import pytest
from pyarrow import parquet

from beaver_ftc.aircraft import load
from beaver_ftc.results.exports import write_acmi
from beaver_ftc.results.log import ParquetLog
from beaver_ftc.results.metrics import measure
from beaver_ftc.results.recordings import RECORDING_FILE_OF_KIND, write_recording
from beaver_ftc_logs.readers import read_flight
from results.synthetic import landed

RATE_HZ, FRAMES = 24.0, 60  # of whose microseconds a third is cut or rounded
# As many surfaces as the imported GTM has, more than the fields of one dataflash message.
TRAVEL_RAD = {"flap": 1.0, **{f"surface_{i}": 0.3 + 0.1 * i for i in range(16)}}
DEG = 180.0 / math.pi
COLUMNS = (
    "north_m", "east_m", "altitude_m", "phi_rad", "theta_rad", "psi_rad", "airspeed_mps", "alpha_rad",
    "beta_rad", "p_measured_rad_s", "q_measured_rad_s", "r_measured_rad_s", "flap_pos_rad", "qdyn_pa", "dpt",
    *(f"{name}_cmd_rad" for name in TRAVEL_RAD),
)  # fmt: skip


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """A log whose columns are drawn, each by itself."""
    rng = np.random.default_rng(11)
    path = tmp_path_factory.mktemp("drawn") / "log.parquet"
    with ParquetLog(path) as log:
        log.open(("t_s", *COLUMNS))
        t_s = np.arange(FRAMES) / RATE_HZ
        log.write(np.column_stack([t_s, rng.uniform(-0.25, 0.25, (FRAMES, len(COLUMNS)))]))
    return path


@pytest.fixture(scope="module")
def columns(path):
    table = parquet.read_table(path)
    return {name: table[name].to_numpy() for name in table.column_names}


# Property of ACMI 2.2: column of the log, and what it is multiplied by.
ACMI = {
    "roll": ("phi_rad", DEG),
    "pitch": ("theta_rad", DEG),
    "yaw": ("psi_rad", DEG),
    "altitude": ("altitude_m", 1.0),
    "TAS": ("airspeed_mps", 1.0),
    "AOA": ("alpha_rad", DEG),
    "AOS": ("beta_rad", DEG),
    "Flaps": ("flap_pos_rad", 1.0 / load().travel["flap"].max_rad),
}
_PLACED = ("longitude", "latitude", "altitude", "roll", "pitch", "yaw")


def test_every_property_of_the_tacview_recording(path, columns, tmp_path):
    write_acmi(path, measure(landed()), tmp_path / "flight.acmi", load())
    found = {}
    for line in (tmp_path / "flight.acmi").read_text().splitlines():
        if line.startswith("b1,T="):
            properties = dict(part.split("=") for part in line.removeprefix("b1,").split(","))
            properties |= dict(zip(_PLACED, properties.pop("T").split("|"), strict=True))
            for name, text in properties.items():
                found.setdefault(name, []).append(float(text))
    radius_m = 6_371_000.0 + columns["altitude_m"][0]
    north = (np.array(found.pop("latitude")) - 45.0) / DEG * radius_m
    east = np.array(found.pop("longitude")) / DEG * radius_m * math.cos(math.radians(45.0))
    np.testing.assert_allclose(north, columns["north_m"], atol=2e-3)
    np.testing.assert_allclose(east, columns["east_m"], atol=2e-3)
    assert found.keys() == ACMI.keys()
    for name, (column, factor) in ACMI.items():
        np.testing.assert_allclose(found[name], columns[column] * factor, atol=6e-4, err_msg=name)


# What a recorder on board writes: field, column of the log, what it is multiplied by.
_SHARES = {name: (f"{name}_cmd_rad", 1.0 / travel) for name, travel in TRAVEL_RAD.items()}
_RATES = [(f"{axis}_measured_rad_s", 1.0) for axis in "pqr"]
_ANGLES = {"roll": "phi_rad", "pitch": "theta_rad", "yaw": "psi_rad"}
_FLOW = ("alpha_rad", "beta_rad", "qdyn_pa", "dpt")
RECORDED = {
    "table": {
        **dict(zip(("p_rad_s", "q_rad_s", "r_rad_s"), _RATES, strict=True)),
        **{f"{name}_command": share for name, share in _SHARES.items()},
        **{f"{angle}_rad": (column, 1.0) for angle, column in _ANGLES.items()},
        "airspeed_mps": ("airspeed_mps", 1.0),
        **{name: (name, 1.0) for name in _FLOW},
    },
    "ulog": {
        **{f"vehicle_angular_velocity.xyz[{i}]": rate for i, rate in enumerate(_RATES)},
        **{f"actuator_servos.control[{i}]": share for i, share in enumerate(_SHARES.values())},
        "airspeed.true_airspeed_m_s": ("airspeed_mps", 1.0),
        **{f"attitude.{angle}_rad": (column, 1.0) for angle, column in _ANGLES.items()},
        **{f"flow.{name}": (name, 1.0) for name in _FLOW},
    },
    "ardupilot": {
        **{f"IMU.Gyr{x}": rate for x, rate in zip("XYZ", _RATES, strict=True)},
        **{f"SRF{'CD'[i // 15]}.C{i % 15 + 1}": share for i, share in enumerate(_SHARES.values())},
        "ARSP.Airspeed": ("airspeed_mps", 1.0),
        **{f"ATT.{angle.title()}": (column, DEG) for angle, column in _ANGLES.items()},
        **{f"FL{i}.V": (name, 1.0) for i, name in enumerate(_FLOW)},
    },
}


@pytest.mark.parametrize("kind", RECORDING_FILE_OF_KIND)
def test_every_field_of_a_recording(path, columns, tmp_path, kind):
    pytest.importorskip("pyulog")
    pytest.importorskip("pymavlink")
    write_recording(path, TRAVEL_RAD, kind, tmp_path, ("dpt",))
    found = read_flight(tmp_path / RECORDING_FILE_OF_KIND[kind]).columns
    assert found.keys() == RECORDED[kind].keys()
    for name, (column, factor) in RECORDED[kind].items():
        np.testing.assert_allclose(found[name].t_s, columns["t_s"], rtol=0, atol=0.6e-6, err_msg=name)
        np.testing.assert_allclose(found[name].values, columns[column] * factor, rtol=1e-12, err_msg=name)
