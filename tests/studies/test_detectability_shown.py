"""What the detectability survey says and draws of rows made by hand; known moments; one flight."""

import base64
import json
import re
from itertools import permutations
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.schema import load_text
from beaver_ftc.studies import detectability, isolability
from beaver_ftc.studies.detectability import (
    ALTITUDES_M,
    FILES,
    MAGNITUDES,
    Excitation,
    at,
    detection_magnitude,
    document_of,
    draw,
    excitation,
    exclusion_magnitude,
    judge,
    mismatch,
    run_survey,
    survey_name,
    text,
)
from beaver_ftc.studies.isolability import DOUBLET_COLUMNS, LOSS_COLUMNS
from beaver_ftc.studies.present.page import contents, write_files
from flying import loss, scenario
from kept import in_short, picture
from telling import numbers

AIRCRAFT = Path(__file__).parents[1] / "data" / "aircraft"


def rows_made():
    rows = []
    for i, fault in enumerate(("aileron", "elevator")):
        for j, (V, h, scale) in enumerate(
            (V, h, s) for V in (38.0, 45.5) for h in (0.0, 1000.0) for s in (0.5, 2.0)
        ):
            found = [0.1 + (i + 2 * j) / 30, 0.05 + j / 40, 0.3 + j / 20, 0.25 + i / 10]
            least = [None if (i + j) % 5 == k else m for k, m in enumerate(found)]
            place = {"airspeed_mps": V, "altitude_m": h, "excitation": scale, "fault": fault}
            why = f"for the reason {i}{j}"
            rows.append(
                {**place, **dict(zip(MAGNITUDES, least, strict=True)), "confused_with": None, "why": why}
            )
    return rows


def pairs_made():
    """Of two places and three excitations: always at one place, never by a doublet at the other."""
    found = []
    for fault, other in (("aileron", "elevator"), ("elevator", "aileron")):
        for j, (V, scale) in enumerate((V, s) for V in (38.0, 45.5) for s in (0.5, 1.0, 2.0)):
            seen = None if j == 4 else 0.3 + j / 10, 0.2 + j / 20, None if j == 4 else 0.4, 0.1
            told = (None, None, "no travel") if V == 45.5 and scale == 2.0 else (1.25 + j, 0.03, "")
            place = {
                "airspeed_mps": V,
                "altitude_m": 0.0,
                "excitation": scale,
                "fault": fault,
                "other": other,
            }
            values = dict(zip((*LOSS_COLUMNS, *DOUBLET_COLUMNS), (*seen, *told), strict=True))
            found.append(place | values)
    return found


def test_the_map_of_isolability_as_it_is_shown(changed):
    assert not changed(text(rows_made()[:1], pairs_made()).splitlines(), "text")
    figure = isolability.draw("made", pairs_made())
    assert not changed(picture(figure), "figure")


def test_the_survey_as_it_is_shown(changed, tmp_path):
    rows = rows_made()
    assert not changed(text(rows).splitlines(), "text")
    figure = draw("made", rows)
    assert not changed(picture(figure), "figure")
    pairs = pairs_made()
    parts = {"points": rows[:8], "pairs": pairs[:6]}, {"points": rows[8:], "pairs": pairs[6:]}
    document = document_of("made", parts)
    files = contents(FILES, document)
    assert not changed(files["detectability.csv"].splitlines(), "csv")
    assert json.loads(files["detectability.json"]) == {
        "scenario": "made", "detect_within_s": 0.5, "isolate_within_s": 1.0, "points": rows, "pairs": pairs
    }  # fmt: skip
    assert list(files) == [f"{name}.{kind}" for name, kind in (
        ("detectability", "json"), ("detectability", "csv"), ("isolability", "csv"), ("detectability", "png"),
        ("isolability", "png"), ("detectability", "html"),
    )]  # fmt: skip
    write_files(tmp_path, files)
    page = re.sub(r"base64,[^\"]*", "", (tmp_path / "detectability.html").read_text())
    assert not changed(page.partition("<body>")[2].splitlines(), "page")
    none = [row | dict.fromkeys(MAGNITUDES) for row in rows[:1]]
    assert not changed(text(none).splitlines(), "none")


