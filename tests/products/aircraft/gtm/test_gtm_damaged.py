"""The GTM damaged: trimmed by what goes together, the envelope that is left, its error map, its verdicts."""

from itertools import pairwise
from math import cos, radians, sin, tan

import numpy as np
import pytest
from pydantic import ValidationError
from tools.gtm.envelope import Envelope

from beaver_ftc.aircraft import Aircraft, load
from beaver_ftc.aircraft.schema import AircraftFile
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.trim import trim
from beaver_ftc_aircraft.gtm import folder
from beaver_ftc_aircraft.gtm.steady import FT_S_PER_KNOT

SPLIT = load("beaver-split")


def _together(of: dict) -> Aircraft:
    data = SPLIT.file.model_dump(mode="json", exclude_none=True)
    data["trim"]["together"] = of
    return Aircraft(AircraftFile.model_validate(data), SPLIT.folder)


def test_trim_moves_surfaces_together():
    """Two halves against one another hold it with half of what one alone takes."""
    leader = next(s for s in SPLIT.primary if "aileron" in s)
    other = next(s for s in SPLIT.surfaces if "aileron" in s and s != leader)
    pair = _together({leader: {other: -1.0}})
    assert other in SPLIT.left_by_trim
    assert other not in pair.left_by_trim
    alone = trim(45.0, 1800.0, Plant(100, aircraft=SPLIT)).surfaces_rad
    both = trim(45.0, 1800.0, Plant(100, aircraft=pair)).surfaces_rad
    assert both[other] == -both[leader] != 0.0
    assert both[leader] == pytest.approx(0.5 * alone[leader], rel=0.05)


@pytest.mark.parametrize(
    ("of", "says"),
    [
        ({"wing": {"rudder": 1}}, "unknown surface"),
        ({"rudder": {"wing": 1}}, "unknown surface"),
        ({"rudder": {"rudder": 1}}, "leads itself"),
        ({"rudder": {"elevator": 2}}, "less than or equal to 1"),
    ],
)  # fmt: skip
def test_what_cannot_go_together_is_refused(of, says):
    with pytest.raises(ValidationError) as wrong:
        _together(of)
    told = str(wrong.value.errors())
    assert says in told


def test_the_regions_hold_the_envelope():
    """No airspeed of it is left out, and every region is inside, to the same sideslip and altitudes."""
    regions, whole = folder.regions(), folder.aircraft_file()["envelope"]
    speeds = [of.airspeed_mps for of in regions]
    assert [speeds[0][0], speeds[-1][1]] == whole["airspeed_mps"]
    assert all(before[1] >= after[0] for before, after in pairwise(speeds))
    assert folder.aircraft_file()["start"]["altitude_m"] == 243.84  # 800 ft
    assert {(of.beta_rad, of.altitude_m, of.of_region) for of in regions} == {(0.2, (0.0, 1500.0), True)}
    alphas = np.degrees([of.alpha_rad for of in regions])
    assert [alphas.min(), alphas.max()] == pytest.approx(whole["alpha_deg"])


@pytest.mark.parametrize("case", [0, 2, 4])
def test_a_turn_that_is_held_is_coordinated_by_gravity(where, bench, case):
    """Level flight about a vertical axis: the rate of turn is what bank and side force give [Etkin1996]."""
    envelope = Envelope(bench, case)
    for turn in envelope.turns((100.0,), (-30, 0, 30), (0,)):
        assert turn.held
        rate, V = turn.x[5], 100.0 * FT_S_PER_KNOT / envelope.thin
        usual = 32.13 * tan(radians(turn.bank_deg)) / V
        assert rate == pytest.approx(usual, abs=0.04 + 0.1 * abs(usual))
        assert cos(turn.x[0]) > 0.9 > abs(sin(turn.x[0]))
    bench.damage(0)
