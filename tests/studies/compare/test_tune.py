"""`compare --tune`: what ships was found inside its ranges; a plug-in is tuned as everybody is."""

import json
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path

import pytest

from beaver_ftc.diagnosis.rivals import (
    FLIGHT_GRADES,
    TUNED_FILE,
    TUNED_FILE_KEY_BY_PLUGIN_GROUP,
    load_tuned_values,
    tuned_values,
)
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.loop.loop import Loop
from beaver_ftc.plugins import DETECTORS, LAWS, Range, registered, tunable
from beaver_ftc.studies.compare.criteria import INADMISSIBLE
from beaver_ftc.studies.compare.search import EDGE, on_scale
from beaver_ftc.studies.compare.trial import LAW, SCHEME, STATISTICAL
from beaver_ftc.studies.compare.tune import LEAST_GAIN, Search, methods_of, read_tuned, tune
from beaver_ftc.studies.compare.tune_shown import as_text
from commands import beaver
from flying import scenario

RECORD = json.loads((Path(__file__).parents[3] / "benchmarks" / "tuning.json").read_text())
ROWS = [pytest.param(row, id=f"{row['grade']}-{row['kind']}-{row['name']}") for row in RECORD["methods"]]
GROUPS = {kind: group for group, kind in TUNED_FILE_KEY_BY_PLUGIN_GROUP.items()}
MINE = """
from beaver_ftc.diagnosis.rivals.observer import ConstantThresholdObserver


class Mine(ConstantThresholdObserver):
    '''An observer under another name.'''

    name = "mine"
    tunable = {"alarm": (0.1, 1e4)}
"""


def flown_by(row):
    return tuned_values(load_tuned_values(), row["grade"], GROUPS[row["kind"]], row["name"])


@pytest.mark.parametrize("row", ROWS)
def test_no_value_that_ships_is_on_the_edge_of_its_range(row):
    """What was found for it, too."""
    ranges = {key: Range(**of) for key, of in row["ranges"].items()}
    for values in (flown_by(row), row["found"]):
        assert set(values) == set(ranges)
        places = [on_scale(ranges[key], value) for key, value in values.items()]
        assert min(places) > EDGE
        assert max(places) < 1.0 - EDGE


def tuned_since(row):
    """Whether the values that ship were tuned again: a search that found them says nothing of them."""
    return row["again"] and row["again"][-1]["draw"] != row.get("draw")


@pytest.mark.parametrize("row", [row for row in ROWS if tuned_since(row.values[0])])
def test_a_method_that_is_tuned_again_gains_at_most_5_percent(row):
    """On flights that chose neither the values that ship nor those that the second tuning finds."""
    gains = {again["draw"]: again.get("gain", 0.0) for again in row["again"]}
    used = [(again["draw"], again["draw"] + again["judged"]) for again in row["again"]]
    assert all(end < begin for (_, end), (begin, _) in pairwise(used))
    adopted = [draw for draw, gain in gains.items() if gain > LEAST_GAIN]
    assert adopted[-1:] == ([row["draw"]] if "draw" in row else [])
    assert ("gain" in row["again"][-1]) == (row["cost"] < INADMISSIBLE)


def test_everybody_is_tuned_on_every_grade():
    """What flies says nothing of how it was found: it is small."""
    everybody = methods_of([*registered(DETECTORS), STATISTICAL], list(registered(LAWS)), FLIGHT_GRADES)
    rows = {(GROUPS[row["kind"]], row["name"], row["grade"]): row for row in RECORD["methods"]}
    assert set(rows) == {(each.group, each.name, each.grade) for each in everybody}
    assert {SCHEME, LAW} < {each.name for each in everybody}
    for each in everybody:
        assert each.start() == flown_by(rows[each.group, each.name, each.grade])
    for row in rows.values():
        assert row["trials"] >= RECORD["trials"] - len(row["ranges"])
        assert set(flown_by(row)) == set(row["ranges"])
    assert set(json.loads(TUNED_FILE.read_text())) == {"grades"}


def test_rivals_fly_with_what_was_chosen_for_their_grade():
    errors = {"bounds": {"turbulence": "light"}}
    for of_grade, given in (
        ("exact", {}),
        ("actuators", {"actuators": "servo"}),
        ("errors", {"fdi": errors}),
    ):
        given["fdi"] = {"scheme": "augmented-ekf", **given.get("fdi", {})}
        flown = Loop(scenario(duration_s=1, **given)).plugin_frame.detector.options
        assert (
            tuned_values(load_tuned_values(), of_grade, DETECTORS, "augmented-ekf").items() <= flown.items()
        )


def test_a_plug_in_is_tuned_like_everybody(tmp_path):
    """By its class's own ranges; the file is read again where methods are compared."""
    (tmp_path / "mine.py").write_text(MINE)
    asked = (
        "--schemes",
        "mine",
        "--plugin",
        "mine:Mine",
        "--grade",
        "exact",
        "--flights",
        "1",
        "--trials",
        "5",
        "--restarts",
        "1",
    )
    done = beaver("compare", "--tune", *asked, "--workers", "1", "--format", "json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    path = tmp_path / "comparisons" / "tuned.json"
    files = [json.loads(path.with_name(name).read_text()) for name in ("tuned.json", "tuning.json")]
    assert files == [{"grades": document.pop("grades")}, document]
    (row,) = document["methods"]
    assert row["ranges"] == {"alarm": asdict(Range(0.1, 1e4))}
    assert (document["trials"], document["restarts"], row["restarts"], row["settled"]) == (5, 1, 1, False)
    assert row["trials"] == 9
    assert row["cost"] <= row["start_cost"]
    assert read_tuned(path) == {"exact": {"detectors": {"mine": row["values"]}}}
    assert "up to 5 trials a search, seed 1, up to 1 restarts" in as_text(document)


@pytest.mark.parametrize(
    "given", [{"a": (1.0,)}, {"a": (2.0, 1.0)}, {"a": (0.0, 1.0)}, {"a": (0.5, 2.0, "odds")}, {"a": "ab"}, 7]
)
def test_ranges_that_are_none_are_refused(monkeypatch, given):
    monkeypatch.setattr(
        "beaver_ftc.plugins.plugin_class", lambda group, name: type("Mine", (), {"tunable": given})
    )
    with pytest.raises(BadInput, match=r"tunable.*allowed: "):
        tunable(DETECTORS, "mine")


def test_nothing_to_tune_and_no_file_are_said(tmp_path):
    with pytest.raises(BadInput, match="nothing to tune"):
        tune([], Search(5, 1, 0), 1, None)
    path = tmp_path / "a.json"
    for grades in ({"windy": {}}, ["exact"], {"exact": 5}, {"exact": {"detector": {}}}, None):
        path.write_text(json.dumps({"grades": grades} if grades else {}))
        with pytest.raises(BadInput, match="allowed: a file that compare --tune wrote"):
            read_tuned(path)
    with pytest.raises(BadInput, match="allowed: a file that compare --tune wrote"):
        read_tuned(tmp_path / "nowhere.json")
