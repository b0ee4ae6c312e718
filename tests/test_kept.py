"""What is kept of an earlier revision: a difference is seen, rounding is none."""

import re
from copy import deepcopy

import numpy as np
import pytest

import kept

DOCUMENT = {"a": [1.0, -2.5e-3, {"b": "text"}], "n": 3, "on": True, "none": None, "far": float("inf")}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(kept, "FOLDER", tmp_path)
    assert not kept.differences("here/one", DOCUMENT, anew=True)
    return tmp_path


def test_nothing_is_held_that_was_not_kept(folder):
    assert not kept.differences("here/one", DOCUMENT)
    assert kept.differences("here/another", DOCUMENT) == ["here/another: nothing is kept; pytest --keep"]
    assert [file.name for file in folder.rglob("*.json")] == ["one.json"]


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("a", 1), -2.5001e-3),
        (("a", 2, "b"), "Text"),
        (("a", 2, "c"), 0),
        (("n",), 4),
        (("n",), "3"),
        (("on",), False),
        (("on",), 1),
        (("none",), 0),
        (("far",), 1e308),
        (("more",), None),
    ],
)
def test_a_difference_is_seen_where_it_is(folder, path, value):
    other = deepcopy(DOCUMENT)
    inner = other
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    (said,) = kept.differences("here/one", other)
    assert re.search(rf"{path[-1]}\]?: ", said)


def test_one_that_is_gone_or_more_is_a_difference(folder):
    for other in ({**DOCUMENT, "a": DOCUMENT["a"][:2]}, {k: v for k, v in DOCUMENT.items() if k != "none"}):
        assert len(kept.differences("here/one", other)) == 1


def test_rounding_is_no_difference(folder):
    almost = {**DOCUMENT, "a": [1.0 + 1e-9, -2.5e-3 * (1 + 1e-8), {"b": "text"}]}
    assert not kept.differences("here/one", almost)


def test_an_array_in_short_knows_order_sign_and_what_is_not_finite():
    array = np.array([1.0, -2.0, 3.0])
    others = (
        [1.0, 3.0, -2.0],
        [-1.0, 2.0, -3.0],
        [1.0, -2.0, np.nan],
        [1.0, -2.0, 3.0, 0.0],
        [1.0, -2.0, 3.1],
    )
    for other in others:
        assert not np.allclose(kept.in_short(array), kept.in_short(other), rtol=1e-6)


def test_a_record_is_told_field_by_field_and_zeros_are_left_out():
    inner = np.dtype([("x", float), ("k", int)])
    record = np.zeros(1, [("n", int), ("idle", float), ("many", inner, 3)])
    record["n"], record["many"]["x"][0, 1] = 4, 2.0
    found = kept.of_record(record[0])
    assert found.keys() == {"n", "many.x"}
    assert found["n"] == 4
    assert found["many.x"][0] > 2.0
    assert found["many.x"][1:] == [0.0, 3]


def test_a_field_that_is_zero_is_compared_with_the_size_of_what_is_kept(folder):
    """Exactly zero here, a rounding on another machine, or the other way round."""

    def record(x, many):
        made = np.zeros(1, [("x", float), ("many", float, 3), ("always", float)])
        made["x"], made["many"], made["always"] = x, many, 3.0
        return {"record": kept.of_record(made[0])}

    zero, rounding = record(0.0, 0.0), record(-2.6e-17, [0.0, 3e-17, -1e-18])
    assert not kept.differences("here/zero", zero, anew=True)
    assert not kept.differences("here/rounding", rounding, anew=True)
    assert not kept.differences("here/zero", rounding)
    assert not kept.differences("here/rounding", zero)
    assert len(kept.differences("here/zero", record(1e-6, [0.0, 0.0, -1e-6]))) == 2
    assert len(kept.differences("here/zero", record(0.0, [0.0, 0.0, np.nan]))) == 1


def test_a_picture_is_told_by_what_it_shows():
    from matplotlib.figure import Figure

    def drawn(label="rate, deg/s", height=2.0, colour="C1", named="flown", **look):
        axes = Figure().subplots()
        axes.plot([0, 1], [1.0, height], color=colour, label=named, **look)
        axes.set_xlabel("time, s")
        axes.set_ylabel(label)
        axes.legend()
        return kept.picture(axes.figure)

    assert drawn() == drawn()
    others = {
        "label": "rate",
        "height": 2.1,
        "colour": "C2",
        "named": "model",
        "linewidth": 1.4,
        "alpha": 0.9,
    }
    for other in ({name: value} for name, value in others.items()):
        assert drawn(**other) != drawn()
