"""Code that may crash is tried in a child, once; a child that crashes is an answer."""

import os
import subprocess

import pytest

from beaver_ftc.documents import trials


@pytest.fixture
def passes(tmp_path, monkeypatch):
    """Whether a child with this code ends well, and how many children there were."""
    monkeypatch.setattr(trials, "cache_base", lambda: tmp_path)
    children, run = [], subprocess.run

    def counted(command, **given):
        children.append(command)
        return run(command, **given)

    monkeypatch.setattr(trials.subprocess, "run", counted)

    def answer(code, build="1", **environment):
        return trials.passes("x", build, code, environment), len(children)

    return answer


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("pass", True),
        ("import ctypes; ctypes.string_at(0)", False),
        ("raise SystemExit(3)", False),
        ("import os; os.abort()", False),
    ],
)
def test_it_is_asked_once_a_build(passes, code, expected):
    assert passes(code) == passes(code) == (expected, 1)
    assert passes(code, build="2") == (expected, 2)


@pytest.mark.skipif(os.name != "posix", reason="files have no mode here")
def test_an_answer_that_another_user_can_write_does_not_count(passes, tmp_path):
    assert passes("raise SystemExit(3)") == (False, 1)
    (file,) = tmp_path.glob("trial-*")
    file.write_bytes(trials.PASSED)
    file.chmod(0o666)
    assert passes("raise SystemExit(3)") == (False, 2)
    assert file.stat().st_mode & 0o022 == 0
