"""The contract of the files: every limit, default, unit and choice of every key is as it was."""

import pytest

from beaver_ftc.scenario.airframe import Initial, initial_of
from beaver_ftc.scenario.schema import json_schema, load_text
from beaver_ftc.scenario.sweeps import sweep_json_schema
from kept import keys_of
from trainer import trainer

GROUPS = {"a-c": "abc", "d-m": "defghijklm", "n-z": "nopqrstuvwxyz"}


@pytest.mark.parametrize("group", GROUPS)
def test_what_a_scenario_may_say(group, changed):
    sections = keys_of(json_schema())
    assert not changed({name: keys for name, keys in sections.items() if name[0].lower() in GROUPS[group]})


def test_what_a_sweep_may_say(changed):
    assert not changed(keys_of(sweep_json_schema()))


SLOW, FAST = (
    {"airspeed_mps": [15, 40], "alpha_deg": [-4, 14]},
    {"airspeed_mps": [90, 140], "alpha_deg": [0, 9]},
)


def test_what_flight_conditions_there_are(changed):
    """Of no aircraft in particular, and of some that fly slower, faster, higher and with other settings."""
    condition = {
        "trainer": trainer(),
        "slow": trainer(envelope=SLOW, start={"altitude_m": 300}),
        "slower": trainer(envelope={**SLOW, "airspeed_mps": [15, 45]}),
        "fast": trainer(envelope=FAST, start={"altitude_m": 9000}),
        "fast from a start": trainer(envelope=FAST, start={"airspeed_mps": 100}),
        "at the lower end": trainer(envelope={**FAST, "airspeed_mps": [45, 99]}),
        "one more surface": trainer(surfaces={"tab": {"travel_rad": [-0.1, 0.2]}}),
    }
    models = {"any": Initial, **{name: initial_of(aircraft) for name, aircraft in condition.items()}}
    assert not changed({name: keys_of(model.model_json_schema()) for name, model in models.items()})


def test_what_is_said_of_nothing_is_the_default(changed):
    """A scenario of a name alone, whole: what no schema shows is in it."""
    assert not changed(load_text("name: x").model_dump(mode="json", exclude={"sensors"}))
