"""Rules of how pages are written: each finds what breaks it, and lets pass what keeps it."""

import pytest
from tools.docs import prose
from tools.docs.marks import parsed

TABLE = "|surface|travel, deg|\n|---|---|\n|flap|59|\n"
NEXT = "\n\n## Next\n\nGo on with [the theory](theory.md).\n"
KEEPS = {
    "caption": f"*Table 1. Travel of a surface.*\n\n{TABLE}",
    "caption of a printed table": f"*Table 2. Travel.*\n\n<!-- printed: fly -->\n{TABLE}<!-- /printed -->\n",
    "table in code": f"```text\n{TABLE}```\n",
    "symbols": r"The bound $\bar\eta_i[k]$ holds, $\dot x=f(x,y)+G\,u_s$, and $e^{-\lambda\,dt}$ is memory.",
    "verbs": "The rudder jams. It doesn't move! Fly `beaver-ftc run` first.",
    "a relation": r"Without a fault $\nu=\eta$.",
    "a label": "Two of three.",
    "what ends with no stop": "Largest error of the worst signal:",
    "a heading": "# The largest error of the worst signal.",
}
BREAKS = {
    "caption": (f"The travel follows.\n\n{TABLE}", "caption", 3),
    "second table": (f"*Table 1. Travel.*\n\n{TABLE}\n{TABLE}", "caption", 7),
    "symbol": (r"The angle $\Lambda_1$ is small.", "symbol", 1),
    "symbol on a line of its own": ("It holds:\n\n$$x\n= \\Xi$$\n", "symbol", 3),
    "verb": ("It moves. Largest error of the worst signal.", "verb", 1),
    "verb in an item": ("- it moves.\n- the largest error of the worst signal.\n", "verb", 2),
}


@pytest.mark.parametrize("text", KEEPS.values(), ids=KEEPS)
def test_what_keeps_the_rules_passes(text):
    assert list(prose.faults("docs/page.md", text + NEXT)) == []


@pytest.mark.parametrize(("text", "kind", "line"), BREAKS.values(), ids=BREAKS)
def test_what_breaks_a_rule_is_found(text, kind, line):
    found = list(prose.faults("docs/page.md", text + NEXT))
    assert [(kind, line)] == [(of, at) for of, at, _ in found][:1], found


def test_a_page_breaks_a_rule_no_more_often_than_it_may(monkeypatch):
    page = parsed("The largest error of all. The least error of all." + NEXT, "docs/page.md")
    for allowed, found in ({}, 2), ({"docs/page.md": {"verb": 1}}, 2), ({"docs/page.md": {"verb": 2}}, 0):
        monkeypatch.setattr(prose, "_allowed", lambda allowed=allowed: allowed)
        assert len(prose.check([page])) == found
    assert prose.counts([page]) == {"docs/page.md": {"verb": 2}}
