"""The benchmark on recorded flights from the folder to the figure: whole, from small flights and by hand."""

import pytest

from beaver_ftc_logs.recorded import benchmark
from beaver_ftc_logs.samples import Samples


def event_flight(left_out, method, failure, delay_s=None, false_alarms=0, right=True, healthy_s=600.0):
    return {
        "left_out": left_out, "method": method, "failure": failure, "delay_s": delay_s,
        "detected": delay_s is not None, "false_alarms": false_alarms, "right_group": right,
        "healthy_s": healthy_s,
    }  # fmt: skip


FAILURES = {
    "one": "left_aileron", "two": "rudder+right_aileron", "three": "rudder", "four": "elevator",
    "five": "engine", "six": None,
}  # fmt: skip
DELAYS = {"ours": [1.0, 5.0, 7.5, None, 2.0, None], "theirs": [4.0, 31.0, 30.0, None, None, None]}
FLIGHTS = [
    event_flight(name, method, failure, delay, int(name == "three"), name != "two")
    for method, delays in DELAYS.items()
    for (name, failure), delay in zip(FAILURES.items(), delays, strict=True)
]
EVENTS = {
    "set": "gliders", "left_out": "each flight in turn", "scored_by": "events", "flights": FLIGHTS,
    "rows": [
        {
            "method": method,
            **benchmark.summarize_failures([of for of in FLIGHTS if of["method"] == method]),
        }
        for method in DELAYS
    ],
    "published": [
        {
            "method": "published", "precision": 0.5,
            "delay_s": {"aileron": {"mean": 3.0, "found": 1, "failures": 2}},
        },
    ],
}  # fmt: skip


def shares(method, classes, **changes):
    figures = {
        "healthy_or_faulty": classes + 0.01,
        "side": classes + 0.02,
        "mean_error": 0.05,
        "held_by_bounds": 0.9,
    }
    return {"method": method, "classes": classes} | figures | changes


LABELS = {
    "set": "wings", "left_out": "halves of the one flight in turn", "scored_by": "labels", "flights": [],
    "rows": [shares(f"method {i}", 0.9 - 0.03 * i) for i in range(17)],
    "published": [{"method": "published", "classes": 0.95, "side": 0.97}],
}  # fmt: skip
DOCUMENT = {"sets": [EVENTS, LABELS]}
DAYS = {
    "other_days": {
        "sets": [
            {
                "set": "wings",
                "rows": [
                    shares("", 0.9, kind="one change", day="as it was", beside=0.5),
                    shares("", 0.8, kind="one change", day="gain 0.85", beside=0.4),
                    shares("", 0.7, kind="drawn", day="drawn 0", beside=0.3),
                ],
                "summary": [
                    {"kind": kind, "mean": shares("", 0.8, beside=0.45), "worst": shares("", 0.7, beside=0.3)}
                    for kind in ("one change", "drawn")
                ],
            }
        ]
    }
}


@pytest.mark.parametrize("name", ["flights", "days"])
def test_tables_of_a_document(changed, name):
    document = {"flights": DOCUMENT, "days": DAYS}[name]
    assert not changed(
        {
            "text": benchmark.as_text(document).splitlines(),
            "page": benchmark.as_markdown(document).splitlines(),
        }
    )


def changed(samples, **changes):
    return Samples(**(vars(samples) | changes))
