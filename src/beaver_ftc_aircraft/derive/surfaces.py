"""The surfaces of an author's model: which there are, how far each goes, how all that its aerodynamics read
of it goes with its deflection; and whether the copy turns as the model does.

Nothing is taken from names that can be measured. The model's own flight control is commanded from stop to
stop, in a copy in which nothing fails. What the aerodynamics read is then a function of the deflection: the
right aileron of the left one by its own gain and stops, a normalised position by its own ends.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import degrees, inf, isfinite
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.aircraft import M_PER_FT
from beaver_ftc.documents import BadInput
from beaver_ftc.plant import (
    ACTUATED,
    POWER_LEVER,
    SURFACES,
    View,
    Views,
    bare,
    others_of,
    seen_by_aerodynamics,
    surfaces_of,
    translated,
    unit_of,
    usual_view,
    view_property,
)

LIKELY_TRAVEL_RAD, MOST_TRAVEL_RAD, LEAST_TRAVEL_RAD = 0.35, 1.2, 0.02
POSITIONS = {
    "aileron": "fcs/left-aileron-pos-rad",
    "elevator": "fcs/elevator-pos-rad",
    "rudder": "fcs/rudder-pos-rad",
}
_FRAMES, _FRAMES_OF_STEP = 400, 60  # in which its own flight control has moved a surface
_COMMANDS, _COMPARED = 41, 9  # from stop to stop
_SAME = 1e-4  # of what a whole travel does: a number as its name says
_ON_LINE = 1e-3  # of a whole travel
_STRAIGHT = 0.01  # off a straight line, as a share of what the whole travel does
_MOVES = 1e-6
DIFFERENT = 0.01  # of what whole travels do about an axis
_RUNS_TO_SETTLE = 8
_ANYWHERE_RAD = 3.0
_OF_LARGEST = 0.1  # a cause beside the largest
_NOTHING = 1e-4
_LEAST_FT_S2, _LEAST_SHARE = 0.03, 1e-3  # what counts as a span of accelerations: forces, moments
_AXES = "acceleration forward", "acceleration to the right", "acceleration downward", "roll", "pitch", "yaw"
_ACCELERATIONS = (
    *(f"accelerations/{axis}dot-ft_sec2" for axis in "uvw"),
    *(f"accelerations/{axis}dot-rad_sec2" for axis in "pqr"),
)  # fmt: skip
_CAUSES = ("fcs/", "gear/", "/")
# Airspeed as a share of the range, angles and rates.
_STATES = tuple(
    {
        "ic/vt-fps": share, "ic/alpha-rad": alpha, "ic/beta-rad": beta, "ic/p-rad_sec": p, "ic/q-rad_sec": q,
        "ic/r-rad_sec": r,
    }
    for share, alpha, beta, p, q, r in (
        (0.5, 0.04, 0.0, 0.0, 0.0, 0.0), (0.1, 0.13, 0.06, 0.1, -0.05, 0.03),
        (0.9, -0.02, -0.05, -0.07, 0.04, -0.1),
    )
)  # fmt: skip

Travel = dict[str, tuple[float, float]]
Read = list[tuple[str, float]]  # properties whose mean is a deflection: name, and rad per unit of it
Executive = Any  # JSBSim's


@dataclass(frozen=True)
class Surfaces:
    """What is known of them. seen: what the aerodynamics call each. read: where the deflection of each is
    found, mean of (property, rad per unit of it). travel, rad; views: what the aerodynamics read, of the
    deflection. notes: what had to be supposed."""

    seen: Mapping[str, Sequence[str]]
    read: Mapping[str, Read]
    travel: Travel
    views: Views
    notes: Sequence[str] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """What the aerodynamics call any of them."""
        return tuple(name for names in self.seen.values() for name in names)

    def deflection(self, fdm: Executive, surface: str) -> float:
        """Where its own flight control has put a surface, rad."""
        return float(np.mean([fdm[name] * per_unit for name, per_unit in self.read[surface]]))


@dataclass(frozen=True)
class Difference:
    """Where the copy is farthest off the model when a surface moves. share: of what whole travels do about
    the axis. because: properties that the aerodynamics see at another value in the copy."""

    surface: str
    share: float
    axis: str
    deflection_rad: float
    because: tuple[str, ...]

    def __str__(self) -> str:
        they = "is" if len(self.because) == 1 else "are"
        why = f", since {', '.join(self.because)} {they} elsewhere in the copy" if self.because else ""
        if self.share < _NOTHING:
            return f"{_NOTHING:.2%}"
        at = f"with {self.surface} at {degrees(self.deflection_rad):.1f} deg"
        return f"{self.share:.2%} in {self.axis} {at}{why}"


def find_surfaces(source: Path, own: Path, named: Mapping[str, Sequence[str]]) -> Surfaces:
    """The surfaces of a model. own: a copy in which nothing is changed that moves it. named: as an envelope
    file names surfaces.

    Raises BadInput, with the names that are read and those wanted, where there are not enough; and where what
    the aerodynamics read of a surface is no function of its deflection.
    """
    _check_names(source, named)
    seen = surfaces_of(source, named)
    others = others_of(source, [name for names in seen.values() for name in names])
    unknown = {s: moved for s in SURFACES if s not in seen and (moved := moved_by(own, s, others))}
    if unknown or "elevator" not in seen or len(seen) < 2:
        raise BadInput(_names_wanted(source, seen, unknown, others))
    read, travel, views, notes = {}, {}, {}, list[str]()
    for surface, names in seen.items():
        found = _measured(own, surface, names, surface in named)
        read[surface], travel[surface], views[surface], said = found
        notes += said
    notes += [
        f"it has no {surface}: its command moves nothing that its aerodynamics read"
        for surface in SURFACES
        if surface not in seen
    ]
    return Surfaces(seen, read, travel, views, tuple(notes))


def moved_by(model: Path, surface: str, names: Sequence[str]) -> list[str]:
    """Which of these properties the command of a surface moves; model: a copy that writes no files."""
    still, moved = (settled(model, {f"fcs/{surface}-cmd-norm": to}, names) for to in (0.0, 1.0))
    return [name for name, a, b in zip(names, still, moved, strict=True) if abs(a - b) > _MOVES]


def _check_names(source: Path, named: Mapping[str, Sequence[str]]) -> None:
    known, surface_of = seen_by_aerodynamics(source), dict[str, str]()
    for surface, names in named.items():
        for name in names:
            if surface_of.setdefault(name, surface) != surface:
                says = f"surfaces.{surface}: {name!r} is that of {surface_of[name]}"
                raise BadInput(f"{says}, allowed: one surface, one command")
            if name not in known:
                of_control = ", ".join(sorted(of for of in known if of.startswith("fcs/"))) or "none of fcs/"
                raise BadInput(
                    f"surfaces.{surface}: {source.stem}'s aerodynamics do not read {name!r}, allowed: "
                    f"{of_control}"
                )


def _names_wanted(
    source: Path, seen: Iterable[str], unknown: Mapping[str, Sequence[str]], others: Sequence[str]
) -> str:
    """What is read, what is wanted, and the map that gives it."""
    has = f"by a known name only {', '.join(seen)}" if seen else "no surface by a known name"
    of_control = ", ".join(others) or "nothing else"
    says = f"{source.stem}: its aerodynamics read {has}; of its flight control they read {of_control}"
    wanted = ", ".join(POSITIONS.values())
    commands = " and ".join(unknown)
    several = [name for name in others if sum(name in names for names in unknown.values()) > 1]
    if several:
        return (
            f"{says}; {commands} commands both move {', '.join(several)}, allowed: one surface, one command"
        )
    if unknown:
        found = ", ".join(f"{surface}: {_as_yaml(names)}" for surface, names in unknown.items())
        return (
            f"{says}, which {commands} commands move, allowed: {wanted}, or in the file of --envelope "
            f"`surfaces: {{{found}}}`"
        )
    return f"{says}, allowed: {wanted}; one that is moved by its command is none of them"


def _as_yaml(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"[{', '.join(names)}]"


def settled(model: Path, given: Mapping[str, float], names: Sequence[str]) -> list[float]:
    """These properties once its own flight control has had time to answer to what is given."""
    fdm = bare(model)
    with translated(model):
        for name, value in given.items():
            fdm[name] = value
        _held(fdm, _FRAMES)
    return [float(fdm[name]) for name in names]


def _held(fdm: Executive, frames: int) -> None:
    """Let time pass for its flight control, while it flies nowhere."""
    for k in range(frames):
        if k % 10 == 0:
            fdm.run_ic()
        fdm.run()


def _swept(model: Path, surface: str, names: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """These properties, (commands, names), and the angular accelerations, (commands, 3), as the command of a
    surface goes from stop to stop."""
    fdm, rows, turned = bare(model), [], []
    with translated(model):
        for k, command in enumerate(np.linspace(-1.0, 1.0, _COMMANDS).tolist()):
            fdm[f"fcs/{surface}-cmd-norm"] = command
            _held(fdm, _FRAMES_OF_STEP if k else _FRAMES)
            rows.append([fdm[name] for name in names])
            _place(fdm, {})
            turned.append([fdm[name] for name in _ACCELERATIONS[3:]])
    return np.array(rows), np.array(turned)


def _measured(
    own: Path, surface: str, names: Sequence[str], is_named: bool
) -> tuple[Read, tuple[float, float], dict[str, View], list[str]]:
    """Where the deflection of a surface is found, its travel, what the aerodynamics read of it, and notes.

    The deflection is the first over which its moment is a straight line, else that over which it is nearest
    to one: of ailerons that move differently the mean, of a normalised elevator the share of its travel.
    """
    usual = POSITIONS[surface]  # beside a share of the travel, it may say the angle
    first = [usual] if usual in names else []
    tried = list(dict.fromkeys(names if is_named else (*first, *names, usual)))
    ends = np.array([settled(own, {f"fcs/{surface}-cmd-norm": to}, tried) for to in (-1.0, 1.0)])
    reads = [read for read in _deflections(tried, names, ends) if _to_both_sides(_of(read, tried, ends))]
    if not reads:
        travel = -LIKELY_TRAVEL_RAD, LIKELY_TRAVEL_RAD
        says = f"its own flight control does not move it to both sides; {travel[1]:g} rad is supposed"
        read = [(tried[0], 1.0 / unit_of(tried[0]) if isfinite(unit_of(tried[0])) else travel[1])]
        return read, travel, {name: usual_view(name, travel) for name in names}, [f"{surface}: {says}"]
    swept, turned = _swept(own, surface, tried)
    fits = [(read, *_views(read, tried, names, ends, swept)) for read in reads]
    off = [
        off_line(_of(read, tried, swept), turned) if None not in of.values() else inf for read, _, of in fits
    ]
    if not isfinite(min(off)):
        lost = ", ".join(name for name, view in fits[0][2].items() if view is None)
        raise BadInput(
            f"{surface}: as its command goes from stop to stop {lost} is not a function of {reads[0][0][0]}, "
            "allowed: aerodynamics that see one deflection"
        )
    nearest = next(i for i, share in enumerate(off) if share <= max(min(off) + _STRAIGHT, _STRAIGHT))
    read, travel, views = fits[nearest]
    known = {name: view for name, view in views.items() if view is not None}
    return read, travel, known, [f"{surface}: {says}" for says in _said_of(read, reads[0])]


def _deflections(tried: Sequence[str], names: Sequence[str], ends: np.ndarray) -> list[Read]:
    """What may be the deflection: each property that is tried, angles first, shares of the travel as long;
    then the mean of all that the aerodynamics read and the command moves, of one sign. ends (2, tried): at
    either stop."""
    units = {name: unit_of(name) for name in tried}
    rad = {name: 1.0 / unit if isfinite(unit) else LIKELY_TRAVEL_RAD for name, unit in units.items()}
    angles = [name for name in tried if isfinite(units[name])]
    moved = {name: float(by) for name, by in zip(tried, ends[1] - ends[0], strict=True) if abs(by) > _MOVES}
    signed = [name for name in tried if name in moved and isinstance(usual_view(name, (-1.0, 1.0)), float)]
    signed.sort(key=lambda name: name not in angles)
    if signed and signed[0] in angles:
        whole = rad[signed[0]] * moved[signed[0]]
        rad |= {name: abs(whole / moved[name]) for name in signed if name not in angles}
    together = [(n, float(np.copysign(rad[n], moved[n] * moved[signed[0]]))) for n in signed if n in names]
    return [*([(name, rad[name])] for name in signed), *([together] if len(together) > 1 else [])]


def _of(read: Read, tried: Sequence[str], values: np.ndarray) -> np.ndarray:
    """The deflection, rad, of values (n, tried)."""
    return np.mean([size * values[:, tried.index(name)] for name, size in read], axis=0)


def _views(
    read: Read, tried: Sequence[str], names: Sequence[str], ends: np.ndarray, swept: np.ndarray
) -> tuple[tuple[float, float], dict[str, View | None]]:
    """The travel of a deflection, and what the aerodynamics read as functions of it; None of one that is
    none."""
    travel, deflection = _travel(_of(read, tried, ends)), _of(read, tried, swept)
    found: dict[str, View | None] = {}
    for name in names:
        if [name] == [of for of, _ in read]:
            found[name] = 1.0 / read[0][1]
        else:
            found[name] = view_of(deflection, swept[:, tried.index(name)], usual_view(name, travel))
    return travel, found


def off_line(deflection: np.ndarray, accelerations: np.ndarray) -> float:
    """How far the angular acceleration that a deflection (n,) changes most is off a straight line over it, of
    the accelerations (n, 3), as a share of its whole change."""
    size = np.ptp(accelerations, axis=0)
    if not isfinite(size.sum()):
        return 0.0
    turned = accelerations[:, size.argmax()]
    rest = turned - np.polyval(np.polyfit(deflection, turned, 1), deflection)
    return float(np.ptp(rest) / size.max()) if size.max() > 0.0 else 0.0


def _said_of(read: Read, first: Read) -> Iterator[str]:
    """What is to be known of a deflection that is not an angle of the model's own."""
    if not any(isfinite(unit_of(name)) for name, _ in first):
        yield f"nothing says its travel as an angle; {LIKELY_TRAVEL_RAD:g} rad is supposed"
    elif len(read) > 1:
        yield f"its deflection is the mean of {', '.join(name for name, _ in read)}"
    elif not isfinite(unit_of(read[0][0])):
        yield f"its deflection is {read[0][0]}, {read[0][1]:.4g} rad for 1, since its aerodynamics read that"


