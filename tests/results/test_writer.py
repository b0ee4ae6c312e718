import signal
import subprocess
import sys

import pytest

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.results import result_files
from beaver_ftc.results.folder import result_folder

KILLED = """
import os, signal, sys
from pathlib import Path
from beaver_ftc.results.folder import result_folder
with result_folder(Path(sys.argv[1]), "case") as folder:
    (folder / "log.parquet").write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def _result(out, text, name="case"):
    with result_folder(out, name) as folder:
        (folder / "metrics.json").write_text(text)


def _names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_new_result_replaces_the_old_one_entirely(tmp_path):
    _result(tmp_path, "old")
    (tmp_path / "case" / "report.html").touch()
    _result(tmp_path, "new")
    assert _names(tmp_path) == ["case"]
    assert _names(tmp_path / "case") == ["metrics.json"]
    assert (tmp_path / "case" / "metrics.json").read_text() == "new"


def test_old_result_survives_a_killed_run_and_then_a_failed_one(tmp_path):
    _result(tmp_path, "old")
    (tmp_path / "case").rename(tmp_path / ".case.partial-1-replaced")  # by the run that was killed
    with pytest.raises(KeyboardInterrupt), result_folder(tmp_path, "case"):
        raise KeyboardInterrupt
    assert (tmp_path / "case" / "metrics.json").read_text() == "old"


def test_a_system_that_cannot_lock_and_swap_folders_keeps_the_old_result(tmp_path, monkeypatch):
    for name in ("beaver_ftc.results.folder.fcntl", "os.open", "ctypes.CDLL"):
        monkeypatch.setattr(name, None)
    _result(tmp_path, "old")
    with pytest.raises(SimulationFailed, match="as it was"), result_folder(tmp_path, "case") as hidden:
        hidden.rmdir()  # so that it cannot be renamed
    assert (tmp_path / "case" / "metrics.json").read_text() == "old"


def test_killed_run_leaves_nothing_at_the_final_name_and_the_next_one_cleans_up(tmp_path):
    killed = subprocess.run([sys.executable, "-c", KILLED, tmp_path], check=False)
    assert killed.returncode == -signal.SIGKILL
    assert not (tmp_path / "case").exists()
    assert len(_names(tmp_path)) == 1, "expected the hidden leftover of the killed run"
    _result(tmp_path, "new")
    assert _names(tmp_path) == ["case"]


def test_folder_with_something_else_in_it_is_not_touched(tmp_path):
    (tmp_path / "case" / ".git").mkdir(parents=True)
    with pytest.raises(SimulationFailed, match="no result of beaver-ftc"), result_folder(tmp_path, "case"):
        pytest.fail("refuse before flying, not after")
    assert _names(tmp_path) == ["case"]
    assert _names(tmp_path / "case") == [".git"]


def test_a_report_that_cannot_be_drawn_takes_nothing_out_of_a_folder(tmp_path, monkeypatch):
    """What is new in it may be a newer flight's."""

    def draw(folder, document, to):
        (folder / "newer").touch()
        raise OSError("full")

    monkeypatch.setattr(result_files, "write_report_files", draw)
    assert "full" in result_files.add_report(tmp_path, {})
    assert [path.name for path in tmp_path.iterdir()] == ["newer"]
