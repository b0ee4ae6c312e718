"""The fault mismatch function against brute force, and its promises against flights."""

import shutil

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import needs
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.loop.loop import fly
from beaver_ftc.scenario.schema import load_text
from beaver_ftc.studies.detectability.certain import (
    MAGNITUDES,
    SETTLED_S,
    Excitation,
    detection_magnitude,
    excitation,
    exclusion_magnitude,
    judge,
    least_distinguished_rad,
    least_in_window,
    mismatch,
)
from beaver_ftc.studies.detectability.in_trim import alike, alike_in_words
from beaver_ftc.studies.detectability.places import at, places_study, with_aircraft
from beaver_ftc.studies.detectability.places_shown import answer
from beaver_ftc.studies.engine.study import run_study
from flying import loss, scenario
from samples import samples
from trainer import TRAINER

FAULTS = ("aileron", "elevator", "rudder")
FLIGHT = """
name: elsewhere
aircraft: ./NAME
duration_s: 8
reference:
  p: [{sine: {amplitude_deg_s: 20, frequency_hz: 0.25}}]
  q: [{sine: {amplitude_deg_s: 10, frequency_hz: 0.2}}]
  r: [{sine: {amplitude_deg_s: 10, frequency_hz: 0.3}}]
"""
moments = st.lists(st.floats(-1, 1), min_size=3, max_size=3)
bounds = st.lists(st.floats(0.01, 0.5), min_size=3, max_size=3)


def _rows(*vectors):
    return [np.array([vector]) for vector in vectors]


@settings(max_examples=samples(200))
@given(moments, moments, bounds)
def test_mismatch_is_the_least_over_every_parameter_of_the_other_fault(z, other, bound):
    shares = np.linspace(0, 1, 2001)[:, None]
    brute = np.abs((np.array(z) - shares * np.array(other)) / (2 * np.array(bound))).max(axis=1).min()
    found = mismatch(*_rows(z, other, bound))[0]
    assert found <= brute + 1e-12
    assert found == pytest.approx(brute, abs=0.05)  # the grid's step, 1/2000, over twice the smallest bound


@given(moments, moments, bounds)
def test_from_the_exclusion_magnitude_on_the_other_fault_is_excluded(z, other, bound):
    z, other, bound = _rows(z, other, bound)
    least = exclusion_magnitude(z, other, bound)[0]
    for magnitude in (0.3, 0.7, 1.0):
        certain = mismatch(magnitude * z, other, bound)[0] > 1.0
        assert certain == (magnitude >= least) or abs(magnitude - least) < 1e-4


@given(moments, bounds)
def test_no_fault_at_all_is_the_other_fault_with_no_moment(z, bound):
    z, nothing, bound = _rows(z, [0, 0, 0], bound)
    detected, excluded = detection_magnitude(z, bound)[0], exclusion_magnitude(z, nothing, bound)[0]
    assert excluded == pytest.approx(detected, rel=1e-3, abs=1e-4) or (
        detected > 0.9999 and excluded > 0.9999
    )


@pytest.fixture(scope="module")
def flight():
    return scenario(duration_s=14)


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_a_little_larger_is_found_in_time_whatever_the_uncertainty(flight, fault):
    """The map follows from the healthy flight; one with the fault must agree where it is sharpest."""
    seen = excitation(flight)
    least = least_in_window(detection_magnitude(seen.moment[fault], seen.bound), 50)
    start = int(np.argmin(least))
    struck_s, magnitude = SETTLED_S + start * seen.dt, 1.1 * least[start]
    flown = fly(flight.with_({"faults": [loss(fault, magnitude, struck_s)]}))
    assert flown.guaranteed_delay_s <= 0.5 + 1e-9
    assert flown.detection_time_s - struck_s <= 0.5 + 1e-9


def test_more_excitation_makes_smaller_faults_certain(flight):
    medians = [
        judge(excitation(at(flight, 45, 1000, scale)), "aileron")["detected_median"]
        for scale in (0.5, 1.0, 2.0)
    ]
    assert medians == sorted(medians, reverse=True)


def test_a_fault_is_its_surfaces_wherever_the_file_has_it(tmp_path):
    """Surfaces in another order: the same magnitudes under the same names."""
    folder = tmp_path / "turned"
    shutil.copytree(TRAINER, folder)
    file = folder / "aircraft.yaml"
    head, tail = file.read_text().split("surfaces:\n")
    lines = tail.splitlines(keepends=True)
    file.write_text(head + "surfaces:\n" + "".join([lines[2], lines[0], lines[1], *lines[3:]]))
    as_is = load_text(FLIGHT.replace("NAME", "trainer"), folder=TRAINER.parent)
    turned = load_text(FLIGHT.replace("NAME", "turned"), folder=tmp_path)
    assert turned.airframe.surfaces == ("rudder", "aileron", "elevator")
    one, other = excitation(as_is), excitation(turned)
    assert {fault: judge(other, fault)["detected"] for fault in FAULTS} == pytest.approx(
        {fault: judge(one, fault)["detected"] for fault in FAULTS}, rel=1e-6
    )


