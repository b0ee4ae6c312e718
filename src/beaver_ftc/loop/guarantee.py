"""The instant from which detection of a fault is certain, whatever the uncertainty does. If

    |int e^{-lam (t - tau)} phi_i dtau| > 2 ebar_i

for some axis i, the fault has been detected by t [Zhang2002]: at worst an admissible eta hides ebar_i of the
fault's effect phi, rad/s2. lam 1/s: pole of a filter, ebar_i rad/s: its threshold. With a bank of filters,
the first of their instants. phi is the truth's, so this is an analyst's figure: the diagnosis never sees it.
"""

import numpy as np

from beaver_ftc.aircraft import PITCH
from beaver_ftc.compiled import kernel, record
from beaver_ftc.design.model import unanticipated_pitch
from beaver_ftc.diagnosis.config import STATISTICAL_DETECTOR
from beaver_ftc.plant.sensing import effective
from beaver_ftc.scenario.diagnosis import MAX_POLES
from beaver_ftc.scenario.faults import of_a_sensor
from beaver_ftc.scenario.instants import is_before
from beaver_ftc.scenario.schema import Scenario, stages
from beaver_ftc.scenario.undeclared import declares_all

GUARANTEE = record(
    phi=3, phi_sum=3,  # effect of the faults, rad/s2: now, and over the frame
    effect=(MAX_POLES, 3),  # filtered as the bank filters the innovation, rad/s
    certain_after_s=float,
)  # fmt: skip


@kernel
def effect_of_faults(guarantee, truth, prediction, y):
    """Fill guarantee.phi (3,) rad/s2: what the truth's faults do to the angular acceleration, as the design
    model weighs it."""
    phi, G, u = guarantee.phi, prediction.G, prediction.u
    phi[:] = 0.0
    if truth.faulted:
        for i in range(3):
            for s in range(u.size):
                phi[i] += G[i, s] * (effective(truth, s) - u[s])
        phi[PITCH] += unanticipated_pitch(prediction.design, y, truth.Cm_alpha3)


@kernel
def add_effect(guarantee):
    """Add the effect of an instant inside a frame to the sum over the frame."""
    for i in range(3):
        guarantee.phi_sum[i] += guarantee.phi[i]


@kernel
def follow_guarantee(guarantee, bank, dt, share, k, t):
    """Advance the filtered effect by the elapsed frame and note the first instant t (s) of certainty.

    share: one over the instants in a frame. The sum then restarts with this instant. k: number of the
    diagnosis' frame; with its first one, of 0, its filters are empty, whatever went before.
    """
    if k == 0:
        guarantee.effect[:], guarantee.certain_after_s = 0.0, -1.0
        guarantee.phi_sum = guarantee.phi
        return
    for i in range(3):
        mean = share * guarantee.phi_sum[i]
        for m in range(bank.config.n_filters):
            effect = bank.config.a[m] * guarantee.effect[m, i] + dt * mean
            guarantee.effect[m, i] = effect
            certain = abs(effect) > 2.0 * bank.output.threshold[m, i] > 0.0
            if certain and guarantee.certain_after_s < 0.0:
                guarantee.certain_after_s = t
        guarantee.phi_sum[i] = guarantee.phi[i]


def guaranteed_delay_s(frame: np.void, scenario: Scenario, plugged: bool) -> float | None:
    """From the fault's first frame to the instant from which its alarm was certain, s; plugged: the detector
    is a plug-in."""
    certain_s = float(frame["accounts"]["guarantee"]["certain_after_s"])
    truth, fdi = frame["truth"], frame["fdi"]
    if certain_s < 0.0 or not truth["faulted"] or plugged:
        return None
    fault_s, verdict = float(truth["fault_at_s"]), fdi["verdict"]
    early = verdict["detected"] and is_before(verdict["detected_at_s"], fault_s)
    if (
        early
        or fdi["config"]["authority"] == STATISTICAL_DETECTOR
        or fdi["sensor_monitor"]["output"]["alarmed"]
    ):
        return None
    return None if _is_off(scenario, certain_s) else certain_s - fault_s


def _is_off(scenario: Scenario, certain_s: float) -> bool:
    """Whether by then an input of the diagnosis was off by more than its declared bound."""
    if any(of_a_sensor(fault) and fault.at_s <= certain_s for fault in scenario.faults):
        return True
    flown = [scenario, *(then for change, then in stages(scenario) if change.at_s <= certain_s)]
    return not all(map(declares_all, flown))