def test_what_is_weighed_along_a_flight(changed):
    """Without its faults, from two seconds on, at the frame rate of the scenario."""
    flown = scenario(duration_s=3, rate_hz=50, faults=[loss("elevator", 1.0, 0.5)])
    seen = excitation(flown)
    assert seen.dt == 0.02
    assert {of.shape for of in (*seen.moment.values(), seen.bound)} == {(50, 3)}
    assert not changed({"moment": {s: [in_short(axis) for axis in of.T] for s, of in seen.moment.items()},
          "bound": [in_short(axis) for axis in seen.bound.T]})  # fmt: skip
    assert not changed({fault: judge(seen, fault) for fault in seen.moment}, "judged")


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
    weak, hidden = (
        judge(seen, "aileron"),
        judge(still(aileron=[2.0, 0.0, 0.0], rudder=[2.2, 0.0, 0.5]), "aileron"),
    )
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


def test_of_faults_that_hide_a_total_loss_as_well_the_one_that_does_so_more_often_is_named():
    """The elevator moves for 10 frames, the rudder for 15: of 11 windows of ten frames these explain all of
    the aileron's loss in one and in six. Of its 2.0 the rudder leaves 0.5, in two frames 0.8."""
    z = np.zeros((20, 3))
    aileron, elevator, rudder = z.copy(), z.copy(), z.copy()
    aileron[:, 0], elevator[:10, 0], rudder[:15, 0] = 2.0, 1.9, 1.5
    rudder[[3, 8], 0] = 1.2
    moments = {"aileron": aileron, "elevator": elevator, "rudder": rudder}
    found = judge(Excitation(moments, np.full((20, 3), 0.5), 0.1), "aileron")
    assert (found["isolated"], found["confused_with"]) == (None, "rudder")
    assert found["isolated_median"] is None
    assert found["why"] == (
        "a fault of rudder explains even a total loss: within 1 s the difference reaches only 80 % of the "
        "detection limit"
    )


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
    assert (found["detected"], found["isolated"]) == (
        None,
        None,
    )  # from the first instant five frames of nothing
    # of 21 instants the first finds nothing, the others 2.0, 2.1, ... 3.9: the eleventh from above is 2.9
    assert found["detected_median"] == pytest.approx(1 / 2.9)
    # of 16 the eighth, from 3.4 down: what excludes has ten frames, and more to see in the last
    assert found["isolated_median"] == pytest.approx(1 / 2.7)


def test_a_flight_too_short_to_isolate_in():
    seen = still(n=9, aileron=[4.0, 0.0, 0.0], rudder=[0.0, 0.0, 2.0])
    assert judge(seen, "aileron")["why"] == "the flight ends before a fault could be isolated"
    assert (
        judge(still(n=10, aileron=[4.0, 0.0, 0.0], rudder=[0.0, 0.0, 2.0]), "aileron")["isolated"] is not None
    )


def test_where_not_even_one_is_enough():
    z, bound = np.array([[0.9, 0.0, 0.0], [1.0, 0.0, 0.0], [1.1, 0.0, 0.0]]), np.full((3, 3), 0.5)
    nothing = np.zeros((3, 3))
    np.testing.assert_allclose(detection_magnitude(z, bound), [1 / 0.9, 1.0, 1 / 1.1])
    np.testing.assert_allclose(exclusion_magnitude(z, nothing, bound), [np.inf, np.inf, 1 / 1.1], atol=2**-16)
    np.testing.assert_allclose(mismatch(z, nothing, bound), [0.9, 1.0, 1.1])
    assert detection_magnitude(np.zeros((1, 3)), np.ones((1, 3))) == [np.inf]


