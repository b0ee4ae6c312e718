"""What `detectability` says of documents made by hand, no two numbers alike."""

import pytest

from beaver_ftc.commands import Reporter
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies.detectability import places_shown, sizes_shown
from beaver_ftc.studies.detectability.command import Detectability
from beaver_ftc.studies.present.page import Table, as_text


def row(variant, size, low, high, flights, certain, total=(0.97, 0.91, 0.99, 38, 39)):
    value, least, most, count, of = total
    return {
        "variant": variant,
        "found": {"size": size, "low": low, "high": high, "flights": flights},
        "certain": {"size": certain, "flights": 17, "at_total_loss": 13},
        "total_loss": {"value": value, "low": least, "high": most, "count": count, "of": of},
    }


COMPARED = (
    row("without turbulence", 0.12, 0.08, 0.16, 61, 0.31),
    row("with exact gyros", 0.22, 0.18, 0.27, 53, 0.43),
    row("with twice the reference", 0.15, 0.11, 0.19, 47, 0.37),
    row("with half the reference", 0.57, 0.49, 0.65, 43, None),
)  # fmt: skip
WHOLE = {
    "scenario": "brisk", "surface": "aileron", "within_s": 0.5, "share": 0.9, "inconclusive": [],
    "bound_used": 0.29, "false_alarms": 0, "failed": 0, "compared": list(COMPARED),
}  # fmt: skip


def said(found=(0.34, 0.28, 0.41), certain=0.52, **changes):
    return as_text(sizes_shown.page_of(row("as it is", *found, 83, certain) | WHOLE | changes)[1])


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        (
            {},
            "whatever the declared uncertainty does: a loss of 52 % of",
        ),
        ({}, "Found within 0.5 s in 90 % of flights: a loss of 34 % (28 to 41 %) of the effectiveness of"),
        ({}, "What limits it most: without turbulence, it would be 12 % (8 to 16 %)."),
        ({}, "Which reference would help: with twice the reference, it would be 15 % (11 to 19 %)."),
        ({"certain": None}, "does: not even a total loss of aileron (a total loss: in 13 of 17 flights)."),
        ({"found": (0.95, 0.9, None)}, "a loss of 95 % (90 % or more) of"),
        ({"compared": COMPARED[3:]}, "What limits it most: nothing that was left out alone"),
        ({"bound_used": 0.998}, "Half of these flights use 100 % of the bound or more before the loss"),
        (
            {"false_alarms": 3, "failed": 1},
            "3 flights with a total loss have an alarm before the loss: these count as not found.\n"
            "1 flight with a total loss cannot be flown to the end: it counts as not found.",
        ),
        ({"inconclusive": ["too fast"]}, "Nothing can be concluded in part of these flights: too fast."),
    ],
)
def test_what_is_said_of_sizes(keys, says):
    assert says in said(**keys)


def test_where_no_size_is_found_a_variant_helps_that_finds_more_total_losses():
    rare = {"total_loss": {"value": 0.62, "low": 0.46, "high": 0.75, "count": 24, "of": 38}}
    never = row("without turbulence", None, None, None, 61, None)
    text = said((None, None, None), None, **rare, compared=[never])
    assert "90 % of flights: not even a total loss of aileron (a total loss: in 62 %, 46 to 75 %" in text
    assert "without turbulence, a total loss is found in 97 % of flights." in text


def place(fault, other, airspeed_mps, detected, isolated, why):
    magnitudes = {"detected": detected, "isolated": isolated, "isolated_median": 0.2}
    point = {"airspeed_mps": airspeed_mps, "excitation": 0.5, "fault": fault}
    pair = {"other": other, "magnitude": isolated, "magnitude_median": 0.1, "longest_s": 0.4, "median_s": 0.1}
    return point | magnitudes | {"why": why}, point | pair | {"doublet_deg": 1.25, "doublet_s": 0.03}


def test_a_line_spans_the_places_where_some_loss_is_certain():
    made = [
        place("aileron", "rudder", 40.0, 0.11, 0.301, "as soon as detected"),
        place("aileron", "rudder", 50.0, 0.12, None, "the rudder explains it"),
        place("rudder", "aileron", 40.0, None, None, "it barely moves"),
    ]
    points, pairs = map(list, zip(*made, strict=True))
    parts = places_shown.page_of({"scenario": "brisk", "points": points, "pairs": pairs})[1]
    assert parts[:2] == [
        "aileron: at 0.5 times the scenario's references a loss of 31 % or more is certain to be detected "
        "and isolated at 1 of 2 places.",
        "rudder: at 0.5 times the scenario's references no loss is certain to be detected and isolated "
        "(it barely moves).",
    ]
    table = next(part for part in parts if isinstance(part, Table))
    lines = [dict(zip(table.head, cells, strict=True)) for cells in table.rows]
    assert [line["certain from"] for line in lines[:2]] == ["30 % (1/2)", "- (0/1)"]
    assert lines[2]["taken for"] == "rudder"
    times = [lines[2][name] for name in ("half: delay", "doublet", "doublet time")]
    assert times == ["0.10 s (2/2)", "1.2 deg (2/2)", "0.03 s (2/2)"]


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({}, "exactly one of SCENARIO and --grid"),
        ({"scenario": "fault-free", "grid": "quick"}, "exactly one of SCENARIO and --grid"),
        ({"grid": "quick", "within": 0.5, "surface": "rudder"}, "--within only with SCENARIO"),
        ({"scenario": "fault-free", "within": 0.5}, "--within only with --surface"),
        (
            {"scenario": "fault-free", "within": 0.5, "surface": "rudder", "altitude": [0.0]},
            "only without --within",
        ),
        ({"grid": "quick", "seed": 3}, "--seed only with --within"),
        ({"scenario": "fault-free", "sensors": "ideal"}, "only with --grid"),
        ({"grid": "quick", "airspeed": [40.0, 50.0]}, "at most one --airspeed"),
    ],
)
def test_methods_exclude_each_other(keys, says):
    with pytest.raises(BadInput, match=f"detectability: allowed: .*{says}"):
        Detectability(**keys).run(Reporter())