def _to_both_sides(ends: np.ndarray) -> bool:
    low, high = sorted(ends.tolist())
    return isfinite(low) and isfinite(high) and low < -LEAST_TRAVEL_RAD and high > LEAST_TRAVEL_RAD


def _travel(ends: np.ndarray) -> tuple[float, float]:
    low, high = sorted(ends.tolist())
    return round(max(low, -MOST_TRAVEL_RAD), 5), round(min(high, MOST_TRAVEL_RAD), 5)


def view_of(deflection: np.ndarray, value: np.ndarray, usual: View) -> View | None:
    """Values (n,) as a function of deflections (n,) rad: the usual one if it fits, else points; None where
    a deflection has several values."""
    if np.abs(value - evaluated(usual, deflection)).max() <= _SAME * np.ptp(evaluated(usual, deflection)):
        return usual
    order = np.argsort(deflection, kind="stable")
    at, of = deflection[order], value[order]
    same = _MOVES * np.ptp(at)
    starts = np.flatnonzero(np.concatenate([[True], np.diff(at) > same]))
    groups = list(zip(starts, [*starts[1:], at.size], strict=True))
    if max(np.ptp(of[a:b]) for a, b in groups) > _SAME * max(np.ptp(of), np.finfo(float).tiny):
        return None
    points = [(float(at[a:b].mean()), float(of[a:b].mean())) for a, b in groups]
    kept = _corners(points, _ON_LINE * max(np.ptp(of), np.finfo(float).tiny))
    if len(kept) == 2:
        gain = (kept[1][1] - kept[0][1]) / (kept[1][0] - kept[0][0])
        if abs(kept[0][1] - gain * kept[0][0]) <= _ON_LINE * np.ptp(of):
            return float(gain)
    return tuple(kept)