def test_elsewhere_only_the_place_and_the_references_change():
    given = scenario(
        reference={
            "p": [{"sine": {"amplitude_deg_s": 3, "frequency_hz": 0.25}}],
            "q": [{"csv": {"file": "q.csv", "time_s": [0, 1, 2], "values_deg_s": [0, 2, -1]}}],
        },
        faults=[loss("elevator", 0.5, 1.0)],
        expect={"no_departure": True},
    )
    found = at(given, 40.0, 250.0, 0.5)
    assert (found.initial.airspeed_mps, found.initial.altitude_m) == (40.0, 250.0)
    before, after = (one.model_dump(mode="json") for one in (given, found))
    assert after["reference"]["p"][0]["sine"]["amplitude_deg_s"] == 1.5
    assert after["reference"]["p"][0]["sine"]["frequency_hz"] == 0.25
    assert after["reference"]["q"][0]["csv"]["values_deg_s"] == [0, 1, -0.5]
    assert (found.faults, found.expect.model_dump(exclude_none=True)) == ((), {})
    same = before.keys() - {"initial", "reference", "faults", "expect"}
    assert {key: after[key] for key in same} == {key: before[key] for key in same}


def test_a_flight_is_weighed_from_where_it_has_settled(monkeypatch):
    """Without its faults; two seconds are 40 frames of this one."""
    flown, n = [], 55
    given = scenario(duration_s=3, rate_hz=20, faults=[loss("elevator", 1.0, 0.5)])
    moment = {name: numbers(n, 3, seed=k) for k, name in enumerate(("aileron", "rudder"))}
    bound, G = np.abs(numbers(n, 3, seed=5)), numbers(n, 3, 4, seed=6)
    monkeypatch.setattr(detectability, "fly", lambda healthy, log: flown.append((healthy, log)))
    monkeypatch.setattr(
        detectability, "moments_of", lambda of, log: flown.append((of, log)) or (moment, bound, G)
    )
    seen = excitation(given)
    (healthy, log), (of, weighed) = flown
    assert healthy == given.model_copy(update={"faults": ()}) != given
    assert (of, weighed is log) == (given, True)
    np.testing.assert_array_equal(seen.moment["aileron"], moment["aileron"][40:])
    np.testing.assert_array_equal(seen.moment["rudder"], moment["rudder"][40:])
    np.testing.assert_array_equal(seen.bound, bound[40:])
    np.testing.assert_array_equal(seen.G, G[40])
    assert (list(seen.moment), seen.dt) == (["aileron", "rudder"], 0.05)


def alone(flown, **airframe):
    """A scenario of an aircraft made up of this; flown: what is flown of it instead."""
    made = SimpleNamespace(name="made", airframe=SimpleNamespace(**airframe))
    made.model_copy = lambda update: flown.append(update) or made
    return made


def test_pairs_are_alike_from_the_deflection_that_tells_the_one_that_is_harder_to_tell(monkeypatch):
    """Over twice the bound the columns are (20, 0, 1), (0, -25, 0), (10, 0, 2) and (0, -7.5, 0). The aileron
    is told from the rudder by 2.5 per rad at 1.75 of the rudder, the rudder by 10/7 at 4/7 of the aileron."""
    G = np.array([[4.0, 0.0, 2.0, 0.0], [0.0, -10.0, 0.0, -3.0], [0.5, 0.0, 1.0, 0.0]])
    bound = np.array([[0.1, 0.2, 0.25], [7.0, 7.0, 7.0]])
    monkeypatch.setattr(detectability, "excitation", lambda of: Excitation({}, bound, 0.01, G))
    surfaces, flown = ("aileron", "elevator", "rudder", "flap"), []
    by_force = {"CY": (0, 2, 3), "CZ": (1, 3)}.__getitem__
    found = detectability.alike(alone(flown, n=4, surfaces=surfaces, separated_by_force=by_force))
    aileron, elevator, rudder, flap = (np.degrees(1.0 / size) for size in (20.0, 25.0, 10.0, 7.5))
    assert flown == [{"duration_s": 3.0}]
    assert [(pair["surfaces"], pair["by_forces"]) for pair in found] == [
        (("aileron", "rudder"), True), (("aileron", "flap"), True), (("elevator", "rudder"), False),
        (("elevator", "flap"), True), (("rudder", "flap"), True),
    ]  # fmt: skip
    told = [pair["told_apart_from_deg"] for pair in found]
    assert told[0] == pytest.approx({"aileron": np.degrees(0.4), "rudder": np.degrees(0.7)})
    assert told[1] == pytest.approx({"aileron": aileron, "flap": flap})
    assert told[2] == pytest.approx({"elevator": elevator, "rudder": rudder})
    assert told[3] == {"elevator": None, "flap": None}
    lines = detectability.geometry([*found[:1], *found[3:4], {**found[3], "by_forces": False}])
    both = "have similar effects on the rates: the rates"
    assert lines == [
        f"aileron and rudder {both} distinguish them if aileron is at least 23 deg off its command or rudder "
        "is at least 40 deg off its command",
        f"elevator and flap {both} never distinguish them, accelerometers do",
        f"elevator and flap {both} never distinguish them",
    ]


