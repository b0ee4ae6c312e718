"""The GTM damaged: trimmed by what goes together, the envelope that is left, its error map, its verdicts."""

from itertools import pairwise
from math import cos, radians, sin, tan

import numpy as np
import pytest
from pydantic import ValidationError
from tools.gtm.envelope import Envelope

from beaver_ftc.aircraft import Aircraft, load
from beaver_ftc.aircraft.schema import AircraftFile, DamageSection
from beaver_ftc.diagnosis.detection.statistical import (
    DAMAGE_FREQUENCY_RAD_S,
    drift_frequency,
)
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.trim import trim
from beaver_ftc.results.metrics import DeclaredFault
from beaver_ftc.scenario.diagnosis import Statistical
from beaver_ftc_aircraft.derive import sample as sampling
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
    assert {(of.beta_rad, of.altitude_m, of.of_region) for of in regions} == {(0.2, (0.0, 1500.0), True)}
    alphas = np.degrees([of.alpha_rad for of in regions])
    assert [alphas.min(), alphas.max()] == pytest.approx(whole["alpha_deg"])


def test_those_that_stand_in_move_less_but_at_the_last_share():
    plant = Plant(100, aircraft=SPLIT)
    moves = sampling.Moves((0.1, 0.2, 0.5, 1.0), 0.05)
    point = trim(45.0, 1800.0, plant)
    where = sampling.Region(sampling.Envelope((40.0, 50.0), (0.0, 0.1), 0.1, (1000.0, 2000.0), True), point)
    found = sampling.sample_all(plant, [where, where], 960, 1, {}, sampling.FRESH, moves)
    ends = np.array([max(-t.min_rad, t.max_rad) for t in SPLIT.travel.values()])
    used = np.abs(found.u) / ends
    seldom = np.array([s in SPLIT.stand_ins for s in SPLIT.surfaces])
    for level, share in enumerate(moves.shares):
        most = used[found.level == level].max(axis=0)
        assert (most[~seldom] <= share + 1e-9).all()
        assert (most[seldom] <= (share if share == 1.0 else 0.05 * share) + 1e-9).all()
    assert set(found.box) == set(range(8))


def test_every_box_of_a_region_holds_all_its_engines_do():
    plant = Plant(100, aircraft=SPLIT)
    where = sampling.Envelope((40.0, 50.0), (0.0, 0.1), 0.16, (1000.0, 2000.0), True)
    draw = sampling.Draw(1, SPLIT, where, trim(45.0, 1800.0, plant))
    started = [draw.start(0.25, turn) for turn in range(300)]
    for name, setting in SPLIT.engine.settings.items():
        drawn = [state.settings[name] for state in started]
        assert (min(drawn), max(drawn)) == pytest.approx(setting.range)
    states = [draw.state(started[0], draw.place(draw.ends(0.25, 1.0))) for _ in range(300)]
    assert np.ptp([state.beta_rad for state in states]) == pytest.approx(0.16)  # half of +-0.16
    assert max(state.p_rad_s for state in states) == pytest.approx(0.5 * sampling.RATES_RAD_S[0])
    assert np.ptp([state.alpha_rad for state in states]) < 0.25 * 0.1 + 1e-9


def test_only_where_damage_takes_surfaces_is_the_drift_that_of_a_slow_swing():
    given = Statistical()
    known = [SPLIT]
    for takes in ([], ["rudder"]):
        damage = {"one": DamageSection(property="failures/damage/one", takes=takes)}
        known.append(Aircraft(SPLIT.file.model_copy(update={"damage": damage}), SPLIT.folder))
    assert [drift_frequency(given, of) for of in known] == [
        15.0,
        15.0,
        DAMAGE_FREQUENCY_RAD_S,
    ]


def test_unanticipated_is_no_wrong_type_of_damage():
    damage = DeclaredFault(None, "damage", 1.0)
    assert damage.is_of_type("unanticipated") is None
    assert damage.is_of_type("loss_of_effectiveness") is True
    assert damage.is_of_type("stuck") is False


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


def test_slower_than_its_tip_lets_it_there_is_no_level_flight(where, bench):
    turns = list(Envelope(bench, 4).turns((60.0, 110.0), (0,), (0,)))
    bench.damage(0)
    assert {turn.speed_kt: turn.held for turn in turns} == {60.0: False, 110.0: True}
