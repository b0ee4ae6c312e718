"""What the diagnosis is told: the aircraft's file and the declared half of a scenario, with their defaults.

The keys and their defaults are those of docs/reference/scenario-keys.md and docs/reference/aircraft-keys.md.
SI units and radians. Axes and their names: 0 p roll, 1 q pitch, 2 r yaw.
"""

from dataclasses import dataclass
from functools import cached_property
from math import hypot, prod, radians, sqrt
from typing import Any, NamedTuple

import numpy as np

AXES = "pqr"
MOMENTS, FORCES = ("Cl", "Cm", "Cn"), ("CX", "CY", "CZ")
READINGS = ("p", "q", "r", "alpha", "beta", "V", "qdyn")  # in the order of x, then y
SUFFIXES = {
    **dict.fromkeys("pqr", ("deg_s", radians(1.0))),
    **dict.fromkeys(("alpha", "beta", "phi", "theta", "psi"), ("deg", radians(1.0))),
    **dict.fromkeys(("ax", "ay", "az"), ("mps2", 1.0)),
    "V": ("mps", 1.0), "qdyn": ("pa", 1.0), "altitude": ("m", 1.0),
    "engine_rpm": ("rpm", 1.0), "manifold_pressure": ("inhg", 1.0),
}  # fmt: skip
NOISE_LIMIT_SIGMA = 4.0  # table "constants" of glossary.md
POSITION, LOSS = "position", "loss"


class Error(NamedTuple):
    """Declared error of a reading: standard deviation, bias and resolution in SI, slope as a share."""

    sigma: float = 0.0
    bias: float = 0.0
    resolution: float = 0.0
    slope: float = 0.0

    @property
    def o(self) -> float:
        """detection.md, error of a reading: o = 4 sigma + |bias| + resolution / 2."""
        return NOISE_LIMIT_SIGMA * self.sigma + abs(self.bias) + self.resolution / 2.0

    @property
    def random(self) -> float:
        """Standard deviation of noise and rounding, hypot(sigma, resolution / sqrt(12))."""
        return hypot(self.sigma, self.resolution / sqrt(12.0))

    def e(self, v: np.ndarray) -> np.ndarray:
        """detection.md, error of a reading v: e = (o + slope |v|) / (1 - slope)."""
        return (self.o + self.slope * np.abs(v)) / (1.0 - self.slope)


class Term(NamedTuple):
    """A term of a moment coefficient: value times powers of signals, times its surface if it has one."""

    axis: int
    name: str
    value: float
    powers: tuple[tuple[str, int], ...]
    surface: int | None


class Hypothesis(NamedTuple):
    """isolation.md, hypotheses: its name in the log, LOSS or POSITION, its surface and range of theta."""

    name: str
    kind: str
    surface: int
    low: float
    high: float


