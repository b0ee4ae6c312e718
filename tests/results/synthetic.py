"""A flight made by hand: columns and summary of a run with plausible numbers, to test what shows them."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

from beaver_ftc.aircraft import load
from beaver_ftc.scenario.airframe import Actuators, Environment
from beaver_ftc.scenario.sensors import Sensors

AXES = ("p", "q", "r")
SURFACES = ("aileron", "elevator", "rudder", "flap")
ESTIMATORS = ("aileron", "elevator", "rudder")
STATES = (
    "airspeed_mps", "alpha_rad", "beta_rad", "p_rad_s", "q_rad_s", "r_rad_s",
    "phi_rad", "theta_rad", "psi_rad", "north_m", "east_m", "altitude_m",
)  # fmt: skip
COLUMNS = (
    "t_s", *STATES, "pdot_rad_s2", "qdot_rad_s2", "rdot_rad_s2", "qdyn_pa", "dpt", "envelope_valid",
    *(f"{a}_measured_rad_s" for a in AXES), *(f"{a}_reference_rad_s" for a in AXES),
    *(f"{a}_model_rad_s" for a in AXES),
    *(f"{s}_{what}_rad" for s in SURFACES for what in ("cmd", "pos", "effective")),
    *(f"{s}_saturated" for s in SURFACES),
    *(f"{a}_{what}_rad_s" for a in AXES for what in ("alarm_residual", "alarm_threshold")),
    *(f"{a}_{what}_rad_s" for a in AXES for what in ("residual", "threshold")),
    *(f"{a}_eta_bar_rad_s2" for a in AXES), *(f"{a}_network_rad_s2" for a in AXES),
    *(
        name
        for e in ESTIMATORS
        for name in (
            *(f"fie_{e}_{a}_{what}_rad_s" for a in AXES for what in ("residual", "lower", "upper")),
            f"fie_{e}_excluded",
        )
    ),
    *(f"{s}_effectiveness_{which}" for which in ("estimate", "used") for s in SURFACES), "mode", "detected",
)  # fmt: skip


@dataclass(frozen=True)
class Fault:
    at_s: float = 12.0
    type: str = "loss_of_effectiveness"
    actuator: str | None = "elevator"
    magnitude: float = 0.4
    end_s: float | None = None
    profile: str = "abrupt"

    def model_dump(self, exclude: Any, exclude_none: bool) -> dict[str, Any]:
        assert {"actuator", "sensor", "type", "at_s", "end_s", "profile"} == exclude
        assert exclude_none
        return {"magnitude": self.magnitude}


FDI = SimpleNamespace(
    scheme="adaptive-estimators", diagnoses=True, assumes_sound_sensors=True, is_ours=True,
    fault_class="published", pairs=False,
    bounds=SimpleNamespace(sensors=SimpleNamespace(gyros_vary=False)),
)  # fmt: skip
CONTROL = SimpleNamespace(law="fault-tolerant")
INITIAL = SimpleNamespace(airspeed_mps=45.0, altitude_m=1828.8)


class Expect:
    """Stands for the scenario's `expect` block: knows only how to list what is set."""

    def __init__(self, **expected: Any) -> None:
        self._expected = expected

    def model_dump(self, exclude_none: bool) -> dict[str, Any]:
        assert exclude_none
        return self._expected


@dataclass(frozen=True)
class Scenario:
    name: str = "synthetic"
    description: str = "A flight made by hand."
    seed: int = 7
    rate_hz: float = 100.0
    duration_s: float = 30.0
    faults: tuple[Fault, ...] = (Fault(),)
    expect: Any = field(default_factory=Expect)
    fdi: Any = field(default_factory=lambda: FDI)
    control: Any = field(default_factory=lambda: CONTROL)
    initial: Any = field(default_factory=lambda: INITIAL)
    airframe: Any = field(default_factory=load)
    environment: Any = field(default_factory=lambda: Environment(wind_mps=(0.0, 1.0, 0.0)))
    sensors: Any = field(default_factory=Sensors)
    actuators: Any = field(default_factory=Actuators)
    changes: tuple[Any, ...] = ()


@dataclass
class Flight:
    scenario: Any = field(default_factory=Scenario)
    frames: int = 3000
    columns: tuple[str, ...] = COLUMNS
    detection_time_s: float | None = 12.07
    detection_axis: str | None = "q"
    guaranteed_delay_s: float | None = 0.31
    isolation_time_s: float | None = 12.12
    isolated: str | None = "elevator"
    isolation_type: str | None = "loss_of_effectiveness"
    candidates: tuple[str, ...] = ("elevator",)
    estimate: float | None = -0.39
    pre_fault_rms_rad_s: tuple[float, float, float] = (0.001, 0.002, 0.003)
    post_fault_rms_rad_s: tuple[float, float, float] | None = (0.002, 0.01, 0.003)
    supervisor: list[tuple[float, str]] = field(
        default_factory=lambda: [(0.0, "nominal"), (12.07, "adaptive"), (12.12, "reallocated")]
    )
    envelope_exits: list[tuple[float, float]] = field(default_factory=list)
    departure: tuple[float, str] | None = None
    saturation_s: dict[str, float] = field(default_factory=lambda: dict.fromkeys(SURFACES, 0.0))
    surface_travel_rad: dict[str, float] = field(default_factory=lambda: dict.fromkeys(SURFACES, 0.5))
    surface_energy_rad2_s: dict[str, float] = field(default_factory=lambda: dict.fromkeys(SURFACES, 0.01))
    worst_residual_ratio: float = 0.11
    type_time_s: float | None = None
    estimate_interval: tuple[float, float] | None = None
    frequency_rad_s: float | None = None
    authority: dict[str, dict[str, float]] | None = None
    profile: dict[str, float | None] | None = None
    arrival: dict[str, float | None] | None = None
    limits: tuple[dict[str, Any], ...] = ()
    probing_s: tuple[float, float] | None = None
    engine_power: dict[str, float] | None = None
    faults: tuple[dict, ...] = ()
    statistical: dict[str, float | None] | None = None
    mode_changes: int = 3
    changes: tuple[Any, ...] = ()
    exits: int = 0
    outside_s: float = 0.0
    outside_at_end: bool = False
    end: tuple[float, float] | None = None
    so_far: bool | None = None
    withdrawn: tuple[dict[str, Any], ...] = ()
    withdrawn_types: tuple[dict[str, Any], ...] = ()
    windows: tuple[dict[str, Any], ...] = ()
    estimate_at_s: float | None = None
    closest_approach: tuple[float, ...] = (0.11,)
    inconclusive: dict[str, Any] | None = None

    def __post_init__(self) -> None:
        if self.isolated is not None:
            self.so_far = self.isolated in SURFACES
