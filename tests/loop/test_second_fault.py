"""What a diagnosis makes of a second fault: nothing that the first one taught follows a broken sensor."""

from functools import cache

import numpy as np
import pytest

import beaver_ftc as bf
from beaver_ftc.loop.loop import Loop
from beaver_ftc.results.metrics import measure
from beaver_ftc.results.verdict import verdict_lines
from beaver_ftc.scenario import load

RATES = {
    axis: [{"sine": {"amplitude_deg_s": 3, "frequency_hz": f}}]
    for axis, f in zip("pqr", (0.25, 0.2, 0.15), strict=True)
}
LOSS = {"type": "loss_of_effectiveness", "magnitude": 0.5}


def flown(*faults, duration_s=30.0, **fdi):
    """(metrics, log by column) of a flight with these faults."""
    document = {
        "name": "second-fault", "duration_s": duration_s, "reference": RATES, "faults": list(faults),
        "fdi": {"fault_class": "all", **fdi},
    }  # fmt: skip
    loop = Loop(load(document))
    log = np.concatenate([rows.copy() for rows in loop.chunks()])
    return measure(loop.land()), dict(zip(loop.columns, log.T, strict=True))


def text(found):
    return " ".join(says for _, says in verdict_lines(found))


@pytest.mark.parametrize(
    ("surface", "sensor", "magnitude"),
    [("elevator", "q", 2.0), ("elevator", "p", -2.0), ("rudder", "r", 2.0), ("elevator", "alpha", 2.0)],
)
def test_a_sensor_that_breaks_later_is_named_beside_the_surface(surface, sensor, magnitude):
    """And the effectiveness in use stays what it was: nothing is learnt from an estimated reading."""
    first = {"actuator": surface, "at_s": 8.0, **LOSS}
    second = {"sensor": sensor, "type": "bias", "magnitude": magnitude, "at_s": 15.0}
    found, log = flown(first, second, sensor_monitor="always")
    named = [(one.fault, one.correct) for one in found.isolation.faults]
    assert named == [(surface, True), (f"sensor {sensor}", True)]
    assert found.isolation.names == (surface, f"sensor {sensor}")
    assert found.isolation.withdrawn == ()
    used = log[f"{surface}_effectiveness_used"][log["t_s"] > 25.0]
    assert used == pytest.approx(0.5, abs=0.025)
    assert found.isolation.estimate == pytest.approx(-0.5, abs=0.01)
    assert 14.9 < found.isolation.estimate_at_s < 15.1
    assert abs(log["airspeed_mps"][-1] - 45.0) < 8.0


def test_an_intermittent_fault_is_scored_window_by_window():
    spells = [(8.0, 13.0, 0.5), (16.0, 21.0, 0.3)]
    faults = [
        {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": m, "at_s": a, "end_s": b}
        for a, b, m in spells
    ]
    found, _ = flown(*faults)
    assert [(w.from_s, w.to_s) for w in found.windows] == [(a, b) for a, b, _ in spells]
    for i, (window, (_, end_s, magnitude)) in enumerate(zip(found.windows, spells, strict=True)):
        (named,) = window.isolation
        assert window.faults == (i,)
        assert (window.detected, named.fault, named.correct) == (True, "elevator", True)
        assert 0.0 <= window.delay_s < 0.1
        assert 0.0 <= named.delay_s < 0.1
        assert named.estimate_at_s == pytest.approx(end_s - 0.01)
        if named.estimate is not None:
            assert named.true_size == pytest.approx(-magnitude)
    assert "(true 0 %)" in text(found)  # at the end of the flight, not amid it
    assert "-0 %" not in text(found)


def test_of_two_losses_at_once_the_truth_is_their_product_at_the_instant_of_the_estimate():
    halves = [{"actuator": "elevator", "at_s": at_s, **LOSS} for at_s in (8.0, 16.0)]
    found, _ = flown(*halves)
    first, second = (window.isolation[0] for window in found.windows)
    assert (first.true_size, second.true_size) == (-0.5, -0.75)
    assert first.estimate == pytest.approx(-0.5, abs=0.01)
    assert "at 29.99 s (true 75 %)" in text(found)


KEYS = {
    "oscillatory": {"amplitude_deg": 2, "frequency_rad_s": 6}, "bias": {"bias_deg": 2}, "stuck": {},
    "rate_limit": {"scale": 0.02}, "float": {}, "hardover": {"direction": 1},
    "loss_of_effectiveness": {"magnitude": 0.4},
}  # fmt: skip


AGAIN = KEYS | {
    "stuck": {"position_deg": 5}, "hardover": {"direction": -1}, "bias": {"bias_deg": -3},
    "oscillatory": {"amplitude_deg": 3, "frequency_rad_s": 4},
}  # fmt: skip


@pytest.mark.parametrize("second", KEYS)
@pytest.mark.parametrize("first", KEYS)
def test_a_second_fault_is_refused_or_acts_from_its_beginning(first, second):
    """A surface with both moves otherwise than with the first alone; but a loss of what gives no moment."""
    faults = [first_fault(first), {"actuator": "aileron", "type": second, "at_s": 2.1, **AGAIN[second]}]
    alone = effective_alone(first)
    try:
        both = effective(faults)
    except bf.BadInput:
        assert first in ("stuck", "float")
        assert second not in ("stuck", "loss_of_effectiveness") or second == first == "stuck"
        return
    assert (both != alone).any() != ((first, second) == ("float", "loss_of_effectiveness"))


def first_fault(kind):
    return {"actuator": "aileron", "type": kind, "at_s": 2.0, **KEYS[kind]}


@cache
def effective_alone(kind):
    return effective([first_fault(kind)])


def effective(faults):
    """The deflection that acts in each frame until the end, or the loss of the aircraft, rad."""
    document = {"name": "both", "duration_s": 5.0, "reference": RATES, "control": {"law": "nominal"}}
    loop = Loop(load(document | {"faults": faults}))
    log = np.concatenate([rows.copy() for rows in loop.chunks()])
    return log[:300, loop.columns.index("aileron_effective_rad")]
