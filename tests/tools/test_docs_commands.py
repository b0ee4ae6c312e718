"""Commands of the marks: each once, in a folder of its own, within its time; tables and constants."""

import json

from tools.docs import pages
from tools.docs.commands import Output, outputs
from tools.docs.constants import constants
from tools.docs.marks import parsed
from tools.docs.refresh import Refreshed, Wanted

from beaver_ftc.control.laws import loop_design

FAULTS = {
    "exit 2": "ends with status 2: nothing on standard error",
    "echo no such thing >&2; exit 3": "ends with status 3: no such thing",
    "true": "prints nothing",
    "echo x; python -c 'raise ValueError'": "ends with status 1: ValueError",
    "pwd": "prints a path of this machine",
    f"echo {pages.ROOT}/docs": "prints a path of this machine",
    "echo missed; exit 1": "",
}


def test_what_cannot_be_used_says_why():
    found = outputs(FAULTS)
    assert {line: output.fault for line, output in found.items()} == FAULTS


def test_a_changed_gain_turns_the_page_that_cites_it_red(tmp_path, monkeypatch):
    page = parsed(
        "<!-- from code: python -m tools.docs constants -->\n"
        f"It is <!--=code modules.control.laws.loop_design.RATIO g-->{loop_design.RATIO:g}<!--/-->.\n",
        "docs/page.md",
    )
    alone = tmp_path / "src/beaver_ftc/control/laws/loop_design.py"  # all modules take seconds
    alone.parent.mkdir(parents=True)
    alone.symlink_to(loop_design.__file__)
    monkeypatch.setattr("tools.docs.constants.ROOT", tmp_path)

    def changes():
        output = Output(json.dumps(constants()))
        return Refreshed(page, {"python -m tools.docs constants": output}, Wanted()).changes

    assert changes() == []
    monkeypatch.setattr(loop_design, "RATIO", 41.0)
    assert ['printed "41"' in str(change) for change in changes()] == [True]