def test_what_cannot_be_trimmed_is_said_not_dropped(flight, tmp_path):
    document = run_study(places_study(flight, [45.0, 21.0], [1000.0], [1.0]), tmp_path)
    rows = document["points"]
    assert len(rows) == 2 * len(FAULTS)
    assert all(row["detected"] is None and row["why"] for row in rows[len(FAULTS) :])


ROW = {"airspeed_mps": 50.0, "altitude_m": 1800.0, "excitation": 2.0, "fault": "aileron", "why": "a reason"}


def test_an_answer_is_a_line_and_rounds_up():
    """3 deg/s of roll in the scenario, twice as much here; 0.301 is no longer 30 %."""
    table = {"file": "p.csv", "time_s": [0.0, 1.0], "values_deg_s": [-3.0, 1.0]}
    for flown in (scenario(), scenario(reference={"p": [{"csv": table}]})):
        assert answer(flown, ROW | {"detected": 0.301, "isolated": 0.4}) == (
            "at 50 m/s and 1800 m, 6 deg/s of roll: a loss of aileron of 31 % and more is certain to be "
            "detected within 0.5 s, isolated within 1 s from 40 % on"
        )


def test_what_a_line_promises_holds_in_flight(flight):
    """At a place of its own, at the size it says, wherever in the reference's period the loss strikes."""
    here = at(flight, 50.0, 1800.0, 1.0)
    row = {"airspeed_mps": 50.0, "altitude_m": 1800.0, "excitation": 1.0, "fault": "aileron"}
    row |= judge(excitation(here), "aileron")
    size = int(answer(here, row).partition("aileron of ")[2].partition(" %")[0]) / 100.0
    for struck_s in (4.0, 5.0, 6.0, 7.0, 8.0):
        flown = fly(here.with_({"faults": [loss("aileron", size, struck_s)]}))
        assert flown.detection_time_s - struck_s <= 0.5 + 1e-9


def test_a_place_keeps_the_declared_errors_of_the_servos():
    declared = scenario().with_({"fdi.bounds.actuators.bandwidth": 0.2})
    assert at(declared, 50.0, 1800.0, 1.0).fdi.bounds.actuators == declared.fdi.bounds.actuators


@needs.service("derive")
def test_another_aircraft_has_its_own_errors():
    """One of plain JSBSim has no property for the errors of the Beaver's truth."""
    coupled = scenario(duration_s=2.5).with_({"uncertainty.inertia_coupling.p": 0.2})
    assert set(excitation(with_aircraft(coupled, "jsbsim:c172p")).moment) == {"aileron", "elevator", "rudder"}


@settings(max_examples=samples(100))
@given(moments, moments, bounds)
def test_what_is_told_apart_no_deflection_of_the_other_explains(column, other, bound):
    """By brute force over deflections of the other: below the least one some explains it, above it none."""
    column, other, bound = map(np.array, (column, other, bound))
    if np.abs(column).max() < 0.05 or np.abs(other).max() < 0.05:
        return
    least = min(least_distinguished_rad(column, other, bound), 1e3)
    tried = np.linspace(-60.0, 60.0, 24001)[:, None]

    def unexplained(rad):
        return np.abs((column * rad - tried * other) / (2.0 * bound)).max(axis=1).min()

    if least < 10.0 and np.abs(column).max() * least / np.abs(other).max() < 50.0:
        assert unexplained(1.02 * least) > 1.0
        assert unexplained(0.9 * least) < 1.0


def test_the_rates_never_tell_elevator_from_flap_and_accelerometers_do():
    (pair,) = alike(scenario())
    assert pair["surfaces"] == ("elevator", "flap")
    assert alike_in_words([pair]) == [
        "elevator and flap have similar effects on the rates: "
        "the rates never distinguish them, accelerometers do"
    ]


