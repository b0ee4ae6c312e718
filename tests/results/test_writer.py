import errno
import os
import signal
import subprocess
import sys

import pytest

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.results import writer
from beaver_ftc.results.writer import result_folder

KILLED = """
import os, signal, sys
from pathlib import Path
from beaver_ftc.results.writer import result_folder
with result_folder(Path(sys.argv[1]), "case") as folder:
    (folder / "log.parquet").write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def _result(out, text, name="case"):
    with result_folder(out, name) as folder:
        (folder / "metrics.json").write_text(text)


def _names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_result_appears_only_when_it_is_whole(tmp_path):
    out = tmp_path / "deep" / "runs"
    with result_folder(out, "case") as folder:
        (folder / "metrics.json").write_text("new")
        assert not (out / "case").exists()
    assert (out / "case" / "metrics.json").read_text() == "new"
    assert _names(out) == ["case"]


@pytest.mark.parametrize("can_exchange", [True, False])
def test_new_result_replaces_the_old_one_entirely(tmp_path, monkeypatch, can_exchange):
    if not can_exchange:
        monkeypatch.setattr(writer, "_swap_folders", lambda one, other: False)
    with result_folder(tmp_path, "case") as folder:
        (folder / "metrics.json").write_text("old")
        (folder / "report.html").write_text("old")
    _result(tmp_path, "new")
    assert _names(tmp_path) == ["case"]
    assert _names(tmp_path / "case") == ["metrics.json"]
    assert (tmp_path / "case" / "metrics.json").read_text() == "new"


@pytest.mark.parametrize("can_exchange", [True, False])
def test_a_run_of_the_same_name_may_end_just_before(tmp_path, monkeypatch, can_exchange):
    """The other one's result comes into place when this one is about to be renamed."""
    final, rename, ended = tmp_path / "case", writer.Path.rename, []

    def late(path, target):
        if target == final and not ended:
            ended.append(final.mkdir())
            (final / "metrics.json").write_text("of the other")
        return rename(path, target)

    if not can_exchange:
        monkeypatch.setattr(writer, "_swap_folders", lambda one, other: False)
    monkeypatch.setattr(writer.Path, "rename", late)
    with result_folder(tmp_path, "case") as folder:
        (folder / "metrics.json").write_text("of this one")
    assert (final / "metrics.json").read_text() == "of this one"
    assert _names(tmp_path) == ["case"]


def test_old_result_survives_a_failed_run(tmp_path):
    _result(tmp_path, "old")
    with pytest.raises(KeyboardInterrupt), result_folder(tmp_path, "case"):
        raise KeyboardInterrupt
    assert (tmp_path / "case" / "metrics.json").read_text() == "old"


def test_killed_run_leaves_nothing_at_the_final_name_and_the_next_one_cleans_up(tmp_path):
    killed = subprocess.run([sys.executable, "-c", KILLED, tmp_path], check=False)
    assert killed.returncode == -signal.SIGKILL
    assert not (tmp_path / "case").exists()
    assert len(_names(tmp_path)) == 1, "expected the hidden leftover of the killed run"
    _result(tmp_path, "new")
    assert _names(tmp_path) == ["case"]


@pytest.mark.parametrize("stranger", ["thesis.tex", ".git"])
def test_folder_with_something_else_in_it_is_not_touched(tmp_path, stranger):
    (tmp_path / "case" / stranger).mkdir(parents=True)
    with pytest.raises(SimulationFailed, match="no result of beaver-ftc"), result_folder(tmp_path, "case"):
        pytest.fail("refuse before flying, not after")
    assert _names(tmp_path) == ["case"]
    assert _names(tmp_path / "case") == [stranger]


def test_full_disk_is_a_clear_error_and_leaves_nothing(tmp_path, monkeypatch):
    def full(descriptor):
        raise OSError(errno.ENOSPC, "raised by the test")

    _result(tmp_path / "older", "x")
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(SimulationFailed, match=r"no space left on device; nothing is left there$"):
        _result(tmp_path, "x")
    with pytest.raises(SimulationFailed, match=r"device; the result that was there is as it was$"):
        _result(tmp_path / "older", "y")
    assert _names(tmp_path) == ["older"]
    assert (tmp_path / "older" / "case" / "metrics.json").read_text() == "x"
