"""What lies on the disk: logs whole, sliced, damaged or too large; result folders, exchanged and refused."""

import ctypes
import errno
import os
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet
from synthetic import Flight

import beaver_ftc as bf
from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.results import log, writer
from beaver_ftc.results.flight import Flight as Opened
from beaver_ftc.results.log import Columns, MemoryLog, ParquetLog, log_dataframe
from beaver_ftc.results.metrics import measure, metrics
from beaver_ftc.results.writer import refuse_foreign, result_folder
from beaver_ftc.scenario.schema import Scenario

NAMES = ("t_s", "x", "y")


def _rows(frames, first=0):
    return np.arange(first, first + frames)[:, None] * [0.5, 1.0, -2.0]


def _filled(sink, *pieces):
    sink.open(NAMES)
    for piece in pieces:
        buffer = piece.copy()
        sink.write(buffer)
        buffer[:] = np.nan  # the loop reuses its buffer
    sink.close()
    return sink


def _open_files():
    return set(os.listdir("/proc/self/fd")) if Path("/proc/self/fd").exists() else set()


def test_a_group_has_16384_rows_and_the_file_is_closed(tmp_path):
    before = _open_files()
    _filled(ParquetLog(tmp_path / "log.parquet"), _rows(16_000), _rows(385, 16_000))
    assert [chunk["x"].size for chunk in log.read_chunks(tmp_path / "log.parquet")] == [16_384, 1]
    assert np.array_equal(log.read(tmp_path / "log.parquet", ["y"])["y"], _rows(16_385)[:, 2])
    assert _open_files() == before


def test_a_log_never_opened_is_closed_all_the_same(tmp_path):
    ParquetLog(tmp_path / "log.parquet").close()
    assert not (tmp_path / "log.parquet").exists()


def test_a_file_is_closed_whatever_its_last_rows_come_to(tmp_path, monkeypatch):
    sink, before = ParquetLog(tmp_path / "log.parquet"), _open_files()
    sink.open(NAMES)
    sink.write(_rows(3))

    def full(writer):
        raise OSError(errno.ENOSPC, "raised by the test")

    monkeypatch.setattr(sink, "_flush", full)
    with pytest.raises(OSError, match="raised by the test"):
        sink.close()
    sink.close()  # once is enough
    assert _open_files() == before


def test_a_log_in_memory_is_one_table_whatever_its_pieces():
    kept = _filled(MemoryLog(), _rows(2), _rows(3, 2), _rows(1, 5))
    assert kept.row_count() == 6
    assert [chunk["y"].size for chunk in kept.read_chunks()] == [2, 3, 1]
    then = kept.frozen_copy()
    assert list(next(then.read_chunks(["y", "t_s"]))) == ["y", "t_s"]
    assert np.array_equal(kept.rows, _rows(6))
    kept.write(_rows(1))
    assert (then.row_count(), kept.row_count()) == (6, 7)
    empty = _filled(MemoryLog())
    assert (empty.rows.shape, list(empty.read_chunks())) == ((0, 3), [{n: pytest.approx([]) for n in NAMES}])


def test_columns_of_a_flight_all_or_some():
    every, some = (_filled(Columns(*names), _rows(2), _rows(2, 2)) for names in ((), ("y", "t_s")))
    assert (list(every), list(some)) == (list(NAMES), ["y", "t_s"])
    assert np.array_equal(every.read("y", "x"), _rows(4)[:, [2, 1]])
    assert {name: list(column) for name, column in some.since(1.0).items()} == {
        "y": [-4.0, -6.0],
        "t_s": [1.0, 1.5],
    }


def test_part_of_a_column_is_read_from_where_it_begins():
    whole = pa.array([1.0, 2.0, 3.0, 4.0])
    parts = pa.chunked_array([whole.slice(1, 2), whole.slice(3)])
    assert list(log._column_values(parts)) == [2.0, 3.0, 4.0]
    assert log._column_values(pa.chunked_array([], pa.float64())).size == 0


@pytest.mark.parametrize(("rows", "allowed"), [(1_000_000, True), (1_000_001, False)])
def test_a_row_group_of_a_million_rows_at_most_is_read(tmp_path, rows, allowed):
    table = pa.table({"t_s": pa.array(np.zeros(rows))})
    parquet.write_table(table, tmp_path / "log.parquet", row_group_size=rows)
    if allowed:
        assert log.row_count(tmp_path / "log.parquet") == rows
        return
    with pytest.raises(BadInput, match=r"has 1,000,001 rows in a row group, allowed: up to 1,000,000"):
        log.row_count(tmp_path / "log.parquet")


