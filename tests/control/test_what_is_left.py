"""Hidden redundancy: what stands in for a surface that is gone, and what is lost without it as well."""

import pytest

import beaver_ftc as bf


def lost(surface, at_s):
    return {"actuator": surface, "type": "loss_of_effectiveness", "magnitude": 1.0, "at_s": at_s}


BOTH_FLAPS = [lost("flap_left", 50), lost("flap_right", 50)]


@pytest.mark.parametrize(
    ("name", "without", "channel", "held", "off"),
    [
        ("mission-split-ailerons-lost", [lost("rudder", 60)], "heading_deg", 12.0, 30.0),
        ("mission-split-elevator-lost", BOTH_FLAPS, "altitude_m", 25.0, 100.0),
    ],
)  # fmt: skip
def test_what_is_left_holds_the_profile_and_without_it_nothing_does(name, without, channel, held, off):
    scenario = bf.load(name)
    faults = [fault.model_dump(exclude_unset=True) for fault in scenario.faults]
    as_it_is = bf.fly(scenario, log=False).metrics
    ablated = bf.fly(scenario.with_({"faults": [*faults, *without]}), log=False).metrics
    assert as_it_is["profile"][channel] < held
    assert ablated["profile"][channel] > off
