"""The survey of detection probability: its flights, its levels, its counts, and what the command writes."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beaver_ftc.diagnosis import Verdict
from beaver_ftc.diagnosis.informed_test import detection_probability
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies.compare.replay import Trace, alarms_at, record
from beaver_ftc.studies.detectability.command import schemes_study
from beaver_ftc.studies.detectability.grid import GRIDS, Block, Condition, title_of
from beaver_ftc.studies.detectability.levels import level_for, rows_of
from beaver_ftc.studies.detectability.probabilities import JUDGED_S, document_of, informed_shares, summary
from beaver_ftc.studies.detectability.schemes import (
    BUILT_IN,
    ESTIMATORS,
    Watched,
    contenders,
    fly_block,
    loss,
    scenario_of,
    strikes_at_s,
)
from beaver_ftc.studies.detectability.schemes_shown import comparison, page_of
from beaver_ftc.studies.engine.study import run_study
from beaver_ftc.studies.present.page import Table
from samples import samples

STILL, LIGHT = Condition("ideal", "none"), Condition("tactical-grade", "light")
SMALL = replace(
    GRIDS["quick"],
    conditions=(STILL, LIGHT),
    surfaces=("aileron", "elevator"),
    magnitudes=(0.5, 1.0),
    excitations_deg_s=(3.0,),
    blocks=2,
    healthy_h=4 * 12.0 / 3600.0,
    healthy_flight_s=12.0,
    per_h=60.0,
)


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    folder = tmp_path_factory.mktemp("grid")
    study = schemes_study(SMALL, contenders(["observer-constant"]))
    return run_study(study, folder, 2), folder / "detectability"


class TestFlights:
    def test_part_of_a_grid_flies_the_same_flights(self):
        full = GRIDS["full"]
        part = full.only("tactical-grade", "light")
        assert part.faulted() == [block for block in full.faulted() if block.condition == LIGHT]
        assert part.healthy() == [block for block in full.healthy() if block.condition == LIGHT]
        assert full.only(None, None) == full
        with pytest.raises(BadInput, match="allowed: tactical-grade, none; tactical-grade, light"):
            GRIDS["quick"].only("ideal", None)

    def test_seeds_are_the_same_in_every_condition_and_no_healthy_one_has_a_fault(self):
        for grid in GRIDS.values():
            by_condition = {
                condition: {(b.excitation_deg_s, b.seed) for b in grid.faulted() if b.condition == condition}
                for condition in grid.conditions
            }
            assert len({frozenset(blocks) for blocks in by_condition.values()}) == 1
            seeds = {block.seed for block in grid.faulted() if block.condition == grid.conditions[0]}
            assert len(seeds) == grid.blocks * len(grid.excitations_deg_s)
            assert not seeds & {block.seed for block in grid.healthy()}
            assert {block.excitation_deg_s for block in grid.healthy()} == set(grid.excitations_deg_s)

    @settings(max_examples=samples(40))
    @given(st.integers(0, 2_000_000), st.sampled_from([1.0, 3.0, 6.0]))
    def test_the_truth_stays_within_what_is_declared(self, seed, excitation):
        scenario = scenario_of(Block(LIGHT, excitation, seed), 12.0)
        assert scenario.warnings() == ()
        frame = 100.0 * strikes_at_s(Block(LIGHT, excitation, seed))
        assert frame == pytest.approx(round(frame), abs=1e-9)
        for axis in "pqr":
            assert abs(getattr(scenario.uncertainty.inertia_coupling, axis)) <= 0.25
            (signal,) = getattr(scenario.reference, axis)
            assert signal.sine.amplitude_deg_s == excitation

    def test_a_flight_is_the_same_until_its_fault_strikes(self):
        block = Block(LIGHT, 3.0, 3)
        at_s = strikes_at_s(block)
        flights = [
            record(scenario_of(block, at_s + 1.0, [loss(surface, 1.0, at_s)])).seen
            for surface in ("aileron", "rudder")
        ]
        rates = [np.array([measured.x for measured, _ in seen]) for seen in flights]
        frames = round(at_s * 100)
        assert np.array_equal(rates[0][:frames], rates[1][:frames])
        assert not np.array_equal(rates[0], rates[1])


def healthy(*largest, flight_s=360.0):
    return [Trace(value, (), faulted=False, healthy_s=flight_s) for value in largest]


class TestLevels:
    @given(
        st.lists(st.floats(0.0, 1e6), min_size=2, max_size=40, unique=True),
        st.floats(0.0, 12.0),
    )
    def test_no_more_alarms_than_allowed_and_no_lower_level_would_do(self, largest, per_h):
        traces = healthy(*largest)
        level = level_for(traces, per_h)
        alarms, hours = alarms_at(traces, level)
        assert alarms <= per_h * hours + 1e-6
        assert alarms == sum(value > level for value in largest)
        below = [value for value in largest if value < level]
        if below:
            assert alarms_at(traces, max(below))[0] > per_h * hours - 1e-6

    def test_the_hours_end_with_the_alarm_as_in_a_sweep(self):
        """Two flights of an hour, one alarmed at the level 2 after 900 s: 1.25 h, not 2."""
        rising = Trace(3.0, (), False, 3600.0, rises=((0.0, 1.0), (900.0, 2.5), (1800.0, 3.0)))
        quiet = Trace(1.5, (), False, 3600.0, rises=((0.0, 1.5),))
        assert [rising.fault_free_s(level) for level in (0.5, 2.0, 2.7, 4.0)] == [0.0, 900.0, 1800.0, 3600.0]
        assert alarms_at([rising, quiet], 2.0) == (1, 1.25)


def watched(seed, **delays):
    """A block with one fault, a scheme a keyword: its delay at the level 2, or None."""
    traces = {
        scheme: [Trace(0.5, ((0.2, 1.5), *(((delay, 3.0),) if delay is not None else ())), True, 10.0)]
        for scheme, delay in delays.items()
    }
    return Watched(Block(STILL, 3.0, seed), (("rudder", 0.4),), traces, [[1.0, 2.0, 3.0]])


class TestCounts:
    def test_a_row_has_the_delay_at_the_common_level_and_at_the_schemes_own(self):
        levels = {(*STILL, "a"): 2.0, (*STILL, "b"): 0.4}
        found, missed = rows_of([watched(1, a=0.7, b=0.7)], levels)
        assert (found["delay_s"], found["own_delay_s"], found["false_alarm"]) == (0.7, 0.2, False)
        assert (missed["delay_s"], missed["false_alarm"], missed["own_false_alarm"]) == (None, True, False)

    def test_what_has_no_level_or_was_not_flown_by_ours_has_no_row(self):
        level = {(*STILL, "a"): 2.0}
        lost = replace(watched(1, a=0.7), deflections=[])
        assert [row["scheme"] for row in rows_of([watched(1, a=0.7, b=0.7), lost], level)] == ["a"]

    def test_the_summary_counts_flights_that_were_still_silent(self):
        rows = [
            {"delay_s": delay, "false_alarm": early, "own_delay_s": 0.1, "own_false_alarm": False}
            for delay, early in ((0.5, False), (0.9, False), (None, False), (4.0, False), (None, True))
        ]
        found = summary(rows)
        assert found["flights"] == 4
        assert [found["within"][s]["value"] for s in ("0.5", "1", "5")] == [0.25, 0.5, 0.75]
        assert found["within"]["1"]["low"] < 0.5 < found["within"]["1"]["high"]
        assert found["median_delay_s"] == 0.9
        assert summary(rows, own=True)["within"]["0.5"]["value"] == 1.0
        assert summary([rows[-1]])["flights"] == 0

    def test_the_limit_counts_a_flight_once_however_many_schemes_watched_it(self):
        levels = {(*STILL, scheme): 2.0 for scheme in "ab"}
        far = watched(2, a=0.1)
        far.deflections = [[100.0] * 3]
        found = informed_shares(rows_of([watched(1, a=0.7, b=0.7), far], levels), 36.0)
        assert found["1"] == pytest.approx(0.5 * detection_probability(2.0, 1.0, 36.0) + 0.5)

    def test_flights_of_a_seed_count_once(self):
        """Each of nine seeds brings two flights that both schemes share: nine throws of a coin, not 18."""
        ours = next(iter(BUILT_IN))
        both = [watched(seed, **{ours: 0.3, "x": None}) for seed in range(9) for _ in range(2)]
        quiet = [replace_traces(watched(1_000_000, **{ours: None, "x": None}))]
        document = document_of(SMALL, quiet, both)
        (duel,) = [
            duel for duel in document["comparison"] if (duel["ours"], duel["within_s"]) == (ours, JUDGED_S)
        ]
        assert (duel["seeds_ours"], duel["seeds_theirs"], duel["verdict"]) == (9, 0, "better")
        assert duel["p"] == pytest.approx(2 / 512)
        assert f"{ours}, faults found within 1 s, 1 comparisons: better in 1, worse in 0" in " ".join(
            comparison(document)
        )


def replace_traces(one):
    """The block as a healthy one, whose statistic comes to 2."""
    return Watched(one.block, (), {scheme: healthy(2.0) for scheme in one.traces})


class TestSurvey:
    def test_with_perfect_instruments_and_still_air_ours_finds_every_large_loss(self, survey):
        cells = [
            cell
            for cell in survey[0]["cells"]
            if (cell["sensors"], cell["scheme"], cell["magnitude"]) == ("ideal", ESTIMATORS, 1.0)
        ]
        assert [cell["within"]["1"]["value"] for cell in cells] == [1.0, 1.0]

    def test_the_table_has_the_shares_of_every_scheme(self, survey):
        document = survey[0]
        parts = page_of(document)[1]
        table = next(part for part in parts if isinstance(part, Table))
        lines = [dict(zip(table.head, cells, strict=True)) for cells in table.rows]
        assert len(lines) == 2 * 2 * (2 * len(BUILT_IN) + 1 + 1)
        for total in document["totals"]:
            air = title_of(total["sensors"], total["turbulence"])
            wanted = {"loss of": total["surface"], "flown": air, "scheme": total["scheme"]}
            (line,) = [line for line in lines if wanted.items() <= line.items()]
            shares = (f"{100 * of['value']:.0f}" for of in total["within"].values())
            assert line["found within 0.5/1/5 s, %"] == ("/".join(shares) or "-")
        assert parts[0].startswith("ideal sensors, still air, aileron, found within 5 s: both")

    def test_a_bout_flown_alone_gives_the_same(self, survey):
        document, folder = survey
        block = SMALL.faulted()[-1]
        one = fly_block((block, True), SMALL, contenders(["observer-constant"]))
        level = next(
            level["level"]
            for level in document["levels"]
            if (level["sensors"], level["turbulence"], level["scheme"]) == (*LIGHT, "observer-constant")
        )
        wanted = str(block.seed), "light", "observer-constant"
        with (folder / "detectability.csv").open() as file:
            rows = [
                row
                for row in csv.DictReader(file)
                if (row["seed"], row["turbulence"], row["scheme"]) == wanted
            ]
        delays = [trace.delay_s(level) for trace in one.traces["observer-constant"]]
        assert [row["delay_s"] for row in rows] == ["" if np.isinf(d) else str(d) for d in delays]


class Raises:
    """A plug-in that fails in flight."""

    def reset(self, context):
        pass

    def step(self, measured, command):
        raise ZeroDivisionError("no such luck")

    def __deepcopy__(self, memo):
        raise AssertionError("now the fault begins")


class TestContenders:
    def test_a_scheme_that_is_none_is_refused(self):
        for name in ("none", "augmented-ekff"):
            with pytest.raises(BadInput, match=r"--schemes: .*(allowed|did you mean)"):
                contenders([name])

    def test_a_plug_in_that_fails_is_named_and_the_others_go_on(self):
        broken = f"{__name__}:Raises"
        grid = replace(SMALL, magnitudes=(1.0,), surfaces=("elevator",))
        one = fly_block((grid.faulted()[0], True), grid, [*contenders([]), broken])
        assert set(one.traces) == set(BUILT_IN)
        assert len(one.failures) == 1
        assert one.failures[0].startswith(f"{broken}: plug-in {broken}: not registered")

    def test_no_copy_tells_a_plug_in_that_the_fault_begins(self, monkeypatch):
        monkeypatch.setattr(Raises, "step", lambda *_: Verdict())
        monkeypatch.setattr("beaver_ftc.studies.compare.replay.made", lambda *_: Raises())
        assert not fly_block((SMALL.faulted()[0], True), SMALL, [*contenders([]), "quiet"]).failures


def test_a_grid_elsewhere_is_of_another_aircraft_and_one_surface():
    there = SMALL.elsewhere("beaver-split", 40.0, None, "aileron_right")
    assert there.surfaces == ("aileron_right",)
    flight = scenario_of(Block(SMALL.conditions[0], 5.0, 7), 12.0, where=there.where)
    assert (flight.airframe.name, flight.initial.airspeed_mps) == ("beaver-split", 40.0)
    assert SMALL.elsewhere(None, None, None, None) == SMALL
    with pytest.raises(BadInput, match="--surface 'flap': allowed: aileron, elevator, rudder"):
        SMALL.elsewhere(None, None, None, "flap")
