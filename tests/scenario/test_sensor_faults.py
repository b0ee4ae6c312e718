"""Faults of instruments in a scenario: what is read, and one clear line for each mistake."""

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.schema import load


def faulty(**fault):
    return {"name": "x", "faults": [{"sensor": "p", "type": "bias", "magnitude": 1, "at_s": 2} | fault]}


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        ({"sensor": "pp"}, "faults[0].sensor: 'pp' is no sensor, did you mean p? allowed: p, q, r, alpha"),
        (
            {"type": "jammed"},
            "faults[0].type: 'jammed' is not known, allowed: bias, freeze, lost, noise, scale",
        ),
        ({"magnitude": 500}, "faults[0].magnitude: 500 is out of range, allowed: at most 200 deg/s for p"),
        (
            {"sensor": "az", "magnitude": -101},
            "faults[0].magnitude: -101 is out of range, allowed: at most 100 m/s2 for az",
        ),
        (
            {"sensor": "qdyn", "magnitude": 9e9},
            "faults[0].magnitude: 9e+09 is out of range, allowed: a number",
        ),
        ({"type": "scale", "magnitude": 3}, "faults[0].magnitude: 3 is out of range"),
        ({"type": "freeze"}, "faults[0].magnitude: unknown key"),
        ({"bias_deg": 3}, "faults[0].bias_deg: unknown key"),
        ({"actuator": "elevator"}, "faults[0].actuator: unknown key"),
        ({"end_s": 1}, "faults[0].end_s: 1 is not after at_s, allowed: later than 2 s"),
        ({"at_s": 40}, "faults[0].at_s: 40 is after the end, allowed: earlier than duration_s, 30 s"),
        ({"end_s": None, "until_s": 5}, "faults[0].until_s: says the same as end_s, allowed: one of the two"),
        ({"end_s": 4, "until_s": 5}, "faults[0].until_s: says the same as end_s, allowed: one of the two"),
        ({"magnitude": "much"}, "faults[0].magnitude: 'much' is text, allowed: a number"),
    ],
)
def test_a_mistake_is_one_line(fault, says):
    with pytest.raises(BadInput) as error:
        load(faulty(**fault))
    assert str(error.value).startswith(says)
    assert len(str(error.value).splitlines()) == 1


@pytest.mark.parametrize(("said", "meant"), [("airspeed", "V"), ("dynamic_pressure", "qdyn")])
def test_an_instrument_may_be_called_in_words(said, meant):
    assert load(faulty(sensor=said)) == load(faulty(sensor=meant))
