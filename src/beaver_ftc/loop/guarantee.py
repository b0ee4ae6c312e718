"""Whether the instant from which detection was certain is a promise, and of whom.

accounts.py finds that instant for the worst-case filters of the diagnosis in charge. It binds nobody where
those filters raise no alarm (a plug-in, or the statistical test in sole authority), where they were not
asked any more (an alarm before the fault, or of the watch over the instruments), and where what they are told
is off by more than is declared (a broken instrument, undeclared errors). Then nothing is said.
"""

import numpy as np

from beaver_ftc.diagnosis.state import STATISTICS
from beaver_ftc.plant.faults import TIME_TOLERANCE_S
from beaver_ftc.scenario.faults import of_a_sensor
from beaver_ftc.scenario.in_flight import stages
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.warnings import undeclared


def guaranteed_delay_s(frame: np.void, scenario: Scenario, plugged: bool) -> float | None:
    """From the fault's first frame to the instant from which its alarm was certain, s; plugged: the detector
    is a plug-in."""
    certain_s, truth, fdi = (
        float(frame["accounts"]["guarantee"]["certain_after_s"]),
        frame["truth"],
        frame["fdi"],
    )
    if certain_s < 0.0 or not truth["faulted"] or plugged:
        return None
    fault_s, verdict = float(truth["fault_at_s"]), fdi["verdict"]
    early = verdict["detected"] and verdict["detected_at_s"] < fault_s - TIME_TOLERANCE_S
    if early or fdi["config"]["authority"] == STATISTICS or fdi["watch"]["alarmed"]:
        return None
    return None if _is_off(scenario, certain_s) else certain_s - fault_s


def _is_off(scenario: Scenario, certain_s: float) -> bool:
    """Whether by then the diagnosis was told something that is off by more than it reckons with."""
    if any(of_a_sensor(fault) and fault.at_s <= certain_s for fault in scenario.faults):
        return True
    flown = [scenario, *(then for change, then in stages(scenario) if change.at_s <= certain_s)]
    return any(any(undeclared(each)) for each in flown)