class AircraftFile:
    """aircraft.yaml as a mapping."""

    def __init__(self, file: dict[str, Any]) -> None:
        self.file, self.surfaces = file, tuple(file["surfaces"])
        self.signals = tuple(file.get("signals") or ())
        self.S, self.b, self.c = (file["geometry"][key] for key in ("wing_area_m2", "span_m", "chord_m"))
        self.arm = np.array([self.b, self.c, self.b])
        self.travel = np.array([file["surfaces"][s]["travel_rad"] for s in self.surfaces]).T

    @cached_property
    def terms(self) -> list[Term]:
        """Every term of the three moments, in the order of the file."""
        return self._terms("moments", MOMENTS)

    @cached_property
    def forces(self) -> list[Term]:
        """The same of the forces, without those of the rate of sideslip; none where the file has none."""
        return [t for t in self._terms("forces", FORCES) if "betadoth" not in dict(t.powers)]

    @cached_property
    def by_sideslip_rate(self) -> float:
        """Side force coefficient by the rate of sideslip times b / 2V."""
        side = [t for t in self._terms("forces", FORCES) if t.axis == 1]
        return sum(t.value for t in side if t.powers == (("betadoth", 1),))

    def _terms(self, section: str, coefficients: tuple[str, ...]) -> list[Term]:
        of_section = self.file.get(section) or {}
        return [
            Term(
                axis, term["name"], term["value"], tuple(term["of"].items()),
                self.surfaces.index(term["surface"]) if term.get("surface") else None,
            )
            for axis, coefficient in enumerate(coefficients)
            for term in of_section.get(coefficient) or ()
        ]  # fmt: skip

    @cached_property
    def effect(self) -> np.ndarray:
        """(3, surfaces): what one radian of each surface does about each axis in level flight, to compare."""
        usual = dict.fromkeys(("alpha", "beta", "ph", "qh", "rh", *self.signals), 0.0)
        if box := (self.file.get("model_error_map") or {"boxes": [None]})["boxes"][0]:
            usual |= {name: sum(ends) / 2 for name, ends in (box.get("signals") or {}).items()}
            usual["alpha"] = sum(box["alpha_rad"]) / 2
        arm = self.arm / [self.file["mass"][f"{name}_kgm2"] for name in ("Ix", "Iy", "Iz")]
        effect = np.zeros((3, len(self.surfaces)))
        for term in self.terms:
            if term.surface is not None:
                effect[term.axis, term.surface] += (
                    term.value * arm[term.axis] * prod(usual[name] ** power for name, power in term.powers)
                )
        return effect

    @cached_property
    def main_axis(self) -> np.ndarray:
        """(surfaces,): the axis that each surface turns most about.

        An axis that no surface turns most about gets the surface that turns most about it, of those that
        share theirs with another.
        """
        size = np.abs(self.effect)
        axes = size.argmax(axis=0)
        for axis in set(range(3)) - set(axes.tolist()):
            shared = [s for s in range(axes.size) if (axes == axes[s]).sum() > 1 and size[axis, s] > 0]
            if shared:
                axes[max(shared, key=size[axis].__getitem__)] = axis
        return axes

    @cached_property
    def stand_ins(self) -> tuple[str, ...]:
        """Surfaces that take over from the one that leads pitch: those after it in its group."""
        for group in self.file["groups"].values():
            if (place := self.leads(1, group)) is not None:
                return tuple(group[place + 1 :])
        return ()

    def leads(self, axis: int, group: list[str]) -> int | None:
        """Place in its group of the surface that leads an axis, None if another group leads it."""
        of_axis = [s for s in self.surfaces if self.main_axis[self.surfaces.index(s)] == axis]
        rank = {s: place for members in self.file["groups"].values() for place, s in enumerate(members)}
        leader = min(of_axis, key=rank.__getitem__)
        return group.index(leader) if leader in group else None

    @cached_property
    def leaders(self) -> tuple[str, ...]:
        """The surface that leads each axis, in the order of the file."""
        groups = self.file["groups"].values()
        led = {g[place] for g in groups for axis in range(3) if (place := self.leads(axis, g)) is not None}
        return tuple(s for s in self.surfaces if s in led)


