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
}
BREAKS = {
    "caption": (f"The travel follows.\n\n{TABLE}", 3),
    "second table": (f"*Table 1. Travel.*\n\n{TABLE}\n{TABLE}", 7),
    "symbol": (r"The angle $\Lambda_1$ is small.", 1),
    "symbol on a line of its own": ("It holds:\n\n$$x\n= \\Xi$$\n", 3),
    "number": ("The travel\nis 59 deg.", 2),
}


@pytest.mark.parametrize("text", KEEPS.values(), ids=KEEPS)
def test_what_keeps_the_rules_passes(text):
    assert prose.check([parsed(text + NEXT, "docs/page.md")]) == []


@pytest.mark.parametrize(("text", "line"), BREAKS.values(), ids=BREAKS)
def test_what_breaks_a_rule_is_found(text, line):
    found = prose.check([parsed(text + NEXT, "docs/results/page.md")])
    assert [one.line for one in found][:1] == [line], found
