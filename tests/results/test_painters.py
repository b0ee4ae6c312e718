"""Figures drawn by other processes are those drawn by this one, whatever happens to the others."""

import os
import signal
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from beaver_ftc.results import painters as module
from beaver_ftc.results.painters import drawing, painters
from beaver_ftc.results.pictures import pictures_of, save

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="processes are forked on Linux")


@pytest.fixture
def pictures(log_path, found, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_can_fork", lambda: True)  # whatever threads other tests have left
    (tmp_path / "beside").mkdir()
    return pictures_of(log_path, found, tmp_path / "beside")[-3:]


@pytest.fixture(scope="module")
def drawn_here():
    """By name the bytes of each of these pictures, drawn here once: their flight is always the same."""
    kept = {}

    def drawn(pictures, folder):
        if not kept:
            for picture in pictures:
                save(replace(picture, path=folder / picture.path.name))
            kept.update(bytes_of(folder))
        return kept

    return drawn


def bytes_of(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("killed", [[], [0, 1]])
def test_figures_are_the_same_whoever_draws_them(killed, pictures, drawn_here, tmp_path):
    others = children()  # of tests before this one
    with painters() as at_work:
        (first,) = [child for child in children() if child not in others]
        assert len(at_work) == 2
        for painter in at_work:
            painter.send("no picture")  # it answers what went wrong, and goes on
            assert isinstance(painter.recv(), Exception)
        (second,) = children(first)
        with drawing(pictures, at_work):
            for number in killed:
                os.kill((first, second)[number], signal.SIGKILL)
    assert children() == others
    for _ in range(500):  # its parent has ended before it: nobody waits for it
        if not is_running(second):
            break
        time.sleep(0.01)
    assert not is_running(second)
    (tmp_path / "here").mkdir()
    assert bytes_of(tmp_path / "beside") == drawn_here(pictures, tmp_path / "here")


def children(process=None):
    with open(f"/proc/{process or os.getpid()}/task/{process or os.getpid()}/children") as file:
        return [int(word) for word in file.read().split()]


def is_running(process):
    try:
        return " Z " not in Path(f"/proc/{process}/stat").read_text()
    except OSError:
        return False


def test_a_failure_is_raised_here_once_all_have_ended(pictures, tmp_path):
    nowhere = replace(pictures[0], path=tmp_path / "nowhere" / "x.png")
    with (
        painters() as at_work,
        pytest.raises(OSError, match="nowhere"),
        drawing([*pictures, nowhere], at_work),
    ):
        pass
