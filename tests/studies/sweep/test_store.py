import errno
import os

import pyarrow.parquet as pq
import pytest

from beaver_ftc.errors import BadInput, SimulationFailed
from beaver_ftc.studies.sweep.identity import Identity
from beaver_ftc.studies.sweep.store import Store
from beaver_ftc.studies.sweep.table import row_of_failure, schema_of, table_of

from .conftest import parts_in, sweep_of


@pytest.fixture
def store(short, tmp_path):
    return Store(tmp_path / "short", schema_of(short))


def batch_of(sweep, runs):
    rows = [
        row_of_failure(run, dict.fromkeys(sweep.keys, 1), 0, "failed", "for the test")
        for run in reversed(runs)
    ]
    return table_of(sweep, schema_of(sweep), rows)


def test_what_has_landed_is_there(store, short):
    with store:
        store.begin(Identity.of(short), resume=False)
        store.land(0, batch_of(short, range(3)))
        assert store.landed(0, range(3)).column("run").to_pylist() == [0, 1, 2]
        assert store.landed(1, range(3, 6)) is None


@pytest.mark.parametrize("damage", ["truncate", "garbage", "other runs", "other columns"])
def test_a_damaged_part_is_removed_and_missing(store, short, damage):
    with store:
        store.begin(Identity.of(short), resume=False)
        store.land(0, batch_of(short, range(3)))
        part = store.folder / "parts" / "000000.parquet"
        content = part.read_bytes()
        if damage == "truncate":
            part.write_bytes(content[: len(content) // 2])
        elif damage == "garbage":
            part.write_bytes(os.urandom(1000))
        elif damage == "other runs":
            store.land(0, batch_of(short, range(1, 4)))
        else:
            pq.write_table(batch_of(short, range(3)).drop_columns(["status"]), part)
        assert store.landed(0, range(3)) is None
        assert not part.exists()


def test_compacting_joins_the_parts_in_order_and_removes_them(store, short):
    with store:
        store.begin(Identity.of(short), resume=False)
        tables = [batch_of(short, range(first, first + 3)) for first in (0, 3, 6)]
        for number in (2, 0, 1):
            store.land(number, tables[number])
        store.compact(iter(tables))
    table = pq.read_table(store.results)
    assert table.column_names[0] == "run"
    assert table.column("run").to_pylist() == list(range(9))
    assert parts_in(store.folder) == 0
    assert store.is_compacted(9)
    assert not store.is_compacted(10)


def test_a_second_process_is_kept_out(store, short):
    other = Store(store.folder, schema_of(short))
    with store, pytest.raises(SimulationFailed, match="another beaver-ftc is flying"), other:
        pass
    with other:
        pass


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
        store.begin(Identity.of(short), resume=False)
        store.land(0, batch_of(short, range(3)))
        monkeypatch.setattr("os." + when.__name__, full)
        with pytest.raises(SimulationFailed, match=r"no space left on device; .*--resume"):
            store.land(1, batch_of(short, range(3, 6)))
        monkeypatch.undo()
        assert store.landed(0, range(3)) is not None
        assert sorted(path.name for path in store.parts.iterdir()) == ["000000.parquet"]


def test_an_unfinished_sweep_is_not_thrown_away(store, short):
    with store:
        store.begin(Identity.of(short), resume=False)
        store.land(0, batch_of(short, range(3)))
        with pytest.raises(BadInput, match="--resume to go on"):
            store.begin(Identity.of(short), resume=False)
        store.begin(Identity.of(short), resume=True)
        assert store.landed(0, range(3)) is not None
        store.write("summary.json", "{}")  # finished: it may be replaced
        store.begin(Identity.of(short), resume=False)
        assert store.landed(0, range(3)) is None


def test_leftovers_of_a_crash_are_swept_away(store, short):
    with store:
        store.begin(Identity.of(short), resume=False)
        (store.parts / ".000004.parquet.partial").write_bytes(b"half")
        store.begin(Identity.of(short), resume=True)
        assert list(store.parts.iterdir()) == []


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [("seed: 3", "seed: 4", "seed"), ("0.05", "0.06", "vary"), ("runs: 48", "runs: 49", "runs"),
     ("at_s\": 0.5", "at_s\": 0.6", "base")],
)  # fmt: skip
def test_another_sweep_is_not_resumed(store, short, old, new, named):
    with store:
        store.begin(Identity.of(short), resume=False)
        with pytest.raises(BadInput, match=rf"has changed since these flights \({named}\)") as caught:
            store.begin(Identity.of(sweep_of(**{old: new})), resume=True)
    assert caught.value.exit_code == 2


def test_words_and_expectations_may_change(store, short):
    with store:
        store.begin(Identity.of(short), resume=False)
        changed = sweep_of(**{"seed: 3": "seed: 3\nexpect: {failure_rate: {at_most: 0}}\ndescription: more"})
        store.begin(Identity.of(changed), resume=True)


def test_other_versions_are_not_mixed(store, short):
    then = Identity.of(short)
    then.document["versions"]["jsbsim"] = "0.9"
    with store:
        store.begin(then, resume=False)
        with pytest.raises(BadInput, match=r"jsbsim 0\.9 then, .* now"):
            store.begin(Identity.of(short), resume=True)
