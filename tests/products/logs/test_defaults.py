"""What is assumed where a vehicle file says nothing of laws and air."""

import pytest
import small

from beaver_ftc_logs.identification import assume_law_and_air

BARE = {key: of for key, of in small.WING.items() if key != "labels"}


@pytest.mark.parametrize(
    ("of", "keys", "taken"),
    [
        (BARE, {}, (True, True)),
        (small.WING, {}, (False, False)),
        (BARE, {"moving_air": False}, (True, False)),
        (small.WING, {"other_laws": True}, (True, False)),
    ],
)
def test_laws_and_air_are_taken_to_be_others_unless_labels_or_a_key_say(of, keys, taken):
    model = small.model(of)
    vehicle, lines = assume_law_and_air([small.flight(model, n=60)], small.vehicle(of, **keys))
    assert (vehicle.other_laws, vehicle.moving_air) == taken
    assert [line.partition(":")[0] for line in lines[:2]] == ["other_laws", "moving_air"]
    assert sum("as the vehicle file says" in line for line in lines) == len(keys)
