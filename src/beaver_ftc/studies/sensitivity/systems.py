"""Two systems, the mechanisms of each, and the switch that removes each mechanism.

A mechanism is removed by keys of the scenario. If there is no key, it is withheld from the law in flight. The
two flights of a pair differ in nothing else. The law uses the diagnosis only after the alarm. Both flights of
a pair therefore have the same healthy loop, and so the same stability margins.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

Changes = Mapping[str, Any]
PAPER, DEFAULT = "published", "default"
SYSTEMS: Mapping[str, Changes] = {
    PAPER: {"fdi.scheme": "zhang2005", "control.law": "zhang2005"},
    DEFAULT: {"fdi.scheme": "adaptive-estimators", "control.law": "fault-tolerant"},
}
DIAGNOSIS, LAW = "diagnosis", "law"
CONSTANT = "fdi.options.constant_threshold_rad_s"  # mechanisms.py computes its value for each flight
ABRUPT: Changes = MappingProxyType({"fdi.fault_profile": "abrupt"})  # only with this key are sets intersected
NORM_BOUND: Changes = MappingProxyType({"fdi.thresholds": "published"})
SUDDEN_S = 0.01  # one frame of mechanisms.py: a scenario admits no hand-over of 0 s


class Mechanism(NamedTuple):
    """A mechanism of a system, and what it serves (DIAGNOSIS or LAW).

    without: keys that remove it. present: keys with which it is there, where the system's own are not enough.
    withheld: what is withheld from the law in flight, as in `loop.readout.withhold_from_law`.
    """

    system: str
    name: str
    serves: str
    without: Changes
    present: Changes = MappingProxyType({})
    withheld: str = ""

    @property
    def key(self) -> str:
        """Its name, unique over the systems."""
        return f"{self.system}: {self.name}"

    @property
    def with_key(self) -> str:
        """The key of the outcome with it: that of the whole system, unless it needs keys to be present."""
        return f"with {self.key}" if self.present else self.system

    @property
    def without_key(self) -> str:
        """The key of the outcome without it: that of the whole system, if this does not have it by itself."""
        return f"without {self.key}" if self.without or self.withheld else self.system


MECHANISMS = (
    Mechanism(PAPER, "adaptive thresholds", DIAGNOSIS, {"fdi.options.adaptive_threshold": 0}),
    Mechanism(
        PAPER, "adaptation of the isolation estimators", DIAGNOSIS, {"fdi.options.adaptation_gain": 0.0}
    ),
    Mechanism(PAPER, "network of the detection estimator", DIAGNOSIS, {"fdi.options.network_gain": 0.0}),
    Mechanism(PAPER, "network of the law", LAW, {"control.options.network": 0}),
    Mechanism(PAPER, "estimated effectiveness in the law", LAW, {"control.options.parametric_gain": 0.0}),
    Mechanism(PAPER, "all adaptation of the law", LAW, {"control.options.adaptation": 0}),
    Mechanism(PAPER, "hand-over to the flap", LAW, {"control.options.hand_over": 0}),
    Mechanism(PAPER, "gradual hand-over", LAW, {"control.hand_over_s": SUDDEN_S}),
    Mechanism(DEFAULT, "bank of poles", DIAGNOSIS, {"fdi.sharpen.pole_bank": False}),
    Mechanism(DEFAULT, "memory before the alarm", DIAGNOSIS, {"fdi.sharpen.memory": False}),
    Mechanism(DEFAULT, "effectiveness shared by the axes", DIAGNOSIS,
              {"fdi.sharpen.shared_effectiveness": False}),
    Mechanism(
        DEFAULT, "intersected sets", DIAGNOSIS, {**ABRUPT, "fdi.sharpen.set_membership": False}, ABRUPT
    ),
    Mechanism(DEFAULT, "signed interval test", DIAGNOSIS, {**NORM_BOUND, "fdi.sharpen": "all"}),
    Mechanism(DEFAULT, "all sharpened tests", DIAGNOSIS, {**NORM_BOUND, "fdi.sharpen": "none"}),
    Mechanism(DEFAULT, "statistical detector", DIAGNOSIS, {}, present={"fdi.statistical": {}}),
    Mechanism(DEFAULT, "verdict in the law", LAW, {}, withheld="verdict"),
    Mechanism(DEFAULT, "hand-over to the flap", LAW, {}, withheld="stand-in"),
    Mechanism(DEFAULT, "gradual hand-over", LAW, {"control.hand_over_s": SUDDEN_S}),
)  # fmt: skip