def test_what_is_no_log_and_what_cannot_be_read(tmp_path, monkeypatch):
    (tmp_path / "log.parquet").write_bytes(b"PAR1 is how it begins")
    with pytest.raises(BadInput, match="is damaged or cut short"):
        log.column_names(tmp_path / "log.parquet")

    def broken(*_, **__):
        raise OSError(errno.EIO, "raised by the test")

    monkeypatch.setattr(parquet, "ParquetFile", broken)
    with pytest.raises(OSError, match="raised by the test"):
        log.column_names(tmp_path / "log.parquet")


def test_a_table_is_the_same_from_memory_and_from_the_disk(tmp_path, changed):
    found = measure(Flight(departure=(20.0, "alpha_rad")))
    memory = _filled(MemoryLog(), _rows(2), _rows(1, 2))
    memory.copy_to(tmp_path / "log.parquet")
    stored = log.StoredLog(tmp_path / "log.parquet")
    stored.copy_to(tmp_path / "copy.parquet")
    assert (tmp_path / "copy.parquet").read_bytes() == (tmp_path / "log.parquet").read_bytes()
    tables = [log_dataframe(each, found) for each in (memory, stored)]
    assert tables[0].equals(tables[1])
    assert tables[0].attrs == tables[1].attrs
    assert not changed(tables[0].attrs)


def test_folders_are_exchanged_in_one_step_where_a_system_can(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("one", "two"):
        Path(name).mkdir()
        Path(name, name).touch()
    can = hasattr(ctypes.CDLL(None), "renameat2")
    assert writer._swap_folders(Path("one"), Path("two")) is can
    assert Path("one", "two" if can else "one").exists()
    if can:
        with pytest.raises(FileNotFoundError):
            writer._swap_folders(Path("one"), Path("three"))
    monkeypatch.setattr(ctypes, "CDLL", lambda *_, **__: object())
    assert writer._swap_folders(Path("one"), Path("two")) is False


@pytest.mark.parametrize("number", [errno.ENOSYS, errno.EINVAL, errno.EOPNOTSUPP, errno.EACCES])
def test_a_kernel_or_a_file_system_that_cannot_exchange_is_no_error(monkeypatch, number):
    """An old kernel, a file system without it; what else goes wrong is said."""
    asked = []

    def renameat2(*arguments):
        asked.append(arguments)
        ctypes.set_errno(number)
        return -1

    monkeypatch.setattr(ctypes, "CDLL", lambda *_, **__: SimpleNamespace(renameat2=renameat2))
    if number == errno.EACCES:
        with pytest.raises(PermissionError):
            writer._swap_folders(Path("one"), Path("two"))
    else:
        assert writer._swap_folders(Path("one"), Path("two")) is False
    assert [each[1:4:2] for each in asked] == [(b"one", b"two")]


def test_a_folder_is_locked_once(tmp_path, monkeypatch):
    before = _open_files()
    with writer._locked(tmp_path) as first, writer._locked(tmp_path) as second:
        assert (first, second) == (True, False)
    with writer._locked(tmp_path) as again:
        assert again is True
    monkeypatch.setattr(writer, "fcntl", None)
    with writer._locked(tmp_path) as locked:
        assert locked is False
    assert _open_files() == before


@pytest.mark.parametrize(
    ("name", "content", "ours"),
    [
        ("figures/tracking.png", b"x" * 2038 + b"beaver-ftc", True),
        ("figures/tracking.png", b"x" * 2039 + b"beaver-ftc" + b"x" * 2039, False),
        ("figures/tracking.pdf", b"x" * 5000 + b"beaver-ftc", True),
        ("figures/deep/tracking.png", b"beaver-ftc", False),  # a folder is no picture of ours
        ("aircraft/engine/own.xml", b"", True),
        ("aircraft/own.yaml", b"", True),
        ("aircraft/notes.txt", b"", False),
        ("metrics.json", b"", True),
    ],
)
def test_what_is_ours_may_be_replaced_and_nothing_else(tmp_path, name, content, ours):
    path = tmp_path / "case" / name
    path.parent.mkdir(parents=True)
    path.write_bytes(content)
    if ours:
        assert refuse_foreign(tmp_path / "case") is None
        return
    with pytest.raises(SimulationFailed, match=r"will not replace .*case: it holds \w+/"):
        refuse_foreign(tmp_path / "case")


def test_links_are_not_followed(tmp_path):
    (tmp_path / "picture").write_bytes(b"beaver-ftc")
    (tmp_path / "case" / "figures").mkdir(parents=True)
    (tmp_path / "link").symlink_to(tmp_path / "case")
    with pytest.raises(SimulationFailed, match="it exists and is not a folder"):
        refuse_foreign(tmp_path / "link")
    (tmp_path / "dangling").symlink_to(tmp_path / "nowhere")
    with pytest.raises(SimulationFailed, match="it exists and is not a folder"):
        refuse_foreign(tmp_path / "dangling")
    (tmp_path / "case" / "figures" / "a.png").symlink_to(tmp_path / "picture")
    with pytest.raises(SimulationFailed, match=r"it holds figures/a\.png"):
        refuse_foreign(tmp_path / "case")


def test_what_appears_in_its_place_meanwhile_is_not_lost(tmp_path):
    with pytest.raises(SimulationFailed, match="it holds mine"), result_folder(tmp_path, "case"):
        (tmp_path / "case" / "mine").mkdir(parents=True)
    assert [path.name for path in tmp_path.iterdir()] == ["case"]


def test_what_went_wrong_first_is_said_and_every_file_is_brought_to_the_disk(tmp_path, monkeypatch):
    synced, fsync, before = [], os.fsync, _open_files()

    def note(descriptor):
        synced.append(os.path.basename(os.readlink(f"/proc/self/fd/{descriptor}")))
        fsync(descriptor)

    if before:
        monkeypatch.setattr(os, "fsync", note)
    with result_folder(tmp_path, "case") as folder:
        (folder / "metrics.json").touch()
        (folder / "figures").mkdir()
    assert not before or [name.partition("-")[0] for name in synced] == [
        "metrics.json",
        "figures",
        ".case.partial",
    ]
    assert _open_files() == before

    def full(self, target):
        raise OSError(errno.ENOSPC, "raised by the test")

    monkeypatch.setattr(Path, "rename", full)
    with pytest.raises(SimulationFailed, match="no space left on device"), result_folder(tmp_path, "new"):
        pytest.fail("it cannot be begun")


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """A scenario of the user's own aircraft, with more in its folder than a model is made of."""
    folder = tmp_path_factory.mktemp("own")
    shutil.copytree(bf.aircraft("beaver").folder, folder / "my-uav")
    (folder / "my-uav" / "notes.txt").touch()
    (folder / "mine.yaml").write_text("name: mine\naircraft: ./my-uav\nduration_s: 0.2\n")
    return bf.load(folder / "mine.yaml")


def test_an_own_aircraft_is_kept_with_its_flight(own, tmp_path):
    for _ in range(2):  # also where it lies already
        writer.write_documents(tmp_path, own, metrics(Flight()))
    files = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()}
    model = {
        str(path.relative_to(own.airframe.folder.parent))
        for path in own.airframe.folder.rglob("*")
        if path.is_file() and path.suffix in {".xml", ".yaml"}
    }
    assert files == {"scenario.yaml", "metrics.json"} | {f.replace("my-uav", "aircraft", 1) for f in model}
    assert bf.load(tmp_path / "scenario.yaml").aircraft == "./aircraft"
    assert Opened(own, bf.open_run(tmp_path).metrics).passed is True


