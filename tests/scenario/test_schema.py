"""What a scenario may say, its defaults, and what it carries to the flight."""

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.schema import Scenario, load_text


def scenario(text: str = "") -> Scenario:
    return load_text("name: x\n" + text)


@pytest.mark.parametrize(
    ("key", "least", "most"),
    [
        ("duration_s", 0.01, 360_000),
        ("rate_hz", 20, 1000),
        ("substeps", 1, 50),
        ("initial.airspeed_mps", 20, 70),
        ("initial.altitude_m", -300, 6000),
    ],
)
def test_the_contract_s_ranges_are_inclusive(key, least, most):
    *section, last = key.split(".")
    for value in (least, most):
        text = f"{section[0]}: {{{last}: {value}}}" if section else f"{last}: {value}"
        scenario(text)
    for value in (least - 1, most + 1):
        text = f"{section[0]}: {{{last}: {value}}}" if section else f"{last}: {value}"
        with pytest.raises(BadInput, match=f"{key}: .* out of range"):
            scenario(text)
