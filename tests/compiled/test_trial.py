"""A version of Numba that is not known is tried in a child, once; a child that crashes is an answer."""

import pytest

from beaver_ftc.compiled import trial


@pytest.fixture
def answers(tmp_path, monkeypatch):
    """Whether kernels pass with this code in the child, and the files of answers by content."""
    monkeypatch.setattr(trial, "cache_base", lambda: tmp_path)

    def after(code=None):
        if code is not None:
            monkeypatch.setattr(trial, "CODE", code)
        passed = trial.passes()
        return passed, [path.read_bytes() for path in tmp_path.glob("trial-*")]

    return after


def test_this_version_passes(answers):
    assert answers() == (True, [trial.PASSED])


@pytest.mark.parametrize("code", ["import ctypes; ctypes.string_at(0)", "raise SystemExit(1)", "print(1)"])
def test_one_that_crashes_or_errs_does_not_and_is_tried_once(answers, code):
    assert answers(code) == (False, [trial.FAILED])
    assert answers("print('passed')") == (False, [trial.FAILED])


def test_an_answer_that_another_user_can_write_does_not_count(answers, tmp_path):
    assert answers("raise SystemExit(1)") == (False, [trial.FAILED])
    (file,) = tmp_path.glob("trial-*")
    file.write_bytes(trial.PASSED)
    file.chmod(0o666)
    assert answers() == (False, [trial.FAILED])
    assert file.stat().st_mode & 0o022 == 0
