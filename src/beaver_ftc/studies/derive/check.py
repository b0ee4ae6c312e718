"""What of an aircraft a design model affine in its surfaces cannot hold: found at once, said in a line."""

import re
from collections.abc import Sequence
from dataclasses import replace
from math import degrees
from pathlib import Path

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft
from beaver_ftc.plant import instrumented
from beaver_ftc.plant.adapter import Plant, bare, translated
from beaver_ftc.plant.state import FlightState
from beaver_ftc.studies.derive.outline import own_deflection

NOT_AFFINE = 0.02  # deviation from a straight line, as a share of what the whole travel does
_MOVED_RAD, _RATE_RAD_S = 0.003, 0.1
_POINTS, _FRAMES = 9, 300
_AT_REST = 0.05  # as a share of where it is
_SURFACE = re.compile(r"fcs/(?!.*(cmd|throttle|thrust|gear))")


def not_affine(plant: Plant, trim: FlightState) -> list[str]:
    """Surfaces whose moment is not proportional to their deflection; the plant is left in trim."""
    notes = []
    plant.start(trim)
    for name, travel in plant.aircraft.travel.items():
        at = np.linspace(travel.min_rad, travel.max_rad, _POINTS)
        moved = [_accelerations(plant, trim, name, float(u)) for u in at]
        size = np.ptp(moved, axis=0)
        axis = int(size.argmax())
        if size[axis] == 0.0:
            notes.append(f"{name}: it turns nothing in trim: its faults cannot be seen")
            continue
        share = float(np.ptp(_off_line(at, np.array(moved)[:, axis])) / size[axis])
        if share > NOT_AFFINE:
            notes.append(
                f"{name}: its moment is not proportional to its deflection, {share:.0%} off a straight line: "
                "that is in the error"
            )
    plant.start(trim)
    return notes


def _accelerations(plant: Plant, trim: FlightState, surface: str, deflection_rad: float) -> list[float]:
    plant.hold(replace(trim, surfaces_rad={**trim.surfaces_rad, surface: deflection_rad}))
    return [plant.read(f"accelerations/{axis}dot-rad_sec2") for axis in AXES]


def _off_line(at: np.ndarray, values: np.ndarray) -> np.ndarray:
    off: np.ndarray = values - np.polyval(np.polyfit(at, values, 1), at)
    return off


def further_surfaces(source: Path, plant: Plant) -> dict[str, float]:
    """What else of its flight control its aerodynamics see, by property, and where it is in trim."""
    names = [name for name in instrumented.others_of(source) if _SURFACE.match(name)]
    return {name: round(plant.read(name), 4) for name in names if plant.has(name)}


def moved_by_itself(aircraft: Aircraft, trim: FlightState, names: Sequence[str]) -> list[str]:
    """Which of these properties do not come to rest in steady flight, no surface commanded to move."""
    if not names:
        return []
    plant, seen = Plant(100, aircraft=aircraft), []  # of its own, since fuel burns
    plant.start(trim)
    for k in range(_FRAMES):
        if k % 10 == 0:
            plant.hold(trim)  # it flies nowhere meanwhile
        plant.run()
        seen.append([plant.read(name) for name in names])
    late = np.array(seen)[_FRAMES // 2 :]
    moving = np.ptp(late, axis=0) > _AT_REST * (np.abs(late).mean(axis=0) + _AT_REST)
    return [name for name, moves in zip(names, moving, strict=True) if moves]


def own_control(source: Path, model: Path) -> list[str]:
    """What its own flight control does that the copy leaves out; model: a copy that writes no files."""
    surfaces = instrumented.surfaces_of(source)
    return [*_augmented(model, surfaces), *_moved_along(source, model, surfaces)]


def _augmented(model: Path, surfaces: tuple[str, ...]) -> list[str]:
    notes = []
    for surface in surfaces:
        moved = own_deflection(model, surface, 0.0, _RATE_RAD_S) - own_deflection(model, surface, 0.0)
        if abs(moved) > _MOVED_RAD:
            notes.append(
                f"{surface}: its own flight control moves it {degrees(moved):.1f} deg at "
                f"{degrees(_RATE_RAD_S):.1f} deg/s, command or not: the copy flies without"
            )
    return notes


def _moved_along(source: Path, model: Path, surfaces: tuple[str, ...]) -> list[str]:
    """What else of the flight control the aerodynamics see, and moves with the command of a surface."""
    others = instrumented.others_of(source)
    still = _seen(model, others, None)
    notes = []
    for surface in surfaces:
        moved = [name for name, value in _seen(model, others, surface).items() if value != still[name]]
        if moved:
            notes.append(f"{surface}: its command moves {', '.join(moved)} too: in the copy it does not")
    return notes


def _seen(model: Path, names: tuple[str, ...], surface: str | None) -> dict[str, float]:
    fdm = bare(model)
    with translated(model):
        if surface:
            fdm[f"fcs/{surface}-cmd-norm"] = 1.0
        for k in range(_FRAMES):
            if k % 10 == 0:
                fdm.run_ic()  # it flies nowhere meanwhile
            fdm.run()
    return {name: round(float(fdm[name]), 6) for name in names}
