"""What a change in flight takes from the record of the new flight, and what goes on: field by field."""

import numpy as np
import pytest

import beaver_ftc as bf
from beaver_ftc.loop.loop import Loop
from flying import loss, scenario
from telling import bits

FRAMES = 150
GRADE = {"sensors": {"q": {"bias_deg_s": 0.2, "delay_s": 0.1, "bandwidth_rad_s": 50.0, "dropout_share": 0.1}}}
# Beside the change itself: the engine's instruments, chance, and a fault that somebody has found by then.
GIVEN = {"duration_s": 4.0, "faults": [loss(at_s=0.5, magnitude=0.6)], "seed": 5, "fdi": {"statistical": {}}}
REFERENCE_AND_COMMAND = {
    *(f"reference.output.{name}" for name in ("commanded_rate", "model_rate", "model_acceleration")),
    *(f"reference.output.{name}" for name in ("governed_rate", "governed_acceleration")),
    *(f"surfaces.output.{name}" for name in ("target", "effectiveness", "offset", "lag", "given_up")),
    *(f"surfaces.output.{name}" for name in ("parked", "authority_lost", "unknown")),
    *(f"allocation.output.{name}" for name in ("command", "saturated", "hand_over")),
    *(f"allocation.output.{name}" for name in ("lost_share", "transfer_share")),
    *(f"probe.memory.{name}" for name in ("deflection", "probed", "from_s", "to_s")),
}
ENGINE = {
    *(f"memory.{name}" for name in ("lost", "engaged", "moved", "speed", "usual_speed", "attitude")),
    *(f"output.{name}" for name in ("command", "in_use", "from_s", "frames", "least", "greatest")),
}
GOES_ON = {
    "law": {
        *(f"control.{name}" for name in REFERENCE_AND_COMMAND),
        *(f"control.power.{name}" for name in ENGINE),
    },
    "scheme": {
        "fdi.bank.output.peak",
        "fdi.statistical.alarm.peak"},
    "sensors": {
        f"instruments.{name}"
        for name in ("random", "counter", "lagged", "line", "reading", "broken", "fault")
    },
}  # fmt: skip
GOES_ON["observer"] = GOES_ON["law"] | {f"control.rejecting.observer.{name}" for name in ("begun", "rate")}
BEGINS = {
    "law": ("control",),
    "observer": ("control",),
    "scheme": ("fdi", "verdict"),
    "sensors": ("instruments",),
}
# What the change itself works out, tested below or elsewhere.
OF_A_LAW = {"control.published.memory.integral", "control.rejecting.observer.disturbance"}
OWN = {
    "law": OF_A_LAW,
    "observer": OF_A_LAW,
    "scheme": {
        "since",
        "fdi.statistical.gust.config.starts_in_flight",
        "fdi.statistical.vaneless.config.starts_in_flight",
    },
    "sensors": {"instruments.taken"},
}


def fields(record, path=""):
    """{path: value} of every field of a record down to arrays of numbers."""
    found = {}
    for name in record.dtype.names:
        value = record[name]
        if isinstance(value, np.void):
            found |= fields(value, f"{path}{name}.")
        else:
            found[path + name] = np.array(value)
    return found


MOVED = set().union(*GOES_ON.values(), {"since"})


def shift(record, path=""):
    """Let every number differ from what a flight begins with, and whatever goes on."""
    for name in record.dtype.names:
        value = record[name]
        if isinstance(value, np.void):
            shift(value, f"{path}{name}.")
        elif (value.dtype.kind == "f" or path + name in MOVED) and value.dtype.names is None:
            record[name] = value + value.dtype.type(1)


def changed(change):
    """The record before and after a change, and that of a flight which has always been so."""
    loop = Loop(scenario(**GIVEN, changes=[{"at_s": FRAMES / 100.0, **change}]))
    loop.fly_chunk(0, FRAMES)
    shift(loop.frames[0])
    before = fields(loop.frames[0])
    loop.changing.apply(FRAMES)
    keys = {"law": ("control", "law"), "scheme": ("fdi", "scheme")}
    always = dict(GIVEN)
    for name, value in change.items():
        if name in keys:
            part, key = keys[name]
            always[part] = {**always.get(part, {}), key: value}
        else:
            always[name] = value
    return before, fields(loop.frames[0]), fields(Loop(scenario(**always)).frames[0])


@pytest.mark.parametrize(
    ("kind", "change"),
    [
        ("law", {"law": "nominal"}), ("observer", {"law": "fault-tolerant"}), ("observer", {"law": "oracle"}),
        ("scheme", {"scheme": "adaptive-estimators"}), ("scheme", {"scheme": "none"}), ("sensors", GRADE),
    ],
)  # fmt: skip
def test_every_field_begins_anew_or_goes_on(kind, change):
    before, after, always = changed(change)
    parts, goes_on = BEGINS[kind], GOES_ON[kind]
    assert goes_on <= set(after)
    for name, value in after.items():
        if name in OWN[kind]:
            continue
        begins = name.partition(".")[0] in parts and name not in goes_on
        expected = always[name] if begins else before[name]
        assert bits(value) == bits(expected), f"{name} should {'begin anew' if begins else 'go on'}"


def test_the_frame_of_a_diagnosis_begun_anew_and_the_first_sample_of_instruments_are_noted():
    assert changed({"scheme": "none"})[1]["since"] == FRAMES
    assert not changed(GRADE)[1]["instruments.taken"].any()


SENSORS = (
    {"q": {"bias_deg_s": 0.3}},
    {"q": {"delay_s": 0.11, "scale_error": 0.05}},
    {"q": {"delay_s": 0.03, "bias_deg_s": -0.2}},
    {"q": {"bandwidth_rad_s": 20.0}},
    "ideal",
)


def test_after_each_change_the_instruments_read_what_the_present_ones_would():
    """(1 + scale) q(t - delay) + bias; a delay begins with the value it finds, a lag with it too."""
    at = [100 * (j + 1) for j in range(len(SENSORS))]
    changes = [{"at_s": k / 100, "sensors": s} for k, s in zip(at, SENSORS, strict=True)]
    log = bf.fly(scenario(duration_s=6.0, fdi={"scheme": "none"}, changes=changes)).log
    q, expected = log["q_rad_s"].to_numpy(), log["q_rad_s"].to_numpy().copy()
    for k, given in zip(at, SENSORS, strict=True):
        of = given["q"] if isinstance(given, dict) else {}
        late = np.maximum(np.arange(k, k + 100) - round(100 * of.get("delay_s", 0.0)), k)
        value = q[late]
        if "bandwidth_rad_s" in of:
            for j in range(1, 100):
                value[j] = q[k + j] + np.exp(-of["bandwidth_rad_s"] / 100) * (value[j - 1] - q[k + j])
        expected[k : k + 100] = (1 + of.get("scale_error", 0.0)) * value
        expected[k : k + 100] += np.deg2rad(of.get("bias_deg_s", 0.0))
    assert log["q_measured_rad_s"].to_numpy() == pytest.approx(expected, abs=1e-12)
