"""One contract for all commands: options, help, wrong usage, and a document of what cannot be done."""

import json
import re
from inspect import signature
from typing import get_args

import pytest

from beaver_ftc.cli.main import Row, every_command
from beaver_ftc.commands import FORMER, registered
from commands import beaver

COMMANDS = sorted(registered())
REFUSED = (
    "compare nope", "sensitivity nope", "derive nope", "diagnose nope.csv --model nope.json", "evidence nope",
    "identify nope.csv --vehicle nope --out model.json", "mismatch nope", "run nope",
    "separate nope", "detectability nope --surface elevator --within 1", "sweep nope", "sweep nope --resume",
    "trim nope", "validate nope", "detectability --grid quick --aircraft nope", "matrix --aircraft nope",
    "challenge grade nope",
    "compare --benchmark --laws nope", "compare --flights nope", "import gtm nope", "live --aircraft nope",
)  # fmt: skip


def test_options_of_all_commands(changed):
    """Defaults, names, ranges and helps of every option; of each package by itself."""
    found = {}
    for name, target in registered().items():
        parameters = signature(Row(name, target).read()).parameters.values()
        options = {each.name: _option(each) for each in parameters}
        found.setdefault(target.partition(".")[0], {})[name] = options
    for package, commands_of_it in found.items():
        assert not changed(commands_of_it, part=package)


def _option(parameter):
    _, option = get_args(parameter.annotation)
    default = "" if parameter.default is parameter.empty else parameter.default
    ends = ["" if of is None else of for of in (option.min, option.max, option.metavar)]
    return " | ".join(map(str, (default, getattr(option, "param_decls", None), *ends, option.help)))


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_explains_itself_and_refuses_what_it_does_not_know(name, tmp_path):
    shown = beaver(*name.split(), "--help", cwd=tmp_path)
    assert (shown.returncode, shown.stderr) == (0, "")
    words = re.sub(r"[\s│]+", " ", shown.stdout)
    for option in every_command()[name].params:
        assert all(word in words for word in option.opts if word.startswith("--")), option.name
    wrong = beaver(*name.split(), "--no-such-option", cwd=tmp_path)
    assert (wrong.returncode, wrong.stdout) == (2, "")
    assert "--no-such-option" in wrong.stderr
    assert "Traceback" not in wrong.stderr
    assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize("name", FORMER)
def test_a_former_name_says_what_to_type_instead(name, tmp_path):
    now, shown = FORMER[name], beaver(name, "--help", cwd=tmp_path)
    assert (shown.returncode, shown.stderr) == (
        0,
        f"{name} is a former name: type beaver-ftc {' '.join(now)}\n",
    )
    assert f"beaver-ftc {now[0]} [OPTIONS]" in shown.stdout.splitlines()[0]


@pytest.mark.parametrize("digits", ["²", "--5"])
def test_a_text_that_is_no_whole_number_of_flights_is_a_folder(digits, tmp_path):
    done = beaver("compare", f"--flights={digits}", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")


@pytest.mark.parametrize("line", REFUSED)
def test_what_cannot_be_done_is_said_also_in_a_document_and_leaves_nothing(line, tmp_path):
    one, two = (" ".join(line.split()[:n]) for n in (1, 2))
    name = two if two in registered() else one
    if name not in registered():
        pytest.skip(f"there is no command {name}")
    form = ["--format", "json"] * any("--format" in each.opts for each in every_command()[name].params)
    done = beaver(*line.split(), *form, cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    assert "nope" in done.stderr
    assert "Traceback" not in done.stderr
    if form and name != "validate":  # its document has each file
        said = [line for line in done.stderr.splitlines() if not line.startswith("importing: ")]
        assert json.loads(done.stdout)["errors"] == said
    assert [*tmp_path.iterdir()] == []