@dataclass(frozen=True)
class Declaration:
    """The declared half of a scenario: aircraft, rates, design_model, actuators, fdi."""

    aircraft: AircraftFile
    scenario: dict[str, Any]

    def __getitem__(self, path: str) -> Any:
        """A key of `fdi`, with its default."""
        found: Any = self.scenario.get("fdi") or {}
        default: Any = DEFAULTS
        for name in path.split("."):
            default = default.get(name) if isinstance(default, dict) else None
            found = found.get(name) if isinstance(found, dict) else None
        return default if found is None else found

    @property
    def n(self) -> int:
        """JSBSim steps in a frame, n_s."""
        return int(self.scenario.get("substeps", 1))

    @property
    def dt(self) -> float:
        """Length of a frame, s."""
        return 1.0 / float(self.scenario.get("rate_hz", 100))

    @property
    def design_model(self) -> dict[str, Any]:
        """Deliberate errors of the design model."""
        return self.scenario.get("design_model") or {}

    @property
    def to_the_letter(self) -> bool:
        """Whether the scheme is the paper's [Zhang2005]: Euler steps, gradients, no further tests."""
        return bool(self["scheme"] == "zhang2005")

    def memory(self, poles: Any) -> np.ndarray:
        """a = exp(-lambda dt); of an Euler step 1 - lambda dt, at least 0."""
        decay = np.array(poles, dtype=float) * self.dt
        return np.maximum(1.0 - decay, 0.0) if self.to_the_letter else np.exp(-decay)

    @property
    def statistical(self) -> bool:
        """Whether the statistical detector runs."""
        given = (self.scenario.get("fdi") or {}).get("statistical")
        return given is not None and not self.to_the_letter

    @property
    def norm_bound(self) -> bool:
        """Whether test 1 has the published bound in place of the interval."""
        return self.to_the_letter or self["thresholds"] == "published"

    @property
    def all_types(self) -> bool:
        """Whether faults of every type are in the class."""
        return bool(self["fault_class"] == "all")

    def per_axis(self, path: str) -> np.ndarray:
        """(3,) numbers of `fdi.bounds` for p, q, r; an axis that is left out of a given mapping is 0."""
        given = self[path]
        return np.array([float(given.get(axis, 0.0)) for axis in AXES])

    def sharpen(self, step: str) -> bool:
        """Whether a step beyond the published scheme is on; with published thresholds none is by default."""
        whole = "none" if self.to_the_letter else (self.scenario.get("fdi") or {}).get("sharpen")
        if whole is None:
            whole = "none" if self.norm_bound else "all"
        return bool(whole.get(step, True)) if isinstance(whole, dict) else whole == "all"

    def error(self, reading: str) -> Error:
        """Declared error of an instrument."""
        given = self["bounds.sensors"]
        of_it = given.get(reading, {}) if isinstance(given, dict) else {}
        suffix, si = SUFFIXES[reading]
        sizes = (of_it.get(f"{key}_{suffix}", 0.0) * si for key in ("noise_std", "bias", "quantum"))
        return Error(*sizes, abs(of_it.get("scale_error", 0.0)))

    @property
    def compares_across(self) -> bool:
        """Whether evidence along parity directions excludes surfaces."""
        able = self.statistical and self.all_types and self["authority"] != "worst-case"
        return able and not self["pairs"] and self.n == 1

    @property
    def largest_share(self) -> float:
        """The largest declared relative error of a term."""
        share = self["bounds.coefficients"]
        return max(share.values(), default=0.0) if isinstance(share, dict) else float(share)

    def coefficient_share(self, name: str) -> float:
        """Declared relative error of a term."""
        share = self["bounds.coefficients"]
        return float(share.get(name, 0.0)) if isinstance(share, dict) else float(share)

    @cached_property
    def losses(self) -> list[Hypothesis]:
        """Losses of the published class: of the surfaces that lead an axis, and of those that stand in for
        none."""
        aircraft = self.aircraft
        others = [s for s in aircraft.surfaces if s not in (*aircraft.leaders, *aircraft.stand_ins)]
        return [_loss(aircraft, s) for s in (*aircraft.leaders, *others)]

    @cached_property
    def hypotheses(self) -> list[Hypothesis]:
        """isolation.md, table 1: losses; of all types also those of stand-ins, and a position of every
        surface."""
        aircraft, found = self.aircraft, list(self.losses)
        if self.all_types:
            found += [_loss(aircraft, s) for s in aircraft.stand_ins]
            low, high = np.minimum(aircraft.travel[0], 0.0), np.maximum(aircraft.travel[1], 0.0)
            found += [
                Hypothesis(f"{s}_position", POSITION, j, low[j], high[j])
                for j, s in enumerate(aircraft.surfaces)
            ]
        return found


def _loss(aircraft: AircraftFile, surface: str) -> Hypothesis:
    return Hypothesis(surface, LOSS, aircraft.surfaces.index(surface), -1.0, 0.0)


DEFAULTS: dict[str, Any] = {
    "scheme": "adaptive-estimators", "fault_class": "published", "pairs": False, "thresholds": "interval",
    "detection_pole_per_s": 10.0, "isolation_pole_per_s": 10.0, "forgetting_time_s": 5.0,
    "pole_bank_per_s": [1e6], "fault_profile": "any", "authority": "either",
    "statistical": {"false_alarms_per_h": 1e-3, "misnaming": 1e-4, "uncertainty_rad_s": 15.0},
    "slowest_oscillation_rad_s": 1.0, "slowest_rate_deg_s": 0.5,
    "options": {
        "adaptation_gain": 3000.0, "initial_theta": 0.0, "projection": 1, "adaptive_threshold": 1,
        "constant_threshold_rad_s": 0.002, "leave_out": 0,
    },
    "bounds": {
        "inertia_coupling": dict.fromkeys(AXES, 0.25), "constant_rad_s2": dict.fromkeys(AXES, 0.02),
        "coefficients": 0.0, "inertia": 0.0, "sensors": "ideal", "deflection_deg": 0.0, "turbulence": "none",
        "vertical_wind_mps": 1.0,
        "actuators": {},
    },
}  # fmt: skip
