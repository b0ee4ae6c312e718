"""A flight condition: everything that fixes the truth at one instant."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Self

from beaver_ftc.aircraft import Aircraft, load

# Gravity is that of latitude 45 deg, where the FDC data belong.
START_LATITUDE_DEG = 45.0
_STATES = ("alpha_rad", "beta_rad", "p_rad_s", "q_rad_s", "r_rad_s", "phi_rad", "theta_rad", "psi_rad")


@dataclass(frozen=True, init=False)
class FlightState:
    """State, surfaces and engine at one instant; SI and rad, body axes X forward, Y right, Z down.

    airspeed_mps, alpha_rad, beta_rad: velocity through still air. p, q, r: body rates relative to the Earth.
    phi, theta, psi: attitude, north-east-down to body. altitude_m: geometric, above sea level.
    surfaces_rad: deflection of each surface. settings: the engine's, as in the aircraft's file.

    A surface reads and is given as `<surface>_rad` too, a setting by its own name:
    `FlightState(45.0, 1000.0, elevator_rad=-0.05, engine_rpm=1900.0)`; what is left out is neutral, or the
    aircraft's default.
    """

    airspeed_mps: float
    altitude_m: float
    alpha_rad: float = 0.0
    beta_rad: float = 0.0
    p_rad_s: float = 0.0
    q_rad_s: float = 0.0
    r_rad_s: float = 0.0
    phi_rad: float = 0.0
    theta_rad: float = 0.0
    psi_rad: float = 0.0
    surfaces_rad: Mapping[str, float] = field(default_factory=dict, hash=False)
    settings: Mapping[str, float] = field(default_factory=dict, hash=False)

    def __init__(
        self,
        airspeed_mps: float,
        altitude_m: float,
        *,
        surfaces_rad: Mapping[str, float] | None = None,
        settings: Mapping[str, float] | None = None,
        aircraft: Aircraft | None = None,
        **given: Any,
    ) -> None:
        if surfaces_rad is None or settings is None:
            at_neutral, by_default = neutral(aircraft or load())
            surfaces_rad = at_neutral if surfaces_rad is None else surfaces_rad
            settings = by_default if settings is None else settings
        surfaces_rad, settings = dict(surfaces_rad), dict(settings)
        for name in [name for name in given if name not in type(self).__dataclass_fields__]:
            surface = name.removesuffix("_rad")
            if name in settings:
                settings[name] = given.pop(name)
            elif surface != name and surface in surfaces_rad:
                surfaces_rad[surface] = given.pop(name)
            else:
                raise TypeError(f"a flight condition has no {name!r}")
        values = {"airspeed_mps": airspeed_mps, "altitude_m": altitude_m, **dict.fromkeys(_STATES, 0.0)}
        for name, value in {**values, **given, "surfaces_rad": surfaces_rad, "settings": settings}.items():
            object.__setattr__(self, name, value)

    def __getattr__(self, name: str) -> float:
        own = self.__dict__
        if name.endswith("_rad") and name[: -len("_rad")] in own.get("surfaces_rad", ()):
            return own["surfaces_rad"][name[: -len("_rad")]]
        if name in own.get("settings", ()):
            return own["settings"][name]
        raise AttributeError(name)

    def as_dict(self) -> dict[str, Any]:
        """Everything by its own name: states, `<surface>_rad`, settings."""
        flat: dict[str, Any] = {}
        for each in fields(self):
            value = getattr(self, each.name)
            if each.name == "surfaces_rad":
                flat |= {f"{surface}_rad": deflection for surface, deflection in value.items()}
            elif each.name == "settings":
                flat |= value
            else:
                flat[each.name] = value
        return flat

    @classmethod
    def of(cls, other: "FlightState", **more: Any) -> Self:
        """The same condition as this class, with more known of it."""
        return cls(**{each.name: getattr(other, each.name) for each in fields(other)}, **more)


def neutral(aircraft: Aircraft) -> tuple[dict[str, float], dict[str, float]]:
    """Neutral surfaces and the default settings of an aircraft."""
    settings = {name: setting.default for name, setting in aircraft.engine.settings.items()}
    return dict.fromkeys(aircraft.surfaces, 0.0), settings
