"""What is done to a flight from outside, as a scenario that had said so from the start."""

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario import interventions as done
from beaver_ftc.scenario.interventions import StickTrack
from beaver_ftc.scenario.schema import load
from given import given

GIVEN = given(__file__)

LOSS = {"type": "loss_of_effectiveness", "actuator": "elevator", "magnitude": 0.4}
STUCK = {"type": "stuck", "actuator": "rudder", "position_deg": 3}


def said(call, *arguments):
    with pytest.raises(BadInput) as error:
        call(*arguments)
    return str(error.value)


def test_a_fault_begins_now_and_its_mistakes_are_named_by_its_own_keys():
    assert done.fault_of(LOSS, 2.5).model_dump(exclude_unset=True) == {**LOSS, "at_s": 2.5}
    assert done.fault_of({"sensor": "p", "type": "bias", "magnitude": 1}, 2.5).at_s == 2.5
    assert said(done.fault_of, {**LOSS, "magnitude": 1.5}, 2.5).startswith("magnitude: 1.5 is out of range")
    assert said(done.fault_of, {**LOSS, "at_s": 3}, 2.5) == (
        "at_s: has no meaning here, allowed: a fault that begins now, at 2.5 s"
    )
    assert said(done.fault_of, "a" * 99, 0.0) == (
        f"'{'a' * 59} is no fault, allowed: a mapping of `type`, `actuator` and its size"
    )


def test_targets_replace_what_was_to_come_on_their_channels():
    legs = [{"at_s": 0, "value": 1000}, {"at_s": 5, "value": 1100}, {"at_s": 9, "value": 1200}]
    given = load({"autopilot": {"altitude_m": legs, "bank_deg": [{"hold": True}]}})
    profile = done.with_targets(given, {"altitude_m": 900.0}, 5.0).autopilot
    assert [(leg.at_s, leg.value) for leg in profile.altitude_m] == [(0, 1000), (5, 900)]
    assert profile.bank_deg == given.autopilot.bank_deg
    assert len(done.with_targets(given, {"altitude_m": 900.0}, 5.01).autopilot.altitude_m) == 3
    assert said(done.with_targets, given, {"altitude": 1}, 1.0).startswith(
        "autopilot: 'altitude' is not known, did you mean altitude_m? allowed: altitude_m,"
    )
    for without in ({}, {"autopilot": {}}):
        assert said(done.with_targets, load(without), {"altitude_m": 1}, 1.0) == (
            "autopilot: this flight has none, allowed: a scenario with `autopilot`"
        )


def moved(*rates):
    """A track of a stick that is at rates[k] (p, q, r) from frame k on; None where nobody moves it."""
    track = StickTrack()
    for k, rate in enumerate(rates):
        track.move(k, None if rate is None else np.array(rate, float))
    return track


@pytest.mark.parametrize(
    ("rates", "is_moved", "tables"),
    GIVEN["a table of the stick gives every frame its rate"],
)  # fmt: skip
def test_a_table_of_the_stick_gives_every_frame_its_rate(rates, is_moved, tables):
    track = moved(*rates)
    assert track.moved is is_moved
    found = list(track.tables(10.0))
    assert [[axis, pytest.approx(times), of] for axis, times, of in found] == tables
    for axis, times, of in found:
        felt = [0.0 if rate is None else rate["pqr".index(axis)] for rate in rates]
        assert list(np.interp(np.arange(len(rates)) / 10.0, times, of)) == felt


def test_what_was_flown_is_a_scenario_that_flies_it_again():
    scenario = load({
        "duration_s": 60, "rate_hz": 50, "faults": [{**LOSS, "at_s": 1}],
        "reference": {"p": [{"step": {"amplitude_deg_s": 1}}]},
        "changes": [{"at_s": 1, "law": "nominal"}, {"at_s": 2, "law": "oracle"}],
        "expect": {"detected_within_s": 1, "no_departure": True},
    })  # fmt: skip
    stuck = done.fault_of(STUCK, 1.5)
    track = moved((1, 0, 0), (1, 0, 2))
    flown = done.scenario_flown(scenario, [*scenario.faults, stuck, done.fault_of(LOSS, 2.0)], track, 100)
    assert flown.model_dump(mode="json", exclude_unset=True) == {
        "name": "unnamed", "duration_s": 2.0, "rate_hz": 50,
        "faults": [{**LOSS, "at_s": 1}, {**STUCK, "at_s": 1.5}],
        "reference": {
            "p": [{"step": {"amplitude_deg_s": 1}}, table("p", [0.0], [1.0])],
            "r": [table("r", [0.0, 0.02], [0.0, 2.0])],
        },
        "changes": [{"at_s": 1, "law": "nominal"}],
        "expect": {"detected_within_s": 1, "no_departure": True},
    }  # fmt: skip
    without = done.scenario_flown(scenario, [], StickTrack(), 100)
    assert without.expect.model_dump(exclude_unset=True) == {"no_departure": True}
    assert without.faults == ()
    assert without.reference == scenario.reference


def table(axis, times_s, values_deg_s):
    return {"csv": {"file": "sticks.csv", "column": axis, "time_s": times_s, "values_deg_s": values_deg_s}}