def test_a_run_writes_what_is_asked_for(tmp_path, monkeypatch):
    flown, drawn = Scenario(name="short", duration_s=0.2), []
    monkeypatch.setattr(writer, "write_report_files", lambda *given, **_: drawn.append(given))
    usual = {"scenario.yaml", "metrics.json", "log.parquet"}
    asked = [
        ({"report": False}, set()), ({"report": False, "exports": ("csv",)}, {"log.csv"}),
        ({"report": False, "exports": ("acmi",)}, {"flight.acmi"}),
        ({"recording": "table"}, {"flight.csv", "vehicle.yaml"}),
    ]  # fmt: skip
    for given, more in asked:
        document = writer.run(flown, tmp_path, **given)
        assert {path.name for path in (tmp_path / "short").iterdir()} == usual | more
    assert document["frames"] == 20
    assert [document for _, document in drawn] == [document]
    written = np.genfromtxt(tmp_path / "short" / "flight.csv", delimiter=",", names=True)
    flap = log.read(tmp_path / "short" / "log.parquet", ["flap_cmd_rad"])["flap_cmd_rad"]
    stops = flown.airframe.travel["flap"]
    assert stops.max_rad > abs(stops.min_rad)
    assert written["flap_command"] == pytest.approx(flap / stops.max_rad)


def test_a_flight_is_saved_with_its_report_unless_told_otherwise(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(writer, "write_report_files", lambda folder, document, **_: drawn.append(folder.name))
    sim = bf.Simulation(Scenario(name="short", duration_s=0.2))
    sim.step(frames=3)
    for saved in (sim, sim.land()):
        assert saved.save(tmp_path) == tmp_path / "short"
        saved.save(tmp_path, report=False)
    assert len(drawn) == 2
    flight = bf.open_run(tmp_path / "short")
    assert (flight.name, flight.fault, flight.departure, len(flight.log)) == ("short", None, None, 4)
    (tmp_path / "short" / "log.parquet").unlink()
    with pytest.raises(BadInput, match="this flight kept no log"):
        _ = bf.open_run(tmp_path / "short").log
    with pytest.raises(BadInput, match=r"3 is no folder, allowed: the result folder of a run"):
        bf.open_run(3)
    with pytest.raises(BadInput, match=r"no metrics\.json can be read there"):
        bf.open_run(str(tmp_path))
