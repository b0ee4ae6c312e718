"""What a page may say: only what is declared, small, finite."""

import json

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_live.page import messages
from given import given

GIVEN = given(__file__)

# Of each number the least and the largest that is taken, and the field that has it.
LIMITS = GIVEN["limits"]


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
