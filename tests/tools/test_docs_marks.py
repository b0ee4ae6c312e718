"""Marks of the pages: what they say, what is wrong with them, and what becomes of what is printed."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tools.docs import refresh
from tools.docs.commands import Output
from tools.docs.marks import Number, parsed
from tools.docs.refresh import Refreshed, Wanted, digest_of, dressed, linked
from tools.docs.values import at, printed

from beaver_ftc.documents.errors import BadInput

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


def refreshed(text, printed=None, wanted=None, name="docs/page.md"):
    return Refreshed(parsed(text, name), printed or PRINTED, wanted or Wanted(probes=True))


def words(findings):
    return [str(finding) for finding in findings]


def test_a_page_that_stands_as_printed_has_nothing_to_change():
    made = refreshed(PAGE)
    assert (made.findings, made.changes, made.text) == ([], [], PAGE)


def test_what_differs_is_named_with_line_both_texts_and_command_and_is_written():
    stale = PAGE.replace("0.02 s", "0.01 s").replace("0.30<", "0.29<")
    made = refreshed(stale)
    assert words(made.changes) == [
        'docs/page.md:5: stands "detected after 0.01 s", printed "detected after 0.02 s" by fly one',
        'docs/page.md:10: stands "0.29", printed "0.30" by flown rows.1.delay_s of fly two --format json',
    ]
    assert made.text == PAGE


def test_one_character_is_a_difference():
    for index, letter in enumerate("detected after 0.02 s"):
        other = "x" if letter != "x" else "y"
        text = "detected after 0.02 s"
        stale = PAGE.replace(text, text[:index] + other + text[index + 1 :])
        assert len(refreshed(stale).changes) == 1


BROKEN = {
    "<!-- printed: fly -->\ntext\n": "what is printed has no end",
    "<!-- printed: fly -->\n<!-- printed: sail -->\n<!-- /printed -->\n": "a mark inside what is printed",
    "<!-- printed: fly -->\n```text\n<!-- /printed -->\n": "what is printed has no end",
    "<!-- /printed -->\n": "no mark: <!-- /printed -->",
    "<!-- printd: fly -->\n": "no mark: <!-- printd: fly -->",
    "<!-- printed: -->\n": "no mark",
    "text <!-- printed: fly --> text\n": "no mark",
    "a <!-- remark --> b\n": "no mark",
    "never closed <!-- from x\n": "no mark",
    "<!-- from x: fly -->\n": "no number is taken from x",
    "a <!--=x path-->1<!--/-->\n": "no document is called x",
    "a <!--=x path-->1\n": "no mark",
    "a <!--=x-->1<!--/-->\n": "no mark of a number",
    "a <!--=x path .2f .3f-->1<!--/-->\n": "no mark of a number",
    "a <!--=x path *many-->1<!--/-->\n": "no mark of a number",
    "<!-- from x: fly -->\n<!-- from x: sail -->\na <!--=x p-->1<!--/-->\n": "a second document is called x",
    "<!-- from x: fly -->\n<!--=x p-->1<!--/-->\n": "begins the line",
    "<!-- from x: fly -->\n- <!--=x p-->1<!--/-->\n": "begins the line",
    "<!-- printed: fly | dear -->\n<!-- /printed -->\n": "dear without a probe",
    "<!-- printed: fly | dear | prob: x -->\n<!-- /printed -->\n": "no option of what is dear: prob: x",
}


@pytest.mark.parametrize("text", BROKEN)
def test_a_broken_mark_is_a_line(text):
    found = words(parsed(text, "docs/page.md").findings)
    assert any(BROKEN[text] in line and line.startswith("docs/page.md:") for line in found), found
    assert all("\n" not in line for line in found)


@given(st.text(st.sampled_from("<!->/ =ab:|`\nprinted from"), max_size=80))
def test_no_text_breaks_the_reader_and_what_is_no_mark_stays(text):
    page = parsed(text, "docs/page.md")
    nothing = {origin.command: Output("", "no") for origin in page.origins}
    assert Refreshed(page, nothing, Wanted()).text == text


def test_a_command_may_have_bars_of_its_own():
    text = "<!-- printed: fly | head -3 | dear | probe: fly | wc -l | needs DATA | at 1ab 2026-01-02 0f -->\n"
    page = parsed(text + "<!-- /printed -->\n", "docs/page.md")
    assert ["no option of what is dear: wc -l" in finding.words for finding in page.findings] == [True]
    text = text.replace(" | wc -l", "")
    (origin,) = parsed(text + "<!-- /printed -->\n", "docs/page.md").origins
    assert (origin.command, origin.probe, origin.needs) == ("fly | head -3", "fly", "DATA")
    assert origin.at == ("1ab", "2026-01-02", "0f")
    assert f"<!-- printed: {origin} -->\n" == text


def test_a_time_needs_no_probe_and_is_never_compared():
    text = "<!-- printed: clock | dear | machine | at 1ab 2026-01-02 - -->\n3 s\n<!-- /printed -->\n"
    page = parsed(text, "docs/page.md")
    assert page.findings == []
    assert str(page.origins[0]) == "clock | dear | machine | at 1ab 2026-01-02 -"
    assert Wanted(probes=True).commands(page.origins) == ([], [])
    assert Refreshed(page, {}, Wanted(probes=True)).changes == []


def test_what_cannot_be_printed_is_a_line_and_leaves_what_stands():
    made = refreshed(PAGE, {name: Output("", "ends with status 2: no such scenario") for name in PRINTED})
    assert made.text == PAGE
    assert [finding.line for finding in made.findings] == [3, 9]
    made = refreshed(PAGE, {**PRINTED, "fly two --format json": Output("no JSON")})
    assert ["fly two --format json prints no JSON" in line for line in words(made.findings)] == [True]
    made = refreshed(PAGE, {**PRINTED, "fly two --format json": Output("{}")})
    assert len(made.findings) == 2


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


def test_what_is_dear_says_that_the_code_has_changed_since(monkeypatch):
    monkeypatch.setattr(refresh, "changed_since", lambda name: name == "1ab")
    (finding,) = refreshed(STANDS, NEAR).findings
    assert finding.said
    assert "the code has changed since 1ab (2026-01-02): fly far" in finding.words


@pytest.mark.usefixtures("same_code")
def test_what_is_dear_is_written_with_revision_date_and_digest_when_it_is_flown():
    stale = DEAR.format("1ab 2026-01-02 0f")
    made = refreshed(stale, NEAR, Wanted(dear=True))
    assert "13 h" in made.text
    again = refreshed(made.text, NEAR)
    assert again.findings == []
    assert again.page.origins[0].at[0] == "2cd"
    assert refreshed(stale, NEAR, Wanted(dear=True, only="near")).text == stale
    failed = refreshed(stale, {**NEAR, "fly far": Output("", "prints nothing")}, Wanted(dear=True))
    assert (failed.text, len(failed.findings)) == (stale, 1)


def test_what_needs_data_that_is_not_here_is_said(monkeypatch):
    text = "<!-- printed: fly $RECORDED | needs RECORDED -->\nas it was\n<!-- /printed -->\n"
    monkeypatch.delenv("RECORDED", raising=False)
    page = parsed(text, "docs/page.md")
    assert Wanted(dear=True, probes=True).commands(page.origins) == ([], [])
    (finding,) = refreshed(text).findings
    assert finding.said
    assert "needs RECORDED" in finding.words
    monkeypatch.setenv("RECORDED", "/data")
    assert Wanted(dear=True).commands(page.origins) == ([], ["fly $RECORDED"])
    assert Wanted(probes=True).commands(page.origins) == ([], [])


def test_a_block_keeps_its_dress():
    assert dressed("```console\n$ fly\nold\n```\n", "new", "fly") == "```console\n$ fly\nnew\n```\n"
    assert dressed("````yaml\nold\n````\n", "new: 1", "fly") == "````yaml\nnew: 1\n````\n"
    assert dressed("|old|\n", "| new | a \\| b |", "fly") == "|new|a \\| b|\n"
    assert dressed("", "new", "fly") == "```text\nnew\n```\n"
    assert dressed("", "| new |", "python -m tools.docs table new") == "|new|\n"


def test_links_of_what_is_printed_are_as_the_page_sees_them():
    output = {"fly one": Output("![a](images/a.png) [b](theory.md) [c](https://c)")}
    for name, at_root in (("README.md", "docs/"), ("docs/page.md", ""), ("docs/exercises/page.md", "../")):
        made = refreshed("<!-- printed: fly one -->\nold\n<!-- /printed -->\n", output, name=name)
        assert f"![a]({at_root}images/a.png) [b]({at_root}theory.md) [c](https://c)" in made.text


DOCUMENT = {
    "a": [{"name": "x", "b.c": 0.123}, {"name": "y", "b.c": 7}],
    "yes": True,
    "no": None,
}
NUMBERS = {
    ("a.0.b.c", 1.0, ".2f"): "0.12",
    ("a.name=y.b.c", 1.0, ""): "7",
    ("a.-1.b.c", 1.0, ".1f"): "7.0",
    ("a.0.b.c", 100.0, ".3g"): "12.3",
    ("a.0.b.c", 1.0, ".1%"): "12.3%",
    ("yes", 1.0, ""): "yes",
    ("a.1.name", 1.0, ""): "y",
}


def number(path, factor=1.0, form=""):
    return Number("name", path, factor, form, 1, 0, 0)


@pytest.mark.parametrize("wanted", NUMBERS, ids=str)
def test_a_number_is_taken_by_its_path_and_formatted(wanted):
    assert printed(DOCUMENT, number(*wanted)) == NUMBERS[wanted]


@pytest.mark.parametrize("path", ["b", "a.2", "a.z", "a.0.b", "a", "no", "yes.a", "a.name=z", "a.-3"])
def test_a_path_that_leads_nowhere_is_a_line(path):
    with pytest.raises(BadInput, match="allowed"):
        printed(DOCUMENT, number(path))
    with pytest.raises(BadInput, match="allowed"):
        printed(DOCUMENT, number("a.0.b.c", form=".2q"))


@given(st.lists(st.dictionaries(st.text(max_size=5), st.integers(), min_size=1), min_size=1))
def test_every_value_of_a_document_has_a_path(rows):
    for index, row in enumerate(rows):
        for key, value in row.items():
            assert at(rows, f"{index}.{key}") == value


@pytest.mark.parametrize(("page", "up"), [("docs/how-to/a.md", "../"), ("README.md", "docs/")])
def test_links_of_what_is_printed_lead_from_its_page_and_code_stays(page, up):
    text = "a [link](b.md), [heading](#c), [site](https://d.e), `always[1:2](q <= 1)`\n\n{block}\n[f](g.md)"
    block = '```yaml\nformula: "always[12.5:29](abs(q_rad_s) <= 0.1)"\n```\n'
    moved = text.replace("](b", f"]({up}b").replace("](g", f"]({up}g").format(block=block)
    assert linked(text.format(block=block), page) == moved
