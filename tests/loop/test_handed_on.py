"""What a change in flight takes from the record of the new flight, and what goes on: field by field."""

import numpy as np
import pytest

import beaver_ftc as bf
from flying import scenario

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