@pytest.mark.parametrize(
    ("signals", "error_map", "known", "held"),
    [
        (("dpt", "yaw_by_engines_m_s2"), SimpleNamespace(knows_engines=True), True, True),
        (("yaw_by_engines_m_s2",), SimpleNamespace(knows_engines=False), True, False),
        (("yaw_by_engines_m_s2",), None, True, False),
        (("dpt",), SimpleNamespace(knows_engines=True), False, False),
    ],
)
def test_an_engine_at_idle_takes_the_thrust_that_it_has_in_trim(monkeypatch, signals, error_map, known, held):
    """At 45 m/s, between 40 and 60, all thrust is 90, 275 and 650 N at the settings 0, 0.5 and 1: 350 N at
    0.6, which give 0.35 m/s2 to 1000 kg. Twice the bound is 0.04, 0.06 and 0.1 rad/s2."""
    flown, released = [], []
    thrust = SimpleNamespace(
        airspeed_mps=(40.0, 60.0), setting=(0.0, 0.5, 1.0), force_n=((100, 300, 700), (60, 200, 500))
    )  # fmt: skip
    made = alone(
        flown, engine=SimpleNamespace(thrust=thrust), mass=SimpleNamespace(mass_kg=1000.0), signals=signals,
        effectors=("left", "right"),
        file=SimpleNamespace(power_setting=("throttle", "mixture"), model_error_map=error_map),
    )  # fmt: skip
    trim = SimpleNamespace(settings={"throttle": 0.6, "mixture": 0.9}, airspeed_mps=45.0)
    bound = np.array([[0.02, 0.03, 0.05], [9.0, 9.0, 9.0]])
    effects = np.array([[0.01, -0.02], [0.0, 0.004], [-0.5, 0.6]])
    monkeypatch.setattr(detectability, "ENGINE_SIGNALS", ("other_m_s2", "yaw_by_engines_m_s2"))
    monkeypatch.setattr(detectability.Declared, "of", lambda of: of)
    monkeypatch.setattr(detectability, "effects_of_engines", lambda of: effects)
    monkeypatch.setattr(detectability, "excitation", lambda of: Excitation({}, bound, 0.01))
    loop = SimpleNamespace(trim=trim, release=lambda: released.append(True))
    monkeypatch.setattr(detectability, "Loop", lambda of: loop)
    left, right = detectability.engine_failures(made)
    assert flown == [{"duration_s": 3.0, "faults": ()}]
    assert released == [True]
    for found, name, turns, shows in (
        (left, "left", [0.0035, 0.0, 0.175], 1.75), (right, "right", [0.007, 0.0014, 0.21], 2.1),
    ):  # fmt: skip
        assert found.pop("turns_rad_s2") == pytest.approx(turns)
        assert found.pop("shows") == pytest.approx(shows)
        assert found == {"engine": name, "known": known, "held": held}


