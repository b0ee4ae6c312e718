"""Faults of instruments in a scenario: what is read, and one clear line for each mistake."""

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.schema import load
from given import given

GIVEN = given(__file__)


def faulty(**fault):
    return {"name": "x", "faults": [{"sensor": "p", "type": "bias", "magnitude": 1, "at_s": 2} | fault]}


@pytest.mark.parametrize(
    ("fault", "says"),
    GIVEN["a mistake is one line"],
)
def test_a_mistake_is_one_line(fault, says):
    with pytest.raises(BadInput) as error:
        load(faulty(**fault))
    assert str(error.value).startswith(says)
    assert len(str(error.value).splitlines()) == 1


@pytest.mark.parametrize(("said", "meant"), [("airspeed", "V"), ("dynamic_pressure", "qdyn")])
def test_an_instrument_may_be_called_in_words(said, meant):
    assert load(faulty(sensor=said)) == load(faulty(sensor=meant))
