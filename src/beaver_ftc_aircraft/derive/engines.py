"""Why engines do not fly an aircraft: found by letting JSBSim run them otherwise.

The levers are moved, the tanks filled, the frames made shorter. What then changes is the cause.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import takewhile
from math import isfinite

from beaver_ftc.aircraft import N_PER_LBF
from beaver_ftc.documents import BeaverFtcError
from beaver_ftc.plant import FlightState, Plant

RATE_HZ = 100
SHORTER, _SHORT_S = 100, 0.2  # frames so many times shorter, for so long: a propeller shows it at once
RUN_S, BETWEEN_S = 6.0, 0.1
_LEAST_THRUST = 0.01  # of the weight
_LEAST_LEVER = 0.01
_FULL_LBS = 1e6  # JSBSim fills a tank to its capacity
LB_PER_SLUG = 32.17405


@dataclass(frozen=True)
class Run:
    """What engines do: the thrust of all, lbs; the throttle and the speed, rpm, of each; the moments of all,
    lbs ft; whether JSBSim could run them at all."""

    thrust_lbs: float
    throttle: tuple[float, ...]
    rpm: tuple[float, ...]
    moments_lbsft: tuple[float, ...]
    weight_lbs: float
    could: bool = True

    @property
    def finite(self) -> bool:
        """Whether all of it is a number."""
        return self.could and all(map(isfinite, (self.thrust_lbs, *self.rpm, *self.moments_lbsft)))

    @property
    def share(self) -> float:
        """Thrust as a share of the weight."""
        return self.thrust_lbs / self.weight_lbs


def steady_state(plant: Plant, power: float, alpha_rad: float = 0.0) -> FlightState:
    """Level flight at this angle of attack in the middle of the envelope, at this setting of the power."""
    return FlightState(
        0.5 * sum(plant.aircraft.envelope.airspeed_mps), plant.aircraft.file.start.altitude_m or 0.0,
        aircraft=plant.aircraft, alpha_rad=alpha_rad, theta_rad=alpha_rad, throttle=power,
    )  # fmt: skip


def hold(plant: Plant, state: FlightState, for_s: float, power: float | None = None) -> None:
    """Let the engines run so long, at a setting of the power if one is given, the aircraft put back into a
    state every tenth of a second."""
    for _ in range(round(for_s / BETWEEN_S)):
        plant.hold(state)
        if power is not None:
            plant.write(plant.aircraft.trim.throttle, power)
        run_between(plant)


def run_between(plant: Plant) -> None:
    """Let a tenth of a second pass."""
    for _ in range(round(BETWEEN_S / plant.dt_s)):
        plant.run()


def thrust_lbs(plant: Plant) -> float:
    """Thrust of all engines."""
    return sum(plant.read(f"propulsion/engine[{i}]/thrust-lbs") for i in range(plant.n_engines))


def weight_lbs(plant: Plant) -> float:
    """Weight of the aircraft."""
    return plant.read("inertia/mass-slugs") * LB_PER_SLUG


def run(plant: Plant, lever: float, for_s: float = RUN_S, filled: bool = False) -> Run:
    """What the engines of an aircraft do after a while in steady flight, held where it is, at a lever."""
    state = steady_state(plant, lever)
    try:
        for name in plant.tanks_lbs if filled else ():
            plant.write(name, _FULL_LBS)
        plant.start(state)
        hold(plant, state, for_s)
    except BeaverFtcError:
        return Run(0.0, (), (), (), 1.0, could=False)
    each = range(plant.n_engines)
    rpm = takewhile(plant.has, (f"propulsion/engine[{i}]/engine-rpm" for i in each))
    return Run(
        thrust_lbs(plant),
        tuple(plant.read(f"fcs/throttle-pos-norm[{i}]") for i in each),
        tuple(map(plant.read, rpm)),
        tuple(plant.read(f"moments/{axis}-prop-lbsft") for axis in "lmn"),
        weight_lbs(plant),
    )


def why_no_power(plant_of: Callable[[int], Plant]) -> str:
    """Why the engines give no more than they do, as a clause; plant_of: a new plant with so many frames of
    JSBSim in each of ours, since what has run once starts otherwise."""
    plant = plant_of(1)
    full = run(plant, 1.0)
    if not full.finite:
        return _why_not_finite(plant_of(SHORTER))
    if plant.tanks_lbs and not any(plant.tanks_lbs.values()):
        filled = run(plant_of(1), 1.0, filled=True)
        if filled.share > full.share + _LEAST_THRUST:
            return f"its tanks are empty; full, they let its engines give {_newton(filled)}"
    idle = run(plant_of(1), 0.0)
    if not any(abs(at - of) > _LEAST_LEVER for at, of in zip(full.throttle, idle.throttle, strict=True)):
        at = ", ".join(f"fcs/throttle-pos-norm[{i}] at {at:.3g}" for i, at in enumerate(full.throttle))
        return f"its own flight control holds {at}, wherever its lever fcs/throttle-cmd-norm is"
    return f"at full power its engines give {_newton(full)}, at {_speed(plant)}"


def _why_not_finite(shorter: Plant) -> str:
    says = (
        f"in frames of {1e3 / RATE_HZ:g} ms the speed and the moment of its propeller are no finite numbers"
    )
    if run(shorter, 1.0, _SHORT_S).finite:
        cure = "its <ixx> is too small for the power of its engine"
        return f"{says}, in frames of {1e3 * shorter.dt_s:g} ms they are: {cure}"
    return says


def _newton(of: Run) -> str:
    return f"{of.thrust_lbs * N_PER_LBF:.0f} N, {of.share:.1%} of its weight"


def _speed(plant: Plant) -> str:
    return f"{0.5 * sum(plant.aircraft.envelope.airspeed_mps):.3g} m/s"