def test_columns_that_are_nearly_parallel_are_told_by_what_little_is_left():
    """Over twice the bound (2, 0, 0) and (3, 0, 0.0006). Of the first so much of the second is left that roll
    and yaw miss alike: 2 - 3 t and 0.0006 t. Of the second no roll need be left."""
    bound = np.full(3, 0.5)
    one, other = np.array([2.0, 0.0, 0.0]), np.array([3.0, 0.0, 0.0006])
    told = detectability.least_distinguished_rad
    assert told(one, other, bound) == pytest.approx(3.0006 / (2.0 * 0.0006))
    assert told(other, one, bound) == pytest.approx(1.0 / 0.0006)
    assert told(one, 1.5 * one, bound) == np.inf


def test_an_engine_is_said_with_what_the_design_model_knows_of_it():
    of = {"engine": "left", "turns_rad_s2": [0.0035, 0.2, 0.175], "shows": 0.756}
    failed = (
        "left failed to idle accelerates the aircraft by 0.2 rad/s2, 0.76 times the detection limit of one"
    )
    known = f"{failed} frame; the design model knows its moment"
    said = [{**of, "known": known, "held": held} for known, held in ((0, 0), (1, 0), (1, 1))]
    assert detectability.of_engines(said) == [
        f"{failed} frame", known, f"{known} and monitors it against the thrust"
    ]  # fmt: skip


def test_answers_are_of_the_axis_that_the_surface_leads():
    """All amplitudes of its references together; a reference from a file has none."""
    given = scenario(reference={
        "q": [{"sine": {"amplitude_deg_s": 1.25, "frequency_hz": 0.2}},
              {"doublet": {"amplitude_deg_s": 2.0, "start_s": 1.0, "width_s": 0.5}}],
        "r": [{"csv": {"file": "r.csv", "time_s": [0, 1], "values_deg_s": [0, 2]}}],
    })  # fmt: skip
    place = {"airspeed_mps": 41.5, "altitude_m": 250.0, "excitation": 2.0, "detected": 0.5, "isolated": 0.07}
    said = detectability.answers(given, [place | {"fault": fault} for fault in ("rudder", "elevator")])
    assert [line.partition(" a loss")[0] for line in said] == [
        "at 41.5 m/s and 250 m, 0 deg/s of yaw:",
        "at 41.5 m/s and 250 m, 6.5 deg/s of pitch:",
    ]
    assert all("of 50 % and more" in line and line.endswith("from 7 % on") for line in said)


def test_another_aircraft_flies_the_same_references_and_nothing_else_of_the_first_ones_truth():
    given = scenario(
        duration_s=7, seed=9, initial={"airspeed_mps": 40.0}, actuators="servo", sensors="tactical-grade",
        faults=[loss("elevator", 0.5, 1.0)], expect={"no_departure": True},
    )  # fmt: skip
    found = detectability.with_aircraft(given, "beaver-split")
    other = scenario(
        aircraft="beaver-split", duration_s=7, seed=9, sensors="tactical-grade", uncertainty={},
        control=given.control.model_dump(exclude_unset=True),
    )  # fmt: skip
    assert found.model_dump(exclude={"aircraft"}) == other.model_dump(exclude={"aircraft"})
    assert found.airframe.name == "beaver-split"


