"""Who is let in, and what each may ask."""

import json

from hypothesis import given
from hypothesis import strategies as st
from live_site import EVERYTHING

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_live.page import messages
from beaver_ftc_live.page.gate import BURST, MESSAGES_PER_S, Seat


def may(seat, do):
    assert messages.parse(json.dumps({"do": do, **EVERYTHING[do]})).do == do
    try:
        seat.check(do)
    except BadInput as error:
        return not str(error).startswith(f"{do}: ")
    return True


@given(st.lists(st.floats(0, 30), min_size=1, max_size=200))
def test_a_guest_cannot_keep_the_flight_busy(times_s):
    """Whenever it asks: in any time t no more than a burst and the pace times t are let through."""
    seat, let = Seat(1), []
    seat._at_s = 0.0
    for at_s in sorted(times_s):
        try:
            seat.check_pace(at_s)
        except BadInput:
            continue
        let.append(at_s)
    for i, first in enumerate(let):
        for j in range(i, len(let)):
            assert j - i + 1 <= BURST + MESSAGES_PER_S * (let[j] - first) + 1e-6
