"""`--help`: it answers for every command, and the commands it shows as examples do what they say."""

import re

import pytest

from beaver_ftc.commands import registered

from .documents import commands_of_help, examples_of_help, shown
from .exceptions import instead, tried
from .materials import lay_out

TEXTS = {}
TRIED = set(map(tried, shown()))  # on the pages, by test_documents.py


@pytest.fixture
def helps(beaver):
    """{command: its help text}, and that of the program under the empty name; asked for once a process."""
    if not TEXTS:
        top = beaver("--help")
        assert top.returncode == 0
        TEXTS[""] = top.stdout
        TEXTS.update({name: beaver(name, "--help").stdout for name in commands_of_help(top.stdout)})
    return TEXTS


def test_every_command_explains_itself(helps):
    assert len(helps) > 14
    for name, text in helps.items():
        assert text.startswith(f"Usage: beaver-ftc {name}".rstrip()), name
        assert "Show this message and exit." in text, name
        assert re.search(r"\n\n  [A-Z].+?\.\n", text, re.DOTALL), name


def test_the_program_has_one_screen_and_no_argument_is_bracketed_twice(helps):
    assert helps[""].count("\n") <= 31
    assert {name.split()[0] for name in registered()} == {*helps} - {""}
    for text in helps.values():
        usage = text.partition("\n\n")[0]
        assert not re.search(r"\[\[|\.\.\.[\]})]+\.\.\.|\[[a-z]", usage), usage


def test_the_program_says_its_exit_statuses(helps):
    said = " ".join(helps[""].split())
    for status in ("0 = done", "1 = an expectation or", "2 = bad input or usage", "3 = the simulation"):
        assert status in said


def test_examples_of_help_that_no_page_shows_run(helps, installation, tmp_path):
    for name, text in helps.items():
        for number, example in enumerate(examples_of_help(text)):
            line = instead(example)
            if line in TRIED:
                continue
            folder = tmp_path / f"{name}-{number}"
            folder.mkdir()
            if " new " not in line:  # which makes the file itself
                lay_out(line, folder, installation)
            done = installation.run("bash", "-c", line, cwd=folder)
            assert done.returncode in (0, 1), f"{line}\n{done.stderr}"


def test_no_command_at_all_shows_the_help(beaver, helps):
    done = beaver()
    assert done.returncode == 2
    assert "Usage: beaver-ftc" in done.stdout + done.stderr


def test_version(started, tmp_path):
    done = started.beaver("--version", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert re.fullmatch(r"beaver-ftc \d+\.\d+\.\d+\n", done.stdout)
