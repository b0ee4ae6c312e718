"""`--help`: it answers for every command, and the commands it shows as examples do what they say."""

import re

import pytest

from beaver_ftc.commands import registered

from .documents import commands_of_help, examples_of_help, shown
from .exceptions import instead, tried
from .materials import lay_out

COMMANDS = sorted({name.split()[0] for name in registered()})
TRIED = set(map(tried, shown()))  # on the pages, by test_documents.py


def test_the_program_has_one_screen_with_all_commands(beaver):
    top = beaver("--help")
    assert top.returncode == 0
    assert top.stdout.count("\n") <= 31
    assert sorted(commands_of_help(top.stdout)) == COMMANDS


@pytest.mark.parametrize("name", ["", *COMMANDS])
def test_no_argument_is_bracketed_twice_and_examples_that_no_page_shows_run(
    name, beaver, installation, tmp_path
):
    text = beaver(*filter(None, [name]), "--help").stdout
    usage = text.partition("\n\n")[0]
    assert not re.search(r"\[\[|\.\.\.[\]})]+\.\.\.|\[[a-z]", usage), usage
    for number, line in enumerate(map(instead, examples_of_help(text))):
        if line in TRIED:
            continue
        folder = tmp_path / str(number)
        folder.mkdir()
        if " new " not in line:  # which makes the file itself
            lay_out(line, folder, installation)
        done = installation.run("bash", "-c", line, cwd=folder)
        assert done.returncode in (0, 1), f"{line}\n{done.stderr}"
