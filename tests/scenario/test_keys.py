"""Sections as text: what one flight's section holds is never taken for another's."""

from beaver_ftc.scenario import builtin
from beaver_ftc.scenario.schema import Scenario

SECTIONS = ("initial", "uncertainty", "control")


def test_a_text_is_that_of_the_section_it_is_asked_for():
    for i in range(2 * builtin._MOST):  # more than are kept, most of them gone when the next comes
        scenario = Scenario(name="one", initial={"airspeed_mps": 40 + i / 100})
        written = tuple(getattr(scenario, name).model_dump_json() for name in SECTIONS)
        assert builtin.texts_of(scenario, SECTIONS) == written
    assert len(builtin._texts) <= builtin._MOST
