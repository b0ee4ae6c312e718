"""Compiled code of one size of record is that of all, on whatever copy of a record, and refuses any other."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beaver_ftc import compiled
from beaver_ftc.compiled import direct, kernel, plain, record, sized
from beaver_ftc.compiled.records import shape_of

of_known = pytest.mark.skipif(
    numba.config.DISABLE_JIT or not compiled.borrows(), reason="records have sizes to this compiler"
)

TEST = record(score=float, fired=(int, 2))


@sized
def block_dtype(n, m):
    return record(level=float, state=(2, n), hypothesis=(TEST, m), gain=2)


@sized
def whole_dtype(n, m):
    return record(
        k=int, room=(n, 3), test=TEST, first=block_dtype(n, m), share=float, blocks=(block_dtype(m, n), 2),
        views=(block_dtype(n, 2 * m + 1), m), column=3,
    )  # fmt: skip


@kernel
def add_up(block, factor):
    total = block.level
    for s in range(block.state.shape[1]):
        block.state[1, s] += factor * block.state[0, s]
        total += block.state[1, s]
    for test in block.hypothesis:
        test.score += factor
        test.fired[1] += 1
        total += test.score * test.fired[1]
    block.level = total
    return total


@kernel
def everything(records, totals):
    """Read and write every kind of field there is."""
    whole = records[0]
    whole.k += 1
    whole.share = whole.test.score + whole.column[2]
    totals[0] = add_up(whole.first, 2.0)
    for b, block in enumerate(whole.blocks):
        totals[1 + b] = add_up(block, 3.0 + whole.room[0, 2])
    for view in whole.views[: len(whole.views) - 1]:
        totals[3] += add_up(view, 0.5)
    totals[4] = add_up(whole.views[whole.views.size - 1], 1.0) + add_up(whole.views[-1], 1.0)
    whole.room[:, 1] = whole.column[0]
    totals[5] = whole.room.sum() + records.size


def filled(n, m, seed=0):
    """Records (1,) with numbers in every field."""
    records = np.zeros(1, whole_dtype(n, m))
    numbers = np.random.default_rng(seed).integers(1, 9, records.nbytes // 8)

    def fill(part):
        for name in part.dtype.names or ():
            fill(part[name])
        if part.dtype.names is None:
            part[...] = numbers[: part.size].reshape(part.shape)

    fill(records)
    return records


def as_plain(records):
    """What the plain form makes of them."""
    other, totals = records.copy(), np.zeros(6)
    plain_call = plain(everything)
    plain_call(other.view(np.recarray), totals)
    return other, totals


def check(records):
    expected, totals = as_plain(records)
    found = np.zeros(6)
    everything(records, found)
    assert np.array_equal(records, expected)
    assert found == pytest.approx(totals)


@given(st.integers(1, 5), st.integers(1, 4), st.integers(0, 99))
def test_all_sizes_come_to_what_the_plain_form_does(n, m, seed):
    check(filled(n, m, seed))


@of_known
def test_one_compiled_code_serves_all_sizes():
    for n, m in ((1, 1), (4, 2), (9, 3)):
        check(filled(n, m))
    (kinds,) = everything.overloads
    assert "SizedRecords" in str(kinds[0])
    direct(everything, filled(2, 2), np.zeros(6))(filled(7, 1), np.zeros(6))
    assert len(everything.overloads) == 1


@of_known
def test_code_for_a_record_refuses_another():
    """Called with what it was not compiled for, it raises; it never reads where nothing is."""
    call, totals = direct(everything, filled(2, 2), np.zeros(6)), np.zeros(6)
    record_of_another = np.zeros(1, block_dtype(2, 2))
    names = filled(2, 2).dtype.names
    shuffled = np.zeros(1, np.dtype([(name, "f8") for name in names]))
    for other in (record_of_another, shuffled, np.zeros(1)):
        with pytest.raises(TypeError, match="another shape"):
            call(other, totals)
    call(filled(5, 3), totals)


@of_known
def test_a_record_laid_out_otherwise_is_refused():
    """The same names, further back in memory: it has no places of ours, though it looks like it."""
    dtype = whole_dtype(2, 2)
    fields = {name: dtype.fields[name] for name in dtype.names}
    formats, offsets = [field[0] for field in fields.values()], [field[1] + 64 for field in fields.values()]
    given = {"names": list(fields), "formats": formats, "offsets": offsets, "itemsize": dtype.itemsize + 64}
    others, found = np.zeros(1, np.dtype(given)), np.zeros(6)
    assert shape_of(others.dtype) is None
    with pytest.raises(TypeError, match="another shape"):
        direct(everything, filled(2, 2), found)(others, found)


ASKED = """
import json, sys, tempfile
from pathlib import Path
import yaml
from beaver_ftc.compiled.cache import CodeCache
from beaver_ftc.loop.loop import fly
from beaver_ftc.scenario.schema import load_text
sys.path.insert(0, sys.argv[1])
import seventeen

asked = []
stored = CodeCache.load

def load(store, types, context):
    asked.append(store._name)
    return stored(store, types, context)

CodeCache.load = load
noisy = {name: {"noise_std_deg_s": 0.02} for name in ("p", "q", "r")}
late = {name: {"delay_s": 1.0} for name in ("p", "q", "r", "alpha")}
KINDS = [
    {}, {"fdi": {"fault_class": "all"}}, {"sensors": noisy}, {"sensors": late},
    {"sensors": noisy, "fdi": {"fault_class": "all", "statistical": {}, "bounds": {"sensors": noisy}}},
]

def first_asked(folder, *aircraft):
    asked.clear()
    for kind in KINDS:
        given = {"name": "x", "duration_s": 0.5, "initial": {"airspeed_mps": 50, "altitude_m": 1500}}
        given |= kind | {"aircraft": name for name in aircraft}
        fly(load_text(yaml.safe_dump(given), folder=folder))
    return sorted(asked)

with tempfile.TemporaryDirectory() as made:
    folder = Path(made)
    name = seventeen.write(folder)
    first = first_asked(folder, name)
    trainer = first_asked(Path(sys.argv[1]) / "data" / "aircraft", "./trainer")
    print(json.dumps([first, trainer, first_asked(folder)]))
"""


@of_known
def test_a_second_aircraft_compiles_nothing():
    """Three and four surfaces after seventeen: no code is asked for that those flights have not had, but for
    the entry of flights that nothing of Python interrupts."""
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-c", ASKED, str(root / "tests")],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([*sys.path, str(root)])},
        capture_output=True,
        text=True,
        check=True,
    )
    seventeen, trainer, beaver = json.loads(done.stdout.splitlines()[-1])
    assert "beaver_ftc.loop.stepping.fly_one" in seventeen
    assert trainer == []
    assert beaver == ["beaver_ftc.loop.stepping.fly_on"]
