"""The command line around its commands: signals, streams, exit status, helps and plug-ins."""

import errno
import io
import signal
import sys
from dataclasses import dataclass
from inspect import signature
from types import SimpleNamespace
from typing import Annotated, get_args

import pytest
import typer
from typer.testing import CliRunner

import needs
from beaver_ftc import __version__, commands, plugins
from beaver_ftc.cli import as_typer_reads, complete_names, failure_of
from beaver_ftc.cli import main as command_line
from beaver_ftc.commands import files_of_commands
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.results.writer import FILES_OF_A_RUN


@pytest.fixture
def as_started():
    """Signals as a shell leaves them, and as they were afterwards."""
    numbers = (signal.SIGTERM, signal.SIGHUP)
    before = {number: signal.signal(number, signal.SIG_DFL) for number in numbers}
    yield
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


def test_a_signal_in_the_code_of_a_plug_in_is_not_blamed_on_it(monkeypatch, as_started):
    """Its constructor runs when the signal arrives: 143, not "cannot be made" with 2."""
    monkeypatch.setattr(plugins, "plugin_class", lambda *_: lambda: signal.raise_signal(signal.SIGTERM))
    assert ended(monkeypatch, lambda: plugins.made("beaver_ftc.laws", "mine")) == 128 + signal.SIGTERM


def test_what_is_ignored_stays_ignored(monkeypatch, as_started):
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    assert ended(monkeypatch, lambda: signal.raise_signal(signal.SIGHUP)) == 0


def test_letters_that_a_terminal_lacks_are_replaced(monkeypatch, as_started):
    said = []
    streams = [SimpleNamespace(reconfigure=lambda **how: said.append(how)), io.StringIO()]
    monkeypatch.setattr(sys, "stdout", streams[0])
    monkeypatch.setattr(sys, "stderr", streams[1])
    assert ended(monkeypatch, lambda: None) == 0
    assert said == [{"errors": "replace"}]


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


def test_the_version_is_asked_before_all_else():
    for asked, status, shown in (
        (["--version"], 0, f"beaver-ftc {__version__}\n"),
        (["run", "--version"], 2, ""),
    ):
        done = CliRunner().invoke(command_line.app, asked)
        assert (done.exit_code, done.stdout) == (status, shown)


def test_which_commands_fly(changed):
    """Whether plug-ins can be registered for it, and its examples; of each package by itself."""
    found = {}
    for name, command in command_line.every_command().items():
        flies, examples = "plugin" in [each.name for each in command.params], command.epilog or ""
        package = commands.registered()[name].partition(".")[0]
        found.setdefault(package, {})[name] = [flies, *examples.splitlines()[2:]]
    whole = typer.main.get_command(command_line.app)
    below = {name: each.commands for name, each in whole.commands.items() if name in commands.groups()}
    assert {*whole.commands} == {name.partition(" ")[0] for name in commands.registered()}
    assert {f"{group} {name}" for group, names in below.items() for name in names} == {
        name for name in commands.registered() if " " in name
    }
    for package, commands_of_it in found.items():
        assert not changed(commands_of_it, part=package)


@needs.command("check")
def test_what_a_result_folder_may_hold(changed):
    """All names that commands declare: a folder that holds another is not replaced."""
    assert not changed(sorted({*files_of_commands()} | FILES_OF_A_RUN))


@dataclass(frozen=True)
class Wanted:
    """What is asked."""

    name: str
    size_m: Annotated[float, typer.Option(min=1, help="kept")] = 2.0
    is_new: bool = False


def command(wanted: Wanted) -> None:
    """Do it.

    With care.

    name: What it
        is called.
    is_new: Not yet: there.
    """
    raise BadInput(f"{wanted}")


def test_a_command_as_typer_reads_it(monkeypatch):
    read = as_typer_reads(command, flies=True)
    assert read.__doc__ == "Do it.\n\nWith care."
    parameters = signature(read).parameters
    assert list(parameters) == ["name", "size_m", "is_new", "plugin"]
    options = {name: get_args(each.annotation)[1] for name, each in parameters.items()}
    assert [options[name].help for name in ("name", "size_m", "is_new")] == [
        "What it is called.",
        "kept",
        "Not yet: there.",
    ]
    registered = []
    monkeypatch.setattr(plugins, "register", registered.append)
    with pytest.raises(BadInput) as caught:
        read(plugin=["a:B", "c:D"], name="n", size_m=3.0)
    assert str(caught.value) == str(Wanted("n", 3.0))
    assert registered == ["a:B", "c:D"]
    app = typer.Typer()
    app.command()(read)
    for asked, wanted in (
        (["--name", "n", "--is-new"], Wanted("n", 2.0, True)),
        (["--name", "n"], Wanted("n")),
    ):
        assert str(CliRunner().invoke(app, asked).exception) == str(wanted)
    for wrong in (["--name", "n", "--no-is-new"], [], ["--name", "n", "--size-m", "0.5"]):
        assert CliRunner().invoke(app, wrong).exit_code == 2
    assert "plugin" not in signature(as_typer_reads(command, flies=False)).parameters


def test_names_that_a_shell_completes():
    assert complete_names("rudder-st") == ["rudder-stuck"]
    assert len(complete_names("elevator-")) > 3
    assert complete_names("x") == []
