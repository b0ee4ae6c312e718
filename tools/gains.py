"""The gains of zhang2005 that the paper does not give: how their defaults were chosen.

    python -m tools.gains

On five flights that no figure of the paper shows (other airspeeds, references, sizes and instants of faults)
each gain is tried on a ladder of values while the others have their defaults. What counts is the worst from
half of a value to twice as much, in the mean over the flights: the least is chosen. `says` below has what is
measured. Prints a table; exit status 1 if a default is not what is chosen.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from beaver_ftc.design.model import design_of, unanticipated_pitch
from beaver_ftc.design.table import ALPHA, QDYN
from beaver_ftc.loop.loop import fly
from beaver_ftc.plugins import DETECTORS, LAWS, settings
from beaver_ftc.results.log import Columns
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.reproduce.choices import scenario

AT_S, SETTLED_S, DURATION_S = 9.0, 3.0, 22.0
NAME, FACTORS = "zhang2005", 2.0 ** np.linspace(-1.0, 1.0, 5)


def _loss(actuator: str, magnitude: float, airspeed_mps: float) -> dict[str, Any]:
    fault = {"type": "loss_of_effectiveness", "actuator": actuator, "magnitude": magnitude, "at_s": AT_S}
    return {"faults": [fault], "initial.airspeed_mps": airspeed_mps}


def _unknown(Cm_alpha3: float, airspeed_mps: float) -> dict[str, Any]:
    fault = {"type": "unanticipated", "Cm_alpha3": Cm_alpha3, "at_s": AT_S}
    return {"faults": [fault], "initial.airspeed_mps": airspeed_mps}


LOSSES = (_loss("elevator", 0.7, 39.0), _loss("aileron", 0.5, 51.0), _loss("rudder", 0.5, 48.0))
UNKNOWN = (_unknown(6.0, 37.0), _unknown(14.0, 51.0))
REFERENCES = {
    f"reference.{axis}": [{"sine": {"amplitude_deg_s": 4.0, "frequency_hz": hz, "phase_deg": 40.0}}]
    for axis, hz in (("p", 0.31), ("q", 0.17), ("r", 0.23))
}


@dataclass(frozen=True)
class Gain:
    """An option that is searched: of which group, on which flights, and what is to be small."""

    group: str
    option: str
    ladder: tuple[float, ...]
    flights: tuple[Mapping[str, Any], ...]
    says: str

    @property
    def default(self) -> float:
        """The default that plugins.yaml has."""
        return settings(self.group, NAME, {})[self.option]


TRACKING = "RMS error of the worst rate once settled, deg/s"
GAINS = (
    Gain(DETECTORS, "network_gain", (50, 70, 100, 150, 200), UNKNOWN, "RMS error of fhat, rad/s2"),
    Gain(DETECTORS, "adaptation_gain", (500, 1000, 2000, 3000, 5000), LOSSES, "error of theta in the mean"),
    Gain(LAWS, "network_gain", (30, 40, 50, 70, 100, 150), (*LOSSES, *UNKNOWN), TRACKING),
    Gain(LAWS, "rate_weight", (1, 2, 5, 10, 20), (*LOSSES, *UNKNOWN), TRACKING),
    Gain(LAWS, "parametric_gain", (5, 10, 20, 30, 50), (*LOSSES, *UNKNOWN), TRACKING),
)  # fmt: skip


def _flown(changes: Mapping[str, Any]) -> tuple[Scenario, Columns]:
    own = {"fdi.scheme": NAME, "control.law": NAME, "duration_s": DURATION_S, **REFERENCES}
    log = Columns()
    case = scenario("gains", {**own, **changes})
    fly(case, log)
    return case, log


def cost(gain: Gain, value: float) -> float:
    """The mean over the gain's flights of the worst from half this value to twice as much, in the unit that
    it says; infinite where an aircraft is lost.
    """
    key = "fdi.options" if gain.group == DETECTORS else "control.options"
    tried = [{key: {gain.option: factor * value}} for factor in FACTORS]
    worst = [max(_measured(gain, *_flown({**flight, **one})) for one in tried) for flight in gain.flights]
    return float(np.mean(worst))


def _measured(gain: Gain, case: Scenario, log: Columns) -> float:
    """The cost of one flight, after it has settled: an error of the estimate for a detector, of tracking
    in deg/s for a law; infinite if the aircraft is lost."""
    t = log["t_s"]
    settled = t >= AT_S + SETTLED_S
    if t[-1] < DURATION_S - 0.1:
        return np.inf
    if gain.group == DETECTORS and gain.flights is UNKNOWN:
        design = design_of(Declared.of(case))[0]
        y = np.zeros((5, settled.sum()))
        y[ALPHA], y[QDYN] = log["alpha_rad"][settled], log["qdyn_pa"][settled]
        phi = unanticipated_pitch.py_func(design.view(np.recarray), y, case.faults[0].Cm_alpha3)
        return _rms(log["q_network_rad_s2"][settled] - phi)
    if gain.group == DETECTORS:
        surface, theta = case.faults[0].actuator, -case.faults[0].magnitude
        return float(np.mean(np.abs(log[f"{surface}_effectiveness_estimate"][settled] - 1.0 - theta)))
    errors = [_rms(log[f"{axis}_model_rad_s"][settled] - log[f"{axis}_rad_s"][settled]) for axis in "pqr"]
    return float(np.degrees(max(errors)))


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def main() -> None:
    """Print each gain with the cost of each value tried, and the value chosen."""
    agreed = True
    for gain in GAINS:
        costs = {value: cost(gain, value) for value in gain.ladder}
        chosen = min(costs, key=costs.__getitem__)
        agreed = agreed and chosen == gain.default
        tried = ", ".join(f"{value:g}: {found:.3g}" for value, found in costs.items())
        where = "scheme" if gain.group == DETECTORS else "law"
        print(f"{where} {gain.option}: chosen {chosen:g}, default {gain.default:g}. {gain.says}: {tried}")
    raise SystemExit(0 if agreed else 1)


if __name__ == "__main__":
    main()
