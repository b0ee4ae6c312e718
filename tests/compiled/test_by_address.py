"""A kernel that stands apart is compiled when it is first called, is right then, and is kept."""

import importlib
import subprocess
import sys

import pytest

from beaver_ftc import compiled

MODULE = """
from pathlib import Path
import numpy as np
from beaver_ftc import compiled

RECORD = np.dtype([("wanted", "i8"), ("limit", "f8"), ("value", "f8", (3,))])
compiled.cache_folder = lambda: Path(__file__).parent / "cache"

@compiled.apart
def rare(record, by):
    \"\"\"Take `by` off each value, down to a limit.\"\"\"
    if by < 0.0:
        raise ValueError("cannot take off less than nothing")
    for i in range(record.value.size):
        record.value[i] = max(record.value[i] - by, record.limit)

@compiled.apart
def answering(record, by):
    return by

@compiled.kernel
def often(records, by):
    record = records[0]
    record.value[0] += 1.0
    if record.wanted == 1:
        rare(record, by)
    if record.wanted == 2:
        answering(record, by)
    return record.value.sum()

def records(wanted):
    made = np.zeros(1, RECORD)
    made["wanted"], made["value"] = wanted, (1.0, 2.0, 3.0)
    return made
"""


@pytest.fixture
def made(tmp_path, monkeypatch):
    name = f"apart_{tmp_path.name.replace('-', '_')}"
    (tmp_path / f"{name}.py").write_text(MODULE)
    monkeypatch.setattr(compiled, "cache_folder", compiled.cache_folder)
    monkeypatch.syspath_prepend(tmp_path)
    return importlib.import_module(name)


def kept(tmp_path):
    return sorted(path.name.partition("-")[0] for path in (tmp_path / "cache").glob("*-*"))


def test_it_is_compiled_only_when_it_is_called(made, tmp_path):
    assert made.often(made.records(0), 1.5) == 7.0
    assert kept(tmp_path) == ["often"]
    assert made.often(made.records(1), 1.5) == 0.5 + 0.5 + 1.5
    assert kept(tmp_path) == ["often", "rare"]


def test_another_process_compiles_nothing(made, tmp_path):
    made.often(made.records(1), 1.5)
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "cache").iterdir()}
    program = f"import {made.__name__} as made; print(made.often(made.records(1), 1.5))"
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout == "2.5\n"
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "cache").iterdir()} == before


def test_what_it_raises_reaches_the_caller(made):
    with pytest.raises(ValueError, match="less than nothing"):
        made.often(made.records(1), -1.0)
