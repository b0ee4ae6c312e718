"""Constants of the code that pages cite."""

import json

from tools.docs.commands import Output
from tools.docs.constants import constants
from tools.docs.marks import parsed
from tools.docs.refresh import Refreshed, Wanted

from beaver_ftc.control.laws import loop_design


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
