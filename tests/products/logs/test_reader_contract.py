"""One contract over every reader of logs: a row each, of a sound log, its names, and what is no such log."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import loading, readers, samples
from beaver_ftc_logs.diagnose import diagnose
from beaver_ftc_logs.readers import read_flight
from beaver_ftc_logs.vehicle import load_vehicle
from products.logs import synthetic
from products.logs.synthetic import SHORT

LATE, FROM_S = 51, 0.5  # the row, counted from 1, whose stamp is out of order, and by how much it is early
TABLE = "is no table that can be read .*, allowed: CSV or Parquet"
AUTOPILOT = r"(is no .* that can be read|holds no message)"


@dataclass(frozen=True)
class Reader:
    """write: a log of columns to a path; nonsense: what is said of text that is no log; vehicle: its file,
    None if the format has its own; topic: where columns stand; short: their names there; package: of others.
    """

    write: Callable
    nonsense: str
    vehicle: str | None = synthetic.VEHICLE
    topic: str = ""
    short: tuple = ()
    package: str = ""

    def name(self, column):
        return f"{self.topic}.{dict(self.short).get(column, column)}" if self.topic else column

    def of(self, folder):
        (folder / "vehicle.yaml").write_text(self.vehicle)
        return load_vehicle(folder / "vehicle.yaml")


def _autopilot(write, package, short=()):
    vehicle = synthetic.vehicle("RATE", dict(short))
    return Reader(write, AUTOPILOT, vehicle, "RATE", tuple(dict(short).items()), package)


READERS = {
    "csv": Reader(synthetic.write_csv, TABLE),
    "parquet": Reader(synthetic.write_parquet, TABLE),
    "ulg": _autopilot(lambda path, of: synthetic.write_ulog(path, of, "RATE"), "pyulog"),
    "log": _autopilot(synthetic.write_ardupilot, "pymavlink", {"pitch_command": "pitch_comman"}),
    "bin": _autopilot(synthetic.write_rates, "pymavlink", SHORT),
    "": Reader(lambda path, of: synthetic.write_alfa(path, columns=of), "is a file, allowed: a folder", None),
}
WITH_VEHICLE = [suffix for suffix, reader in READERS.items() if reader.vehicle]


@pytest.fixture(params=READERS, ids=lambda suffix: suffix or "alfa")
def reader(request):
    found = READERS[request.param]
    if found.package:
        pytest.importorskip(found.package)
    return found


@pytest.fixture
def path(request, tmp_path):
    suffix = request.node.callspec.params["reader"]
    return tmp_path / (f"flight.{suffix}" if suffix else "flight")


only_vehicles = pytest.mark.parametrize("reader", WITH_VEHICLE, indirect=True)
RATES = ("p_rad_s", "q_rad_s", "r_rad_s")


def test_what_was_written_comes_back(reader, path):
    written = synthetic.fly(20.0)
    found = read_flight(reader.write(path, written))
    assert found.name == "flight"
    for column in (*RATES, *(("roll_command", "pitch_command") if reader.vehicle else ())):
        read = found.columns[reader.name(column)]
        np.testing.assert_allclose(read.t_s, written["t_s"], atol=1e-6)
        np.testing.assert_array_equal(read.values, written[column])
        assert read.note == ""


@only_vehicles
def test_every_format_gives_the_same_samples(reader, path, tmp_path, wing):
    written = synthetic.fly(20.0)
    (found,) = loading.load_flights_for_fit([reader.write(path, written)], reader.of(tmp_path))
    (other,) = loading.load_flights_for_fit([synthetic.write_csv(tmp_path / "other.csv", written)], wing)
    np.testing.assert_array_equal(found.commands, other.commands)
    np.testing.assert_array_equal(found.rates, other.rates)


@only_vehicles
def test_what_is_wanted_is_read_and_what_is_missing_is_named_beside_what_is_there(reader, path, tmp_path):
    written = {name: values for name, values in synthetic.fly(20.0).items() if name in ("t_s", *RATES)}
    names = [reader.name(column) for column in RATES]
    reader.write(path, written)
    found = read_flight(path, columns=names[1:2]).columns
    np.testing.assert_array_equal(found.pop(names[1]).values, written["q_rad_s"])
    assert all(np.isnan(column.values).all() for column in found.values())
    wanted = reader.name("roll_command").replace(".", r"\.")
    with pytest.raises(BadInput, match=rf"no column {wanted}, allowed: a log that has it; it has ") as error:
        loading.load_flights_for_fit([path], reader.of(tmp_path))
    assert len(str(error.value).splitlines()) == 1
    assert all(name in str(error.value) for name in names)


@pytest.mark.parametrize("off_s", [1e6, -FROM_S])
def test_a_row_out_of_order_is_refused_in_a_table_and_left_out_of_a_log(reader, path, tmp_path, off_s):
    written = synthetic.fly(20.0)
    whole = dict(written)
    written["t_s"] = written["t_s"] + off_s * (np.arange(len(written["t_s"])) == LATE - 1)
    reader.write(path, written)
    if reader.nonsense == TABLE:
        row = LATE + (off_s > 0)
        with pytest.raises(BadInput, match=f"t_s: row {row}: time does not increase, allowed: incr"):
            read_flight(path)
        return
    column = read_flight(path).columns[reader.name("q_rad_s")]
    np.testing.assert_allclose(column.t_s, np.delete(whole["t_s"], LATE - 1), atol=1e-6)
    np.testing.assert_array_equal(column.values, np.delete(whole["q_rad_s"], LATE - 1))
    topic = reader.topic or "mavros-imu-data_raw"
    assert column.note == f"{topic}: row {LATE}: its stamp is out of order, the row is left out"


def test_what_is_no_such_log_is_one_line(reader, path):
    path.write_bytes(b"\xff not a log of any kind")
    with pytest.raises(BadInput, match=reader.nonsense) as error:
        read_flight(path, None if reader.vehicle else "alfa")
    assert len(str(error.value).splitlines()) == 1
    assert str(error.value).startswith(f"{path}: ")


@pytest.mark.parametrize("reader", [suffix for suffix, one in READERS.items() if one.package], indirect=True)
def test_without_its_package_a_log_says_what_to_install(reader, path, monkeypatch):
    monkeypatch.setitem(sys.modules, reader.package, None)
    path.write_bytes(b"x")
    with pytest.raises(BadInput, match=rf"needs {reader.package}, allowed: pip install 'beaver-ftc\[f"):
        read_flight(path)


@only_vehicles
def test_parts_of_a_long_log_hold_every_row_and_say_what_the_whole_says(
    reader, path, tmp_path, monkeypatch, wing_model
):
    """A tenth of each part once more. Blocks of a table are smaller than its parts, and end anywhere."""
    for module, limit, rows in (
        ("", "ROWS_PER_PART", 500), ("", "SAMPLES_PER_PART", 500),
        (".text", "_BLOCK_BYTES", 9000), (".parquet_table", "BATCH_ROWS", 70),
    ):  # fmt: skip
        monkeypatch.setattr(f"{readers.__name__}{module}.{limit}", rows)
    reader.write(path, synthetic.fly(240.0, parts=((100, 240, 1.0, 0.3),), seed=5))
    vehicle, name = reader.of(tmp_path), reader.name("q_rad_s")
    log = read_flight(path)
    parts = [part.columns[name] for part in loading.read_vehicle_parts(path, vehicle)]
    assert [len(part.t_s) for part in parts] == [500, 500, 500, 500, 600]
    rows = np.concatenate([parts[0].values, *(part.values[50:] for part in parts[1:])])
    np.testing.assert_array_equal(rows, log.columns[name].values)
    for one, other in pairwise(parts):
        np.testing.assert_array_equal(one.t_s[-50:], other.t_s[:50])
    whole = diagnose(samples.resample(log, vehicle), wing_model)
    for number, part in enumerate(loading.stream_flights([path], vehicle), 1):
        assert part.name == f"flight-part-{number}"
        said = diagnose(part, wing_model)
        settled = said.t_s > said.t_s[0] + 25.0
        known = np.searchsorted(whole.t_s, said.t_s[settled])
        assert (said.isolated_surfaces[settled] == whole.isolated_surfaces[known]).mean() > 0.97
        assert np.abs(said.effectiveness[settled] - whole.effectiveness[known]).mean() < 0.1