def test_halves_of_an_aileron_are_told_apart_by_their_pitch():
    """Each pitches 3.7 % of what it rolls, the other way: the bound in pitch, 0.02 rad/s2, hides 8 deg."""
    pairs = {pair["surfaces"]: pair for pair in alike(with_aircraft(scenario(), "beaver-split"))}
    told = pairs["aileron_left", "aileron_right"]["told_apart_from_deg"]
    assert told["aileron_left"] == pytest.approx(8.8, abs=1.0)
    assert told["aileron_right"] == pytest.approx(told["aileron_left"], rel=0.02)
    assert ("elevator", "flap_left") not in pairs


def still(n=60, **moments):
    """Moments that do not change, at ten frames a second."""
    of = {name: np.tile(np.array(z, float), (n, 1)) for name, z in moments.items()}
    return Excitation(of, np.full((n, 3), 0.5), 0.1)


def test_magnitudes_of_moments_that_do_not_change():
    """Twice the bound is 1: roll alone tells the aileron, which the rudder's half explains in part."""
    seen = still(aileron=[4.0, 0.0, 0.0], rudder=[2.0, 0.0, 1.6])
    found = judge(seen, "aileron")
    assert found["detected"] == found["detected_median"] == pytest.approx(0.25)
    # the rudder by a share b leaves 4 m - 2 b of roll and 1.6 b of yaw: b = 0.625 hides all up to m = 0.5625
    assert found["isolated"] == found["isolated_median"] == pytest.approx(0.5625, abs=1e-4)
    assert (found["confused_with"], found["why"]) == ("rudder", "a fault of rudder explains smaller losses")
    rudder = judge(seen, "rudder")
    assert rudder["detected"] == pytest.approx(0.5)
    # the aileron explains all roll: yaw alone tells, from 1 / 1.6
    assert rudder["isolated"] == pytest.approx(0.625, abs=1e-4)
    easy = judge(still(aileron=[4.0, 0.0, 0.0], rudder=[0.0, 0.0, 1.6]), "aileron")
    assert (easy["isolated"], easy["why"]) == (pytest.approx(0.25, abs=1e-4), "isolated as soon as detected")


def test_a_surface_that_is_hardly_used_and_one_that_another_explains():
    seen = still(aileron=[0.8, 0.0, 0.0], rudder=[2.0, 0.0, 0.5], elevator=[0.0, 3.0, 0.0])
    weak = judge(seen, "aileron")
    hidden = judge(still(aileron=[2.0, 0.0, 0.0], rudder=[2.2, 0.0, 0.5]), "aileron")
    assert [weak[name] for name in MAGNITUDES] == [None] * 4
    assert (
        weak["why"]
        == "aileron barely moves: within 0.5 s even a total loss reaches only 80 % of the detection limit"
    )
    assert (hidden["detected"], hidden["isolated"]) == (0.5, None)
    # 2 - 2.2 b and 0.5 b are equal at b = 0.74: what is left is 0.37
    assert hidden["why"] == (
        "a fault of rudder explains even a total loss: within 1 s the difference reaches only 37 % of the "
        "detection limit"
    )
    assert judge(seen, "elevator")["isolated"] == pytest.approx(1 / 3, abs=1e-4)


def test_half_of_the_instants_and_the_worst_of_them():
    """Used from the sixth frame on, more and more: a fault is to be found in some frames from its start."""
    z = np.zeros((25, 3))
    z[5:, 0] = np.linspace(2.0, 3.9, 20)
    rare = judge(Excitation({"aileron": np.vstack((np.zeros((35, 3)), z)), "rudder": np.zeros((60, 3))},
                            np.full((60, 3), 0.5), 0.1), "aileron")  # fmt: skip
    assert (rare["detected"], rare["detected_median"]) == (None, None)
    found = judge(
        Excitation({"aileron": z, "rudder": np.zeros((25, 3))}, np.full((25, 3), 0.5), 0.1), "aileron"
    )
    assert found["detected"] is found["isolated"] is None  # from the first instant five frames of nothing
    # of 21 instants the first finds nothing, the others 2.0, 2.1, ... 3.9: the eleventh from above is 2.9
    assert found["detected_median"] == pytest.approx(1 / 2.9)
    # of 16 the eighth, from 3.4 down: what excludes has ten frames, and more to see in the last
    assert found["isolated_median"] == pytest.approx(1 / 2.7)


@pytest.mark.parametrize(
    "fdi",
    [
        {"scheme": "none"}, {"thresholds": "published"}, {"pole_bank_per_s": [1.0, 9e5]},
        *({"sharpen": {name: False}} for name in ("memory", "pole_bank", "shared_effectiveness")),
    ],
)  # fmt: skip
def test_it_is_worked_out_for_one_scheme(fdi):
    with pytest.raises(BadInput, match="detectability is worked out for the sharpened scheme"):
        places_study(scenario(fdi=fdi))
