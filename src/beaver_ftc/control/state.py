"""The control stage: the records of the law, one a part of it, and how they are filled from a scenario."""

import numpy as np

from beaver_ftc.compiled import record, sized
from beaver_ftc.control import accommodation, allocation, engines, power, reference
from beaver_ftc.control.accommodation import surfaces_dtype
from beaver_ftc.control.allocation import AXES, PROBE, allocation_dtype, layout_dtype
from beaver_ftc.control.engines import ENGINES
from beaver_ftc.control.laws import ADAPTING, REJECTING, gains, law_of, zhang2005
from beaver_ftc.control.laws.published import FEEDBACK
from beaver_ftc.control.laws.rejecting import rejection_dtype
from beaver_ftc.control.power import POWER
from beaver_ftc.control.reference import REFERENCE
from beaver_ftc.control.rivals.compiled import RIVAL
from beaver_ftc.scenario.schema import Scenario


@sized
def control_dtype(n: int) -> np.dtype:
    """What the law of an aircraft with n surfaces keeps: a record of each part, which alone writes it."""
    return record(
        law=int, inner=int,  # laws/__init__.py
        reference=REFERENCE, layout=layout_dtype(n), surfaces=surfaces_dtype(n), feedback=FEEDBACK,
        adaptation=zhang2005.ADAPTATION,
        rejection=rejection_dtype(n), rival=RIVAL, axes=AXES, allocation=allocation_dtype(n), probe=PROBE,
        power=POWER, engines=ENGINES,
    )  # fmt: skip


def configure(control: np.void, scenario: Scenario, travel: np.ndarray) -> None:
    """Fill a law's record from a scenario; travel (2, n) rad: the stops. A plug-in: loop/plugin_frame.py."""
    config, dt = scenario.control, 1.0 / scenario.rate_hz
    control["law"], control["inner"] = law_of(config.law)
    reference.configure(control["reference"], config, dt)
    accommodation.configure(control["surfaces"], config, int(control["law"]), dt)
    control["feedback"]["Kp"], control["feedback"]["Ki"] = config.proportional_per_s, config.integral_per_s2
    allocation.configure(control, config, travel, scenario.airframe)
    allocation.configure_probe(control["probe"], scenario.fdi.probing, dt)
    if control["inner"] == ADAPTING:
        zhang2005.configure(control, config, travel)
    power.configure(control["power"], control["layout"], scenario)
    engines.configure(control["engines"], scenario)


def anchor(control: np.void, belief: np.void, scenario: Scenario, y: np.ndarray) -> None:
    """Show an inner law the trim, if it derives its gains there; y: the measured signals."""
    if control["inner"] == REJECTING:
        gains.configure(control["rejection"], control["layout"], belief, scenario, y)