def test_a_point_has_what_its_flight_shows_and_the_doublets_of_straight_flight(monkeypatch):
    """A row a fault, and a row a pair with its own doublet; flown and asked for where the point is."""
    asked = []
    seen = still(aileron=[4.0, 0.0, 0.0], rudder=[2.0, 0.0, 1.6])
    monkeypatch.setattr(detectability, "excitation", lambda of: asked.append(of) or seen)

    def doublets(of, after_s):
        asked.append((of, after_s))
        return {(a, b): {"doublet_deg": len(a), "doublet_s": len(b), "why": a} for a, b in PAIRED}

    PAIRED = [("aileron", "rudder"), ("rudder", "aileron")]
    monkeypatch.setattr(isolability, "smallest_doublets", doublets)
    given = scenario()
    found = detectability._point(given, (40.0, 250.0, 1.5))
    there, (straight, after_s) = asked
    assert (there, straight, after_s) == (at(given, 40.0, 250.0, 1.5), at(given, 40.0, 250.0, 0.0), 2.0)
    place = {"airspeed_mps": 40.0, "altitude_m": 250.0, "excitation": 1.5}
    assert found["points"] == [place | {"fault": s} | judge(seen, s) for s in ("aileron", "rudder")]
    first, second = found["pairs"]
    assert first == place | {
        "fault": "aileron", "other": "rudder", "magnitude": pytest.approx(0.5625, abs=1e-4),
        "magnitude_median": pytest.approx(0.5625, abs=1e-4), "longest_s": 0.1, "median_s": 0.1,
        "doublet_deg": 7, "doublet_s": 6, "why": "aileron",
    }  # fmt: skip
    assert (second["fault"], second["other"], second["doublet_deg"], second["why"]) == (
        "rudder", "aileron", 6, "rudder"
    )  # fmt: skip


@pytest.fixture
def pointed(monkeypatch):
    """The points a survey flies, none of them flown."""
    seen = []
    monkeypatch.setattr(
        detectability, "_point", lambda given, point: seen.append(point) or {"points": [], "pairs": []}
    )
    monkeypatch.setattr(detectability, "FILES", {})
    return seen


def test_the_points_of_the_built_in_aircraft_and_those_asked_for(pointed, tmp_path):
    document = run_survey(tmp_path, scenario())
    speeds_mps, altitudes_m = (36.0, 40.0, 44.0, 48.0, 52.0), (0.0, 1000.0, 2000.0, 3000.0)
    assert pointed == [(V, h, s) for V in speeds_mps for h in altitudes_m for s in (0.25, 0.5, 1.0, 2.0)]
    assert document["scenario"] == scenario().name
    pointed.clear()
    run_survey(tmp_path, scenario(), [40.0], [5.0], [1.5])
    assert pointed == [(40.0, 5.0, 1.5)]


def test_the_points_of_another_aircraft_are_about_its_start(pointed, tmp_path, monkeypatch):
    given = load_text("name: elsewhere\naircraft: ./trainer\n", folder=AIRCRAFT)
    monkeypatch.setattr(type(given.airframe), "usual_airspeed_mps", 33.37)
    run_survey(tmp_path, given)
    start_m = given.airframe.file.start.altitude_m
    expected = ALTITUDES_M if start_m is None else (start_m,)
    assert [point[0] for point in pointed[:: 4 * len(expected)]] == [30.0, 33.4, 36.7]
    assert list(dict.fromkeys(point[1] for point in pointed)) == list(expected)


def test_a_point_that_cannot_be_flown_says_so_of_every_surface(monkeypatch):
    def untrimmed(given):
        raise BadInput("no trim")

    monkeypatch.setattr(detectability, "excitation", untrimmed)
    found = detectability._point(scenario(), (40.0, 5.0, 1.5))
    nothing = dict.fromkeys((*MAGNITUDES, "confused_with")) | {"why": "no trim"}
    place = {"airspeed_mps": 40.0, "altitude_m": 5.0, "excitation": 1.5}
    assert found["points"] == [{**place, "fault": s, **nothing} for s in ("aileron", "elevator", "rudder")]
    assert {(row["fault"], row["other"]) for row in found["pairs"]} == {
        *permutations(scenario().airframe.class_of_losses, 2)
    }
    nothing = dict.fromkeys((*LOSS_COLUMNS, *DOUBLET_COLUMNS)) | {"why": "no trim"}
    assert all(row | place | nothing == row for row in found["pairs"])


