"""The command line around its commands: signals, streams, exit status, helps and plug-ins."""

import errno
import gc
import signal
import sys
import time

import pytest

import needs
from beaver_ftc.cli import failure_of
from beaver_ftc.cli import main as command_line
from beaver_ftc.commands import files_of_commands
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.results.folder import FILES_OF_A_RUN


@pytest.fixture
def as_started():
    """Signals as a shell leaves them, and as they were afterwards."""
    numbers = (signal.SIGTERM, signal.SIGHUP)
    before = {number: signal.signal(number, signal.SIG_DFL) for number in numbers}
    hook, sys.unraisablehook = sys.unraisablehook, sys.__unraisablehook__
    yield
    sys.unraisablehook = hook
    for number, handler in before.items():
        signal.signal(number, handler)


def ended(monkeypatch, command):
    monkeypatch.setattr(command_line, "app", command)
    with pytest.raises(SystemExit) as status:
        command_line.main()
    return status.value.code


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_unwinds_with_its_status(monkeypatch, as_started, number):
    assert ended(monkeypatch, lambda: signal.raise_signal(number)) == 128 + number


class HalfMade:
    def __init__(self):
        signal.raise_signal(signal.SIGTERM)
        self.pointer = 1

    def __del__(self):
        assert self.pointer


def test_an_object_that_a_signal_leaves_half_made_is_not_heard_of(monkeypatch, as_started, capsys):
    assert ended(monkeypatch, HalfMade) == 128 + signal.SIGTERM
    gc.collect()
    assert capsys.readouterr().err == ""


class Deleted:
    def __del__(self):
        signal.raise_signal(signal.SIGTERM)


def test_a_signal_where_python_ignores_exceptions_ends_the_command_too(monkeypatch, as_started, capsys):
    def waits_after_it():
        Deleted()
        time.sleep(10.0)

    assert ended(monkeypatch, waits_after_it) == 128 + signal.SIGTERM
    assert capsys.readouterr().err == ""


def test_what_is_ignored_stays_ignored(monkeypatch, as_started):
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    assert ended(monkeypatch, lambda: signal.raise_signal(signal.SIGHUP)) == 0


@pytest.mark.parametrize("number", [errno.ENAMETOOLONG, errno.ELOOP])
def test_a_path_that_no_file_can_have_is_bad_input(number):
    found = failure_of(OSError(number, "Of No Use", "a/path"))
    assert (type(found), str(found)) == (BadInput, "a/path: of no use, allowed: the path of a file")
    assert failure_of(OSError(number, "Of No Use")).exit_code == 3  # whose path is not known
    assert failure_of(OSError(errno.EIO, "broken", "a/path")).exit_code == 3


@pytest.mark.parametrize(("error", "status"), [(BadInput("no"), 2), (ValueError("no"), 3)])
def test_an_error_ends_with_the_status_of_its_kind(monkeypatch, as_started, capsys, error, status):
    def command():
        raise error

    assert ended(monkeypatch, command) == status
    assert "no" in capsys.readouterr().err


@needs.command("check")
def test_what_a_result_folder_may_hold(changed):
    """All names that commands declare: a folder that holds another is not replaced."""
    assert not changed(sorted({*files_of_commands()} | FILES_OF_A_RUN))
