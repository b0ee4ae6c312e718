"""The answer to "how small?" in sentences and files: of a survey made by hand, no two numbers alike."""

import json
from pathlib import Path

from beaver_ftc.studies.present.page import contents
from beaver_ftc.studies.smallest.shown import FILES, as_text
from kept import page


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


def document(found=(0.34, 0.28, 0.41), certain=0.52, compared=COMPARED, **changes):
    whole = row("as it is", *found, 83, certain)
    whole |= {
        "scenario": "brisk", "surface": "aileron", "within_s": 0.5, "share": 0.9, "inconclusive": [],
        "bound_used": 0.29, "false_alarms": 0, "failed": 0, "compared": list(compared),
    }  # fmt: skip
    return whole | changes


CASES = {
    "all known": document(),
    "doubts": document(
        inconclusive=["airspeed above 80 m/s, 12 % of the frames"], bound_used=0.998, false_alarms=3, failed=5
    ),
    "nothing certain": document(certain=None, compared=COMPARED[3:]),
    "none found": document(
        found=(None, None, None), certain=None, total_loss=row("", *[None] * 5, (0.62, 0.46, 0.75, 24, 38))[
            "total_loss"
        ],
    ),
    "an open end": document(found=(0.95, 0.9, None), compared=()),
    "to a percent": document(found=(0.34, 0.34, 0.34)),
}  # fmt: skip


def test_what_is_said_of_every_kind_of_answer(changed):
    assert not changed({name: as_text(of).splitlines() for name, of in CASES.items()})


def test_files_hold_every_row(changed):
    files = contents(FILES, CASES["all known"])
    assert json.loads(files["smallest.json"]) == CASES["all known"]
    assert not changed(files["smallest.csv"].splitlines(), "csv")
    assert not changed(page(files["smallest.html"](Path())), "page")