@pytest.mark.parametrize(
    ("fdi", "refused"),
    [
        ({}, False), ({"scheme": "none"}, True), ({"sharpen": {"memory": False}}, True),
        ({"sharpen": {"pole_bank": False}}, True), ({"sharpen": {"shared_effectiveness": False}}, True),
        ({"pole_bank_per_s": [1.0, 9e5]}, True), ({"pole_bank_per_s": [1.0, 1e6]}, False),
    ],
)  # fmt: skip
def test_it_is_worked_out_for_one_scheme(fdi, refused, pointed, tmp_path):
    given = scenario(fdi=fdi)
    if not refused:
        assert run_survey(tmp_path, given, [40.0], [0.0], [1.0])["points"] == []
        return
    with pytest.raises(BadInput, match="detectability is worked out for the sharpened scheme"):
        run_survey(tmp_path, given, [40.0], [0.0], [1.0])


def test_another_scenario_of_the_name_is_another_survey(monkeypatch, tmp_path):
    seen = []
    monkeypatch.setattr(detectability, "run_study", lambda study, out, progress: seen.append(study))
    for given in (scenario(), scenario(duration_s=7)):
        run_survey(tmp_path, given, [40.0], [0.0], [1.0])
        assert seen[-1].follows_from == given
        assert seen[-1].fly.args == (given,)
    assert seen[0].name == seen[1].name == "test-detectability"


def test_the_conclusions_are_of_the_references_nearest_to_the_scenarios_own():
    """Of a scale of 0.25, 1.25 and 4 the middle one; the largest loss that it takes anywhere."""
    rows = [
        {"fault": "flap", "excitation": scale, "isolated": isolated, "detected": 0.1, "why": "w"}
        for scale, sizes in ((0.25, (0.9, 0.8)), (1.25, (0.301, 0.4)), (4.0, (0.1, None)))
        for isolated in sizes
    ]
    says = "loss of {} or more is certain to be detected and isolated at"
    assert detectability._conclusions(rows) == [
        f"flap: at 1.25 times the scenario's references a {says.format('40 %')} all 2 places."
    ]
    assert detectability._conclusions(rows[4:]) == [
        f"flap: at 4 times the scenario's references a {says.format('10 %')} 1 of 2 places."
    ]
    none = [
        {"fault": "flap", "excitation": 1.0, "isolated": None, "detected": detected, "why": why}
        for detected, why in ((0.2, "a"), (None, "c"), (None, "b"))
    ]
    assert detectability._conclusions(none) == [
        "flap: at the scenario's references no loss is certain to be detected and isolated (b)."
    ]


def test_the_name_of_a_survey_is_no_longer_than_a_folders_may_be():
    given = scenario()
    assert survey_name(given) == f"{given.name}-detectability"
    long = given.model_copy(update={"name": "x" * 90})
    assert survey_name(long) == "x" * 86 + "-detectability"


def test_the_command_surveys_what_was_asked_and_shows_one_surface_or_all(monkeypatch, tmp_path):
    """Of the survey's document every row, or those of one surface with its answers."""
    parts = {part: [{"fault": s, "n": n} for n, s in enumerate(("aileron", "elevator", "rudder"))]
             for part in detectability.PARTS}  # fmt: skip
    asked, progress = [], []
    monkeypatch.setattr(
        detectability, "run_survey",
        lambda *given, progress: asked.append((*given, progress)) or {"scenario": "made", **parts},
    )  # fmt: skip
    monkeypatch.setattr(detectability, "alike", lambda of: [f"alike {of.airframe.name}"])
    monkeypatch.setattr(
        detectability, "engine_failures", lambda of: ["left"] if of.airframe.name == "beaver-split" else []
    )
    monkeypatch.setattr(detectability, "answers", lambda of, rows: [f"{of.name} {len(rows)}"])
    told = SimpleNamespace(progress=progress.append)

    def found(**options):
        return detectability.Detectability("fault-free", out=tmp_path, **options).run(told)

    folder = str(tmp_path / "fault-free-detectability")
    assert found() == {"scenario": "made", **parts, "alike": ["alike beaver"], "folder": folder}
    other = found(aircraft="beaver-split", airspeed=(41.0,), altitude=(900.0, 70.0))
    assert (other["engines"], other["alike"]) == (["left"], ["alike beaver-split"])
    rudder = {part: [{"fault": "rudder", "n": 2}] for part in parts}
    assert found(surface="rudder") == {
        "scenario": "made",
        **rudder,
        "answers": ["fault-free 1"],
        "folder": folder,
    }
    assert [(out, of.airframe.name, *places) for out, of, *places, _ in asked] == [
        (tmp_path, "beaver", (), ()), (tmp_path, "beaver-split", (41.0,), (900.0, 70.0)),
        (tmp_path, "beaver", (), ()),
    ]  # fmt: skip
    assert asked[0][-1] == progress.append
    with pytest.raises(BadInput, match=r"^--surface 'flap': allowed: aileron, elevator, rudder$"):
        found(surface="flap")


