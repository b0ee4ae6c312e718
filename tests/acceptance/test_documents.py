"""Every command that the pages show works from the wheel, in a folder with the files that the pages show."""

import json
import re

import pytest

from samples import AT_NIGHT

from .documents import shown
from .exceptions import tried
from .materials import lay_out

SHOWN = shown()
# A tutorial is flown as a whole (test_tutorials.py). The pages for developers show commands of a checkout.
ELSEWHERE = ("docs/tutorials/", "docs/developers/")
ALONE = [command for command in SHOWN if not command.page.startswith(ELSEWHERE)]
TRIED = list(dict.fromkeys(line for line in map(tried, ALONE) if line is not None))
# No second time in JSON: another line of the same command is shorter, or there is no such option.
TEXT_ONLY = re.compile(
    "bench|reproduce|sensitivity|compare --|detectability|--backend|--flightgear|--search|--out|"
    "--help|schema|--map|--variant [^ ]*,[^ ]*,|matrix --[dp]|ftc new|ftc show|challenge new|&&"
)
PLUGIN = next(line for line in TRIED if "--target plugins" in line)


@pytest.fixture
def shell(installation, tmp_path):
    """Runs a line as a reader would, in bash, with `plugins` on the path for what is installed into it."""
    plugins = str(tmp_path / "plugins")
    return lambda line: installation.run("bash", "-c", line, cwd=tmp_path, PYTHONPATH=plugins)


def _without_report(line):
    """The option that leaves the report out, where the command has it and it is not given."""
    has_it = re.match(r"beaver-ftc (run|sweep|mismatch) ", line) and "--no-report" not in line
    return " --no-report" if has_it else ""


def _has_json(line):
    """Whether the line is run a second time for its answer in JSON. By day the command's tests ask."""
    return AT_NIGHT and line.startswith("beaver-ftc") and not TEXT_ONLY.search(line)


def _succeeded(done):
    """Whether the status is 0, or 1 with the missed expectation or the requirement that is not shown."""
    return done.returncode == 0 or (
        done.returncode == 1 and re.search("MISSED|FAILED|BROKEN|not shown:", done.stdout)
    )


@pytest.mark.parametrize("line", TRIED)
def test_command_of_the_pages(line, shell, installation, tmp_path):
    lay_out(line, tmp_path, installation, in_short=not AT_NIGHT)
    if "my-cusum" in line and "--plugin" not in line:
        assert shell(PLUGIN).returncode == 0
    done = shell(line)
    assert "Traceback" not in done.stderr + done.stdout, done.stderr
    assert _succeeded(done), f"{done.returncode}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
    if _has_json(line):
        answer = shell(f"{line} --format json{_without_report(line)}")
        assert answer.returncode == done.returncode, answer.stderr
        assert isinstance(json.loads(answer.stdout), dict)