def evaluated(view: View, deflection: np.ndarray) -> np.ndarray:
    """What the aerodynamics read at these deflections, rad."""
    if isinstance(view, float):
        return view * deflection
    at, of = np.array(view).T
    return np.interp(deflection, at, of)


def _corners(points: list[tuple[float, float]], off: float) -> list[tuple[float, float]]:
    """The points without those that are on a straight line between others."""
    if len(points) <= 2:
        return points
    (a, fa), (b, fb) = points[0], points[-1]
    away = [abs(f - fa - (fb - fa) * (x - a) / (b - a)) for x, f in points]
    worst = int(np.argmax(away))
    if away[worst] <= off:
        return [points[0], points[-1]]
    return _corners(points[: worst + 1], off)[:-1] + _corners(points[worst:], off)


def differences(
    own: Path, copy: Path, surfaces: Surfaces, airspeed_mps: tuple[float, float]
) -> list[Difference]:
    """Where the copy is farthest off the model as each surface goes from stop to stop, the others at rest,
    and as all go together; in several states, the surfaces of both where the model's flight control has put
    them."""
    fdm = bare(own)
    get_node = fdm.get_property_manager().get_node
    seen = [name for name in sorted(seen_by_aerodynamics(own)) if get_node(name) is not None]
    in_copy = [view_property(name, surfaces.views) for name in seen]
    ways = [{surface: 1.0} for surface in surfaces.read]
    ways += [{surface: (-1.0) ** i for i, surface in enumerate(surfaces.read)}]
    found = [_flown(own, copy, surfaces, way, airspeed_mps, (seen, in_copy)) for way in ways]
    # (ways, commands, states, axes): accelerations of the model
    spans = np.array([np.ptp(of.model, axis=0).max(axis=0) for of in found]).max(axis=0)
    spans = np.maximum(spans, [_LEAST_FT_S2] * 3 + [_LEAST_SHARE * spans[3:].max()] * 3)
    return [of.worst(spans, " and ".join(way), seen) for of, way in zip(found, ways, strict=True)]


