"""What the detectability survey says and draws of rows made by hand; known moments; one flight."""

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
    assert figure.get_size_inches().tolist() == [8.0, 9.0]
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
