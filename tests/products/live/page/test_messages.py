"""What a page may say: only what is declared, small, finite."""

import json

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_live.page import messages

# Of each number the least and the largest that is taken, and the field that has it.
LIMITS = [
    ({"do": "break", "fault": {"magnitude": 0.0}}, ("fault", "magnitude"), -1000, 1000),
    ({"do": "blow", "velocity_mps": [0.0, 0.0, 0.0]}, ("velocity_mps", 2), -25, 25),
    ({"do": "aim", "altitude_m": 0.0}, ("altitude_m",), -10_000, 10_000),
    ({"do": "aim", "airspeed_mps": 0.0}, ("airspeed_mps",), -1000, 1000),
    ({"do": "stick", "rates_deg_s": [0.0, 0.0, 0.0]}, ("rates_deg_s", 1), -20, 20),
    ({"do": "speed", "times": 1.0}, ("times",), 1, 20),
    ({"do": "save", "n": 0}, ("n",), 0, 2**53),
]


@pytest.mark.parametrize(("request_", "place", "least", "most"), LIMITS)
def test_a_number_on_its_limit_is_taken_and_one_beyond_it_is_not(request_, place, least, most):
    for value, taken in ((least, True), (most, True), (least - 1, False), (most + 1, False)):
        given = json.loads(json.dumps(request_))
        of = given
        for key in place[:-1]:
            of = of[key]
        of[place[-1]] = value
        if taken:
            assert messages.parse(json.dumps(given)).do == given["do"]
        else:
            with pytest.raises(BadInput, match=str(place[-1])):
                messages.parse(json.dumps(given))