@dataclass(frozen=True)
class _Flown:
    """Accelerations of the model and of the copy, and what their aerodynamics see, (commands, states, ...);
    deflection (commands, states, 1), rad, of the first surface that moves."""

    model: np.ndarray
    copy: np.ndarray
    seen: np.ndarray
    seen_in_copy: np.ndarray
    deflection: np.ndarray

    def worst(self, spans: np.ndarray, surface: str, seen: Sequence[str]) -> Difference:
        """The largest difference, as a share of these spans of the accelerations."""
        shares = np.abs(self.copy - self.model) / spans
        shares[np.isnan(self.copy) & np.isnan(self.model)] = 0.0
        command, state, axis = np.unravel_index(int(np.nan_to_num(shares, nan=inf).argmax()), shares.shape)
        place = command, state
        off = np.abs(self.seen - self.seen_in_copy)[place]
        size = np.ptp(self.seen, axis=(0, 1)) + _MOVES
        of_size = [of if name.startswith(_CAUSES) else 0.0 for name, of in zip(seen, off / size, strict=True)]
        least = max(DIFFERENT, _OF_LARGEST * max(of_size, default=0.0))
        because = [name for name, of in zip(seen, of_size, strict=True) if of > least]
        share, rad = float(shares[(*place, axis)]), float(self.deflection[place][0])
        return Difference(surface, share, _AXES[axis], rad, tuple(because))


