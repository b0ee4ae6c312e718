"""Damage in the 3-D view: of a jet every surface has a place, and what a case takes is not drawn."""

import pytest
from live_browser import CHROMIUM, until

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium on this machine")

SIDES = ("left", "right")
PLACES = ("inboard_elevator", "outboard_elevator", "aileron", "inboard_spoiler", "outboard_spoiler",
          "inboard_flap", "outboard_flap")  # fmt: skip
SURFACES = [f"{side}_{place}" for place in PLACES for side in SIDES] + [
    "upper_rudder",
    "lower_rudder",
    "stabiliser",
]
TAKES = {
    "fin-off": ["upper_rudder", "lower_rudder"],
    "left-wing-tip-off": ["left_aileron"],
    "left-stabiliser-off": ["stabiliser", "left_outboard_elevator", "left_inboard_elevator"],
    "left-outboard-flap-off": ["left_outboard_flap"],
}
MISSING = """async ([surfaces, cases, takes]) => {
  const view = await import(new URL("js/aircraft3d.js", document.querySelector("script[type=module]").src.replace(/js\\/[^/]*$/, "")));
  const jet = view.buildAircraft(surfaces);
  view.dismember(jet, cases, takes);
  const unseen = (all) => all.filter(([, body]) => !body.visible).map(([name]) => name);
  return [jet.panels.map(({ name }) => name), unseen(jet.panels.map(({ name, place }) => [name, place])), unseen(Object.entries(jet.parts))];
}"""  # noqa: E501


PARTS = {"fin-off": "fin", "left-wing-tip-off": "left_wing_tip", "left-stabiliser-off": "left_stabiliser"}


def test_what_damage_takes_is_missing(chromium, cockpit):
    page = chromium.new_page()
    page.goto(cockpit.address)
    until(page, "Boolean(window.cockpit)")
    for case in (None, *TAKES):
        drawn, surfaces, parts = page.evaluate(MISSING, [SURFACES, [case] if case else [], TAKES])
        assert set(drawn) == set(SURFACES)
        assert set(surfaces) == set(TAKES.get(case, ())) - {"stabiliser"}  # its other half is there
        assert parts == ([PARTS[case]] if case in PARTS else [])
    page.close()
