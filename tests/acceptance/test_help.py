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


def test_the_program_has_one_screen_and_no_argument_is_bracketed_twice(helps):
    assert helps[""].count("\n") <= 31
    assert {name.split()[0] for name in registered()} == {*helps} - {""}
    for text in helps.values():
        usage = text.partition("\n\n")[0]
        assert not re.search(r"\[\[|\.\.\.[\]})]+\.\.\.|\[[a-z]", usage), usage


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
