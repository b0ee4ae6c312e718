"""What the detectability survey says and draws of rows made by hand; known moments; refusals."""

import json
import re
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies import detectability, isolability
from beaver_ftc.studies.detectability import (
    FILES,
    MAGNITUDES,
    Excitation,
    document_of,
    draw,
    judge,
    run_survey,
    text,
)
from beaver_ftc.studies.isolability import DOUBLET_COLUMNS, LOSS_COLUMNS
from beaver_ftc.studies.present.page import contents, write_files
from flying import scenario
from kept import picture


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


def alone(flown, **airframe):
    """A scenario of an aircraft made up of this; flown: what is flown of it instead."""
    made = SimpleNamespace(name="made", airframe=SimpleNamespace(**airframe))
    made.model_copy = lambda update: flown.append(update) or made
    return made


def test_columns_that_are_nearly_parallel_are_told_by_what_little_is_left():
    """Over twice the bound (2, 0, 0) and (3, 0, 0.0006). Of the first so much of the second is left that roll
    and yaw miss alike: 2 - 3 t and 0.0006 t. Of the second no roll need be left."""
    bound = np.full(3, 0.5)
    one, other = np.array([2.0, 0.0, 0.0]), np.array([3.0, 0.0, 0.0006])
    told = detectability.least_distinguished_rad
    assert told(one, other, bound) == pytest.approx(3.0006 / (2.0 * 0.0006))
    assert told(other, one, bound) == pytest.approx(1.0 / 0.0006)
    assert told(one, 1.5 * one, bound) == np.inf


@pytest.mark.parametrize(
    "fdi",
    [
        {"scheme": "none"}, {"thresholds": "published"}, {"pole_bank_per_s": [1.0, 9e5]},
        *({"sharpen": {name: False}} for name in ("memory", "pole_bank", "shared_effectiveness")),
    ],
)  # fmt: skip
def test_it_is_worked_out_for_one_scheme(fdi, tmp_path):
    with pytest.raises(BadInput, match="detectability is worked out for the sharpened scheme"):
        run_survey(tmp_path, scenario(fdi=fdi), [40.0], [0.0], [1.0])