def test_the_summary_counts_places_and_spans_the_magnitudes():
    """In no order of size; of the fault and excitation of the line alone."""
    found = [("flap", 0.5, 0.4, 0.35), ("flap", 0.5, 0.7, None), ("flap", 2.0, 0.1, 0.05),
             ("flap", 0.5, None, 0.2), ("flap", 0.5, 0.3, 0.25), ("rudder", 0.5, None, 0.9)]  # fmt: skip
    keys = ("fault", "excitation", "isolated", "isolated_median")
    rows = [dict(zip(keys, values, strict=True)) for values in found]
    assert detectability._summary(rows) == [
        ("flap", "0.5", "3 of 4", "0.30 - 0.70", "3 of 4", "0.20 - 0.35"),
        ("flap", "2", "1 of 1", "0.10 - 0.10", "1 of 1", "0.05 - 0.05"),
        ("rudder", "0.5", "0 of 1", "-", "1 of 1", "0.90 - 0.90"),
        ("rudder", "2", "0 of 0", "-", "0 of 0", "-"),
    ]


def test_the_answers_or_tables_with_what_is_alike_and_the_engines(monkeypatch):
    monkeypatch.setattr(detectability, "text", lambda *of: f"text of {of}")
    monkeypatch.setattr(detectability, "geometry", lambda alike: [f"geometry of {alike}"])
    command = detectability.Detectability("fault-free")
    document = {"points": [1], "pairs": [2], "alike": 3, "folder": "folder"}
    shown = ["text of ([1], [2])", "geometry of 3"]
    assert command.as_text(document, False).splitlines() == [*shown, "folder"]
    engine = {"engine": "left", "turns_rad_s2": [0.1, 0.25, 0.2], "shows": 3.14, "known": True, "held": False}
    says = (
        "left failed to idle accelerates the aircraft by 0.25 rad/s2, 3.1 times the detection limit of one "
        "frame; the design model knows its moment"
    )
    assert command.as_text(document | {"engines": [engine]}, False).splitlines() == [*shown, says, "folder"]
    answered = command.as_text(document | {"answers": ["one", "two"]}, False)
    assert answered == "\n".join(["one", "two", detectability.POINTER])


def test_the_page_shows_each_map_under_its_own_words(tmp_path):
    """Not twice the same: each picture is the file of its name."""
    parts = {"points": rows_made(), "pairs": pairs_made()}
    write_files(tmp_path, contents(FILES, document_of("made", (parts,))))
    page = (tmp_path / "detectability.html").read_text()
    shown = re.findall(r'alt="([^"]*)" src="data:image/png;base64,([^"]*)"', page)
    files = [(tmp_path / f"{name}.png").read_bytes() for name in ("detectability", "isolability")]
    assert files[0] != files[1]
    assert [(base64.b64decode(picture), words) for words, picture in shown] == [
        (files[0], "smallest loss that is certain to be detected and isolated"),
        (files[1], "smallest loss that is distinguished from each other surface"),
    ]
