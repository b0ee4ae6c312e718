"""Marks of the pages: what they say, what is wrong with them, and what becomes of what is printed."""

import json

import pytest
from tools.docs import refresh
from tools.docs.commands import Output
from tools.docs.marks import parsed
from tools.docs.refresh import Refreshed, Wanted, digest_of

PAGE = """# A page

<!-- printed: fly one -->
```text
detected after 0.02 s
```
<!-- /printed -->

<!-- from flown: fly two --format json -->
It takes <!--=flown rows.1.delay_s .2f-->0.30<!--/--> s in <!--=flown share *100 .0f-->40<!--/--> %.

```html
<!-- printed: nothing, this is an example -->
```
"""
PRINTED = {
    "fly one": Output("detected after 0.02 s"),
    "fly two --format json": Output(json.dumps({"rows": [{}, {"delay_s": 0.3}], "share": 0.4})),
}


def refreshed(text, printed=None, wanted=None):
    return Refreshed(parsed(text, "docs/page.md"), printed or PRINTED, wanted or Wanted(probes=True))


def words(findings):
    return [str(finding) for finding in findings]


def test_what_differs_is_named_with_line_both_texts_and_command_and_is_written():
    stale = PAGE.replace("0.02 s", "0.01 s").replace("0.30<", "0.29<")
    made = refreshed(stale)
    assert words(made.changes) == [
        'docs/page.md:5: stands "detected after 0.01 s", printed "detected after 0.02 s" by fly one',
        'docs/page.md:10: stands "0.29", printed "0.30" by flown rows.1.delay_s of fly two --format json',
    ]
    assert made.text == PAGE


DEAR = "<!-- printed: fly far | dear | probe: fly near | at {} -->\n```text\n12 h\n```\n<!-- /printed -->\n"
NEAR = {"fly near": Output("0.02"), "fly far": Output("13 h")}
STANDS = DEAR.format(f"1ab 2026-01-02 {digest_of('0.02')}")


@pytest.fixture
def same_code(monkeypatch):
    monkeypatch.setattr(refresh, "changed_since", lambda name: False)
    monkeypatch.setattr(refresh, "revision", lambda: "2cd")


@pytest.mark.usefixtures("same_code")
def test_what_is_dear_is_red_when_its_probe_prints_otherwise():
    assert refreshed(STANDS, NEAR).findings == []
    (finding,) = refreshed(STANDS, {"fly near": Output("0.03")}).findings
    assert "the probe has changed" in finding.words
    assert not finding.said
    (finding,) = refreshed(
        f"{STANDS}It was not flown again since `1ab`.\n", {"fly near": Output("0.03")}
    ).findings
    assert finding.said
    (finding,) = refreshed(
        f"{STANDS}It was not flown again since `2cd`.\n", {"fly near": Output("0.03")}
    ).findings
    assert not finding.said
    (finding,) = refreshed(DEAR.replace(" | at {}", ""), NEAR).findings
    assert "never printed" in finding.words
    (finding,) = refreshed(STANDS, {"fly near": Output("", "prints nothing")}).findings
    assert not finding.said