def _flown(
    own: Path, copy: Path, surfaces: Surfaces, way: Mapping[str, float], airspeed_mps: tuple[float, float],
    names: tuple[Sequence[str], Sequence[str]],
) -> _Flown:  # fmt: skip
    pair, rows = (bare(own), bare(copy)), list[Any]()
    with translated(own):
        for fdm in pair:
            fdm[POWER_LEVER] = 0.0
        for surface in surfaces.read:  # its own flight control moves it further in other states
            pair[1][f"actuators/{surface}/position-min-rad"] = -_ANYWHERE_RAD
            pair[1][f"actuators/{surface}/position-max-rad"] = _ANYWHERE_RAD
        for k, command in enumerate(np.linspace(-1.0, 1.0, _COMPARED).tolist()):
            for surface, share in way.items():
                pair[0][f"fcs/{surface}-cmd-norm"] = share * command
            for fdm in pair:
                _held(fdm, _FRAMES_OF_STEP if k else _FRAMES)
            rows.append(
                [_in_state(pair, surfaces, state, airspeed_mps, names, next(iter(way))) for state in _STATES]
            )
    return _Flown(*(np.array([[of[i] for of in row] for row in rows]) for i in range(5)))


def _in_state(
    pair: tuple[Executive, Executive], surfaces: Surfaces, state: Mapping[str, float],
    airspeed_mps: tuple[float, float], names: tuple[Sequence[str], Sequence[str]], surface: str,
) -> tuple[list[float], ...]:  # fmt: skip
    """Accelerations and what is seen, of the model and of the copy; and the deflection of a surface."""
    low, high = airspeed_mps
    placed = {**state, "ic/vt-fps": (low + state["ic/vt-fps"] * (high - low)) / M_PER_FT}
    own, copy = pair
    _place(own, placed)
    for name in surfaces.read:
        copy[f"fcs/{ACTUATED}{name}-cmd-rad"] = surfaces.deflection(own, name)
    _place(copy, placed)
    accelerations = [[fdm[name] for name in _ACCELERATIONS] for fdm in pair]
    seen = [[fdm[name] for name in of] for fdm, of in zip(pair, names, strict=True)]
    return (*accelerations, *seen, [surfaces.deflection(own, surface)])


def _place(fdm: Executive, state: Mapping[str, float]) -> None:
    """Put it into a state, time standing still."""
    for name, value in state.items():
        fdm[name] = value
    fdm.run_ic()
    fdm.suspend_integration()
    for _ in range(_RUNS_TO_SETTLE):
        fdm.run()
    fdm.resume_integration()
