"""The section `channels` of an aircraft's file: what it may say, and what is refused in a line."""

import pytest
from pydantic import ValidationError

from beaver_ftc.aircraft.schema import AircraftFile, OutputSection
from trainer import trainer_file


def test_elevons_and_a_throttle_can_be_said():
    left, right = {"channel": 1, "share": 0.5}, {"channel": 2, "share": -0.5, "reversed": True}
    channels = {"surfaces": {"elevator": [left, right]}, "throttle": {"channel": 3, "trim_us": 1000}}
    read = AircraftFile.model_validate(trainer_file(channels=channels)).channels
    assert [output.share for output in read.surfaces["elevator"]] == [0.5, -0.5]
    assert (read.throttle.channel, read.throttle.pwm_us, read.throttle.trim_us) == (
        3,
        (1000.0, 2000.0),
        1000.0,
    )


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"channel": 0}, "greater than or equal to 1"),
        ({"channel": 33}, "less than or equal to 32"),
        ({"channel": 1, "share": 0.0}, "0 moves nothing, allowed: -1 to 1 without 0"),
        ({"channel": 1, "share": 1.1}, "less than or equal to 1"),
        ({"channel": 1, "pwm_us": [2000, 1000]}, "ends out of order, allowed: \\[lower, upper\\]"),
        ({"channel": 1, "pwm_us": [1500, 1500]}, "ends out of order, allowed: \\[lower, upper\\]"),
        ({"channel": 1, "pwm_us": [900, 5000]}, "less than or equal to 2500"),
        ({"channel": 1, "trim_us": 2100}, "is out of range, allowed: 1000 to 2000, as pwm_us says"),
        ({"channel": 1, "reverse": True}, "Extra inputs are not permitted"),
    ],
)
def test_what_no_output_is(given, says):
    with pytest.raises(ValidationError) as refused:
        OutputSection.model_validate(given)
    (error,) = refused.value.errors()
    told = error["ctx"]["conflicts"][0][1] if error["type"] == "conflict" else error["msg"]
    assert says.replace("\\", "") in told
