import errno
import os
import shutil
from contextlib import nullcontext
from dataclasses import replace

import pyarrow.parquet as pq
import pytest

import beaver_ftc as bf
from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.studies.sweep.one_flight import row_of_failure, schema_of, table_of
from beaver_ftc.studies.sweep.sampling import Assignment
from beaver_ftc.studies.sweep.store import Store, identity_of

from .conftest import sweep_of


@pytest.fixture
def store(short, tmp_path):
    return Store(tmp_path / "short", short)


def batch_of(sweep, runs):
    return [
        row_of_failure(sweep, Assignment(run, dict.fromkeys(sweep.keys, 1)), "failed", "for the test")
        for run in reversed(runs)
    ]


def tabulated(sweep, runs):
    return table_of(sweep, schema_of(sweep), batch_of(sweep, runs))


@pytest.mark.parametrize("damage", ["truncate", "garbage", "other runs", "other columns"])
def test_a_damaged_part_is_set_aside_and_missing(store, short, damage):
    with store:
        store.begin(identity_of(short), resume=False)
        store.parts.land(0, batch_of(short, range(3)))
        part = store.folder / "parts" / "000000.parquet"
        content = part.read_bytes()
        if damage == "truncate":
            part.write_bytes(content[: len(content) // 2])
        elif damage == "garbage":
            part.write_bytes(os.urandom(1000))
        elif damage == "other runs":
            store.parts.land(0, batch_of(short, range(1, 4)))
        else:
            pq.write_table(tabulated(short, range(3)).drop_columns(["status"]), part)
        damaged = part.read_bytes()
        assert store.landed(0, range(3)) is None
        assert not part.exists()
        assert part.with_name("000000.parquet.damaged").read_bytes() == damaged


@pytest.mark.parametrize("text", ["null", "[]", "5", "{", "{}", '{"sweep": 1, "versions": {}}', "\xff", None])
def test_a_damaged_identity_loses_nothing(store, short, text, capsys):
    """Without --resume it is refused, with it all that is there is renamed, and the sweep begins anew."""
    with store:
        store.begin(identity_of(short), resume=False)
        store.parts.land(0, batch_of(short, range(3)))
    manifest, part = store.folder / "sweep.json", store.folder / "parts" / "000000.parquet"
    (store.folder / "flights").mkdir()
    flown = part.read_bytes()
    manifest.unlink() if text is None else manifest.write_bytes(text.encode("latin-1"))
    with store:
        with pytest.raises(BadInput, match=r"sweep.json: is .*, allowed: --resume, which sets aside"):
            store.begin(identity_of(short), resume=False)
        assert part.read_bytes() == flown
        store.begin(identity_of(short), resume=True)
        assert (store.folder / "parts.damaged" / "000000.parquet").read_bytes() == flown
        assert store.landed(0, range(3)) is None
        assert not [path for path in store.folder.iterdir() if "lock" in path.name and "damaged" in path.name]
    assert "set aside as parts.damaged; what was in it is flown again" in capsys.readouterr().err
    with store:  # and may be resumed
        store.begin(identity_of(short), resume=True)


def test_a_strangers_folder_is_left_alone(store):
    store.folder.mkdir(parents=True)
    (store.folder / "thesis.tex").write_text("years of work")
    with pytest.raises(SimulationFailed, match=r"thesis\.tex"), store:
        pass
    assert (store.folder / "thesis.tex").exists()


@pytest.mark.parametrize("when", [os.fsync, os.replace])
def test_a_full_disk_is_said_and_leaves_what_was_there(store, short, monkeypatch, when):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device")

    with store:
        store.begin(identity_of(short), resume=False)
        store.parts.land(0, batch_of(short, range(3)))
        monkeypatch.setattr("os." + when.__name__, full)
        with pytest.raises(SimulationFailed, match=r"no space left on device; .*--resume"):
            store.parts.land(1, batch_of(short, range(3, 6)))
        monkeypatch.undo()
        assert store.landed(0, range(3)) is not None
        assert sorted(path.name for path in store.parts.folder.iterdir()) == ["000000.parquet"]


def test_an_unfinished_sweep_is_not_thrown_away(store, short):
    with store:
        store.begin(identity_of(short), resume=False)
        store.parts.land(0, batch_of(short, range(3)))
        with pytest.raises(BadInput, match="--resume to go on"):
            store.begin(identity_of(short), resume=False)
        store.begin(identity_of(short), resume=True)
        assert store.landed(0, range(3)) is not None
        store.write("summary.json", "{}")  # finished: it may be replaced
        store.begin(identity_of(short), resume=False)
        store.compact([tabulated(short, range(1, 4))])  # of other runs
        assert store.landed(0, range(3)) is None


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [("seed: 3", "seed: 4", "seed"), ("0.05", "0.06", "vary"), ("runs: 48", "runs: 49", "runs"),
     ("at_s\": 0.5", "at_s\": 0.6", "base")],
)  # fmt: skip
def test_another_sweep_is_not_resumed(store, short, old, new, named):
    with store:
        store.begin(identity_of(short), resume=False)
        with pytest.raises(BadInput, match=rf"has changed since these flights \({named}\)") as caught:
            store.begin(identity_of(sweep_of(**{old: new})), resume=True)
    assert caught.value.exit_code == 2


def test_a_description_is_no_part_of_the_identity(short):
    described = sweep_of(**{"expect: {}": "expect: {}, description: why", "seed": "description: why\nseed"})
    assert identity_of(described) == identity_of(short)


def test_other_versions_are_not_mixed(store, short):
    then = identity_of(short)
    then["versions"]["jsbsim"] = "0.9"
    with store:
        store.begin(then, resume=False)
        with pytest.raises(BadInput, match=r"jsbsim 0\.9 then, .* now"):
            store.begin(identity_of(short), resume=True)


def test_a_users_files_in_the_sweeps_folders_stay(store, short):
    with store:
        store.begin(identity_of(short), resume=False)
        store.write("summary.json", "{}")
        figures, flight = store.folder / "figures", store.folder / "flights" / "short-0001"
        figures.mkdir()
        flight.mkdir(parents=True)
        (figures / "mine.png").write_text("drawn by hand")
        (figures / "sensitivity.png").write_text("drawn by us")
        store.begin(identity_of(short), resume=False)
        assert [path.name for path in figures.iterdir()] == ["mine.png"]
        flight.mkdir(parents=True)
        (flight / "notes.txt").write_text("years of work")
        store.write("summary.json", "{}")
        with pytest.raises(SimulationFailed, match=r"notes\.txt"):
            store.begin(identity_of(short), resume=False)
        assert (flight / "notes.txt").exists()


@pytest.mark.parametrize(
    ("file", "is_other"), [("aircraft.yaml", True), ("beaver.xml", True), ("notes.md", False)]
)
def test_an_aircraft_whose_files_have_changed_is_another(store, short, tmp_path, file, is_other):
    """Of one folder and one name: what flies it is told from what is written beside it."""
    folder = shutil.copytree(bf.aircraft("beaver").folder, tmp_path / "own")
    path = folder / file
    (folder / "folder.xml").mkdir()
    own = replace(short, aircraft=bf.aircraft("./own", tmp_path))
    with store:
        store.begin(identity_of(own), resume=False)
        path.write_text((path.read_text() if path.exists() else "") + "\n")
        refused = pytest.raises(BadInput, match=r"has changed since these flights \(aircraft\)")
        with refused if is_other else nullcontext():
            store.begin(identity_of(own), resume=True)
