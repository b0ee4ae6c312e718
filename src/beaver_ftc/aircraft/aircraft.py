"""An aircraft as the rest of the package sees it, and how it comes from what a scenario calls it.

`Aircraft` is frozen, with what follows from its file worked out once. `load` finds it: built in, of the
jsbsim package, or in a folder. Before both stand the exact units of JSBSim and of the standards it
follows, in SI, standard gravity and the Earth.
"""

import copyreg
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib.metadata import version
from importlib.util import find_spec
from math import pi, prod, radians
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from beaver_ftc.aircraft.schema import (
    FLOW_SIGNALS,
    SIDESLIP_RATE,
    AircraftFile,
    DamageSection,
    EffectorSection,
    EngineSection,
    EnvelopeSection,
    GeometrySection,
    SignalSection,
    SurfaceSection,
    TermSection,
    TrimSection,
)
from beaver_ftc.documents.document import Problem
from beaver_ftc.documents.errors import BadInput, suggestion
from beaver_ftc.documents.files import PACKAGE, data_root, digest_of_files, inside
from beaver_ftc.documents.report import ScenarioError
from beaver_ftc.documents.validation import parse_document, text_of, validate
from beaver_ftc.plugins import SERVICES, entries

M_PER_FT = 0.3048
KG_PER_LB = 0.45359237
GRAVITY_MPS2 = 9.80665
N_PER_LBF = KG_PER_LB * GRAVITY_MPS2
KG_PER_SLUG = N_PER_LBF / M_PER_FT
EARTH_RATE_RAD_S = 2.0 * pi / 86164.0905  # one turn per sidereal day [WGS84]
EARTH_RADIUS_M = 6_371_000.0  # mean radius: for a local plane and gravity with height, not for navigation


AXES = ("p", "q", "r")
ROLL, PITCH, YAW = range(3)
THRUST_TERM = "CX_dpt"  # what the slipstream of a piston engine adds to the force along the body
LEAST_THRUST = 0.01  # of the weight: what gives less is no engine to fly by
MOMENTS, FORCES = ("Cl", "Cm", "Cn"), ("CX", "CY", "CZ")


@dataclass(frozen=True)
class Term:
    """One term of a coefficient: `value` times powers of signals and, if it has one, a surface's deflection.

    name: e.g. "Cm_alpha"; also the truth's input `uncertainty/<name>-scale`, where the aircraft has it.
    coefficient: Cl, Cm, Cn, CX, CY or CZ. of: (signal, power) pairs. surface: a name, or None.
    """

    name: str
    coefficient: str
    value: float
    of: tuple[tuple[str, int], ...] = ()
    surface: str | None = None
    source: str = ""
    description: str = ""

    @property
    def is_constant(self) -> bool:
        """Whether it multiplies nothing."""
        return not self.of and self.surface is None

    @property
    def factors(self) -> tuple[str, ...]:
        """What it multiplies, one entry a power, its surface first."""
        powers = tuple(signal for signal, power in self.of for _ in range(power))
        return ((self.surface,) if self.surface else ()) + powers


@dataclass(frozen=True)
class MassProperties:
    """Mass kg and inertia kg m2 about the centre of gravity, body axes; Jxz is the product of inertia
    integral of x z dm, so it enters the inertia tensor with a minus sign. Jxy and Jyz are zero."""

    mass_kg: float
    Ix_kg_m2: float
    Iy_kg_m2: float
    Iz_kg_m2: float
    Jxz_kg_m2: float


@dataclass(frozen=True)
class Travel:
    """Travel of one surface, rad."""

    min_rad: float
    max_rad: float


@dataclass(frozen=True, eq=False)
class Aircraft:
    """One aircraft: the data of its file, and the folder with its JSBSim model.

    - `file`: the content of aircraft.yaml.
    - `folder`: path of the folder.

    `surfaces` is a tuple with the names of the surfaces, in the order that all arrays and log columns have.
    `travel` is a mapping from surface to its limits, `min_rad` and `max_rad`.

    Two aircraft are equal only if they are the same object. `load` returns the same object while the file is
    unchanged.
    """

    file: AircraftFile
    folder: Path

    @property
    def name(self) -> str:
        """The name the file gives it."""
        return self.file.name

    @property
    def jsbsim(self) -> Path:
        """Its JSBSim model."""
        return self.folder / self.file.jsbsim

    @cached_property
    def surfaces(self) -> tuple[str, ...]:
        """Names of the surfaces, in the order that all arrays and log columns have."""
        return tuple(self.file.surfaces)

    @property
    def n(self) -> int:
        """How many surfaces there are."""
        return len(self.surfaces)

    @property
    def surface(self) -> Mapping[str, SurfaceSection]:
        """A surface by its name."""
        return MappingProxyType(self.file.surfaces)

    @cached_property
    def travel(self) -> Mapping[str, Travel]:
        """How far each surface goes."""
        return MappingProxyType({name: Travel(*of.travel_rad) for name, of in self.file.surfaces.items()})

    @cached_property
    def groups(self) -> Mapping[str, tuple[str, ...]]:
        """Who can stand in for whom, in the order of hand-over."""
        return MappingProxyType(dict(self.file.groups))

    def effects(self, scale: Mapping[str, float]) -> Mapping[str, list[float]]:
        """What each surface does about p, q and r at `usual_signals`, up to a factor about each axis; `scale`
        as in `coefficient`."""
        mass, geometry = self.mass, self.geometry
        arms = (geometry.span_m / mass.Ix_kg_m2, geometry.chord_m / mass.Iy_kg_m2)
        per_axis = dict(zip(MOMENTS, (*arms, geometry.span_m / mass.Iz_kg_m2), strict=True))
        effect = {surface: [0.0, 0.0, 0.0] for surface in self.surfaces}
        usual = self.usual_signals
        for term in self.moments:
            if term.surface:
                value = term.value * scale.get(term.name, 1.0) * prod(usual[s] ** n for s, n in term.of)
                effect[term.surface][MOMENTS.index(term.coefficient)] += value * per_axis[term.coefficient]
        return effect

    @cached_property
    def dominant_axis(self) -> tuple[int, ...]:
        """Of each surface, the axis (p, q, r) it turns most about, by its terms at `usual_signals`.

        An axis that none turns most about (a rudder high above the wing rolls more than it yaws) is that of
        the surface that turns most about it, of those that share theirs with another.
        """
        effect = self.effects({})
        axes = [max(range(3), key=lambda axis: abs(effect[s][axis])) for s in self.surfaces]
        for axis in set(range(3)) - set(axes):
            turns = {s: abs(effect[name][axis]) for s, name in enumerate(self.surfaces)}
            free = [s for s, size in turns.items() if size > 0.0 and axes.count(axes[s]) > 1]
            if free:
                axes[max(free, key=turns.__getitem__)] = axis
        return tuple(axes)

    @cached_property
    def usual_signals(self) -> Mapping[str, float]:
        """Signals as they are in level flight where the file tells, else zero."""
        usual = dict.fromkeys((*self.signal_names, SIDESLIP_RATE), 0.0)
        if self.file.model_error_map:
            box = self.file.model_error_map.boxes[0]
            ends = {"alpha": box.alpha_rad, **box.signals}
            usual |= {name: 0.5 * (low + high) for name, (low, high) in ends.items()}
        return usual

    @cached_property
    def primary(self) -> tuple[str, ...]:
        """The surface that leads each axis: of those that turn most about it, the first in its group."""
        rank = {s: members.index(s) for members in self.groups.values() for s in members}
        axis = dict(zip(self.surfaces, self.dominant_axis, strict=True))
        leaders = {
            min((s for s in self.surfaces if axis[s] == i), key=rank.__getitem__) for i in set(axis.values())
        }
        return tuple(s for s in self.surfaces if s in leaders)

    @cached_property
    def together(self) -> Mapping[str, tuple[tuple[str, float], ...]]:
        """Of each surface that leads an axis, what trim moves: itself, and what share of the way others."""
        also = {s: self.file.trim.together.get(s, {}).items() for s in self.primary}
        others = {s: [(f, share) for f, share in of if f not in self.primary] for s, of in also.items()}
        return MappingProxyType({s: ((s, 1.0), *others[s]) for s in self.primary})

    @cached_property
    def left_by_trim(self) -> tuple[str, ...]:
        """Surfaces that trim leaves where they are."""
        moved = {surface for of in self.together.values() for surface, _ in of}
        return tuple(s for s in self.surfaces if s not in moved)

    @cached_property
    def stand_ins(self) -> tuple[str, ...]:
        """Those that take over from the surface that leads pitch: who comes after it in its group."""
        axis = dict(zip(self.surfaces, self.dominant_axis, strict=True))
        for members in self.groups.values():
            for place, surface in enumerate(members):
                if surface in self.primary and AXES[axis[surface]] == "q":
                    return members[place + 1 :]
        return ()

    @cached_property
    def class_of_losses(self) -> tuple[str, ...]:
        """The surfaces whose loss of effectiveness is in the published fault class: the primary surface of
        each axis, then all others except those that take over from the elevator. The losses of a primary
        surface and of one that takes over its axis cannot be distinguished."""
        others = set(self.surfaces) - set(self.primary) - set(self.stand_ins)
        return (*self.primary, *(s for s in self.surfaces if s in others))

    @property
    def damage(self) -> Mapping[str, DamageSection]:
        """Cases of damage that a scenario may inflict, by name."""
        return MappingProxyType(self.file.damage)

    @cached_property
    def loses_surfaces(self) -> bool:
        """Whether a case of damage takes any surface."""
        return any(case.takes for case in self.damage.values())

    @property
    def signals(self) -> Mapping[str, SignalSection]:
        """Declared signals beside rates, alpha, beta, airspeed and dynamic pressure."""
        return MappingProxyType(self.file.signals)

    @cached_property
    def signal_names(self) -> tuple[str, ...]:
        """What a term may multiply, in the order of the evaluator."""
        return (*FLOW_SIGNALS, *self.file.signals)

    @cached_property
    def mass(self) -> MassProperties:
        """Mass (nan where the file gives none) and inertia."""
        given = self.file.mass
        mass_kg = float("nan") if given.mass_kg is None else given.mass_kg
        return MassProperties(mass_kg, given.Ix_kgm2, given.Iy_kgm2, given.Iz_kgm2, given.Jxz_kgm2)

    @property
    def geometry(self) -> GeometrySection:
        """Reference dimensions."""
        return self.file.geometry

    @cached_property
    def moments(self) -> tuple[Term, ...]:
        """Terms of Cl, Cm and Cn: of each the constant, the others without a surface, those with one.

        A coefficient without a constant term has one that is zero: errors of the sensors are counted there.
        """
        return _sorted(self.file.moments, MOMENTS, constants=True)

    @cached_property
    def forces(self) -> tuple[Term, ...]:
        """Terms of CX, CY and CZ, in the same order; none where the file has none."""
        return _sorted(self.file.forces, FORCES) if self.file.forces else ()

    @cached_property
    def measurable_forces(self) -> tuple[Term, ...]:
        """The same without what multiplies the rate of sideslip."""
        return tuple(term for term in self.forces if all(signal != SIDESLIP_RATE for signal, _ in term.of))

    def separated_by_force(self, force: str) -> tuple[int, ...]:
        """Indices of surfaces that a measured force can distinguish, but the body rates cannot.

        - `force`: `CZ` selects the surfaces of pitch, which differ in lift. `CY` selects the other surfaces.

        The tuple is empty if it would contain only one surface.
        """
        moved = {term.surface for term in self.measurable_forces if term.coefficient == force}
        lead = enumerate(zip(self.surfaces, self.dominant_axis, strict=True))
        found = tuple(s for s, (name, axis) in lead if (axis == 1) == (force == "CZ") and name in moved)
        return found if len(found) > 1 else ()

    @cached_property
    def forces_separate_surfaces(self) -> bool:
        """Whether the side or the normal force distinguishes any surfaces."""
        return any(self.separated_by_force(force) for force in ("CY", "CZ"))

    @cached_property
    def terms(self) -> Mapping[str, Term]:
        """Every term by its name."""
        named = {term.name for _, _, _, term in self.file.terms()}
        return MappingProxyType({t.name: t for t in (*self.forces, *self.moments) if t.name in named})

    def coefficient(self, name: str, of: Mapping[str, Any], scale: Mapping[str, float] | None = None) -> Any:
        """The value of one aerodynamic coefficient: the sum of its terms in the aircraft file.

        - `name`: e.g. `Cm`.
        - `of`: a mapping from the name of each signal and each surface to its value.
        - `scale`: a mapping from the name of a term to a factor that multiplies this term.

        The sum is plain Python, for occasional use.
        """
        scale = scale or {}
        terms = self._terms_of[name]
        return sum(t.value * scale.get(t.name, 1.0) * prod(of[f] for f in factors) for t, factors in terms)

    @cached_property
    def _terms_of(self) -> Mapping[str, tuple[tuple[Term, tuple[str, ...]], ...]]:
        """The terms of each coefficient, and what they multiply."""
        return {
            name: tuple((term, term.factors) for term in self.terms.values() if term.coefficient == name)
            for name in (*FORCES, *MOMENTS)
        }

    def index(self, term: str) -> int:
        """Index of a term in `moments`. Raises KeyError for a name that is not in the file."""
        return self._places[term]

    @cached_property
    def _places(self) -> dict[str, int]:
        return {term.name: i for i, term in enumerate(self.moments)}

    @property
    def envelope(self) -> EnvelopeSection:
        """Where the terms hold."""
        return self.file.envelope

    @property
    def usual_airspeed_mps(self) -> float:
        """Where its flights start, m/s; the middle of its envelope where its file says nothing."""
        return self.file.start.airspeed_mps or 0.5 * sum(self.envelope.airspeed_mps)

    @cached_property
    def alpha_rad(self) -> tuple[float, float]:
        """Angles of attack of the envelope."""
        low, high = self.file.envelope.alpha_deg
        return radians(low), radians(high)

    @property
    def trim(self) -> TrimSection:
        """What trim may move beside the surfaces."""
        return self.file.trim

    @property
    def model_error_rad_s2(self) -> tuple[float, float, float]:
        """What the terms leave of the angular accelerations, as measured; zero where nobody has."""
        error = self.file.model_error_rad_s2
        return error.p, error.q, error.r

    @property
    def engine(self) -> EngineSection:
        """Settings of the engine a scenario may give."""
        return self.file.engine

    @property
    def effectors(self) -> Mapping[str, EffectorSection]:
        """Engines that turn it where surfaces no longer reach, by name."""
        return MappingProxyType(self.file.effectors)

    @property
    def power_setting(self) -> str:
        """What a scenario and the log call the engine setting that trim moves; empty where there is none."""
        found = self.file.power_setting
        return found[0] if found else ""

    @cached_property
    def airspeed_by(self) -> Literal["power", "pitch", ""]:
        """What holds an airspeed: power, where the file says what it gives; pitch, of an aircraft that has
        none to speak of; nothing where the file is silent."""
        if THRUST_TERM in self.terms:
            return "power"
        if self.engine.thrust is None:
            return "" if self.engine.settings else "pitch"
        most_n = min(row[-1] - row[0] for row in self.engine.thrust.force_n)
        return "power" if most_n > LEAST_THRUST * self.mass.mass_kg * GRAVITY_MPS2 else "pitch"

    @property
    def has_engine_instruments(self) -> bool:
        """Whether its first signal is the slipstream of a piston engine whose speed and manifold pressure can
        be read [FDC]."""
        known = {"engine_rpm", "manifold_pressure_inhg"} <= self.file.engine.settings.keys()
        return known and next(iter(self.file.signals), "") == "dpt"


def main_surface_index_by_axis(aircraft: Aircraft) -> list[int]:
    """Index of the surface that leads each of roll, pitch and yaw. Raises BadInput where none does.

    An aircraft may lack a rudder, or ailerons: what leads the other of roll and yaw then leads both.
    """
    index_by_axis = {
        axis: s
        for s, (name, axis) in enumerate(zip(aircraft.surfaces, aircraft.dominant_axis, strict=True))
        if name in aircraft.primary
    }
    lateral = index_by_axis.get(0, index_by_axis.get(2))
    if lateral is not None:
        index_by_axis = {0: lateral, 2: lateral} | index_by_axis
    for axis, name in enumerate(("roll", "pitch", "yaw")):
        if axis not in index_by_axis:
            raise BadInput(
                f"{aircraft.name}: no surface turns it in {name}, "
                "allowed: in `moments`, a term of some surface about each axis"
            )
    return [index_by_axis[axis] for axis in range(3)]


def _sorted(section: object, coefficients: tuple[str, ...], constants: bool = False) -> tuple[Term, ...]:
    """Terms by coefficient, those without a surface first, of them the constant one."""
    terms: list[Term] = []
    for coefficient in coefficients:
        given: tuple[TermSection, ...] = getattr(section, coefficient)
        as_given = (dict(term) | {"of": tuple(term.of.items())} for term in given)
        of_it = [Term(coefficient=coefficient, **term) for term in as_given]
        if constants and not any(term.is_constant for term in of_it):
            of_it.append(Term(f"{coefficient}_constant", coefficient, 0.0))
        terms += sorted(of_it, key=lambda term: (term.surface is not None, not term.is_constant))
    return tuple(terms)


DEFAULT = "beaver"
FILE = "aircraft.yaml"
# Aircraft of data that others publish: how each comes here.
IMPORTED = {
    "gtm": "`beaver-ftc import gtm DATABASE.mat` of NASA's data base, gtm_design/config/"
    "T2_polynomial_aerodatabase.mat of github.com/nasa/GTM_DesignSim"
}
BESIDE, FROM_JSBSIM = "./", "jsbsim:"
DERIVED = "# Written by beaver-ftc derive"
# What makes the copy of an aircraft, beside the code of the service `derive`.
_TEMPLATES = "actuator.xml", "instrumented.xml"
_CODE = ".py", ".yaml"
_COPIES = "plant/instrumented.py", "plant/model_file.py"
_MAX_BYTES = 1_000_000
_ALLOWED = "a built-in name, jsbsim:NAME, or ./FOLDER beside the scenario"


# Studies make further scenarios of one that was read from a file, and these are not files themselves.
_SEEN: dict[str, set[Path]] = {}


class UnknownAircraft(BadInput):
    """No such aircraft; the message says what is allowed."""


class NotDerived(UnknownAircraft):
    """An aircraft of the jsbsim package that has no design model in the cache."""


@lru_cache
def builtin_names() -> tuple[str, ...]:
    """Names of the built-in aircraft."""
    return tuple(sorted(path.parent.name for path in _root().glob(f"*/{FILE}")))


def _root() -> Path:
    return data_root() / "aircraft"


def load(reference: str = DEFAULT, beside: Path | None = None) -> Aircraft:
    """Load an aircraft from its file.

    - `reference`: built-in name, `jsbsim:NAME` for a derived aircraft, or `./FOLDER`.
    - `beside`: the folder that contains FOLDER.

    Raises UnknownAircraft for an unknown name, and NotDerived for an aircraft that has not been derived yet.
    Raises ScenarioError with one line for each mistake in the file.
    """
    if not isinstance(reference, str):
        raise UnknownAircraft(f"{reference!r:.60} is no aircraft, allowed: {_ALLOWED}")
    if reference.startswith(FROM_JSBSIM):
        name = reference.removeprefix(FROM_JSBSIM)
        if not is_derived(name):
            says = f"has no design model yet, allowed: what `beaver-ftc derive {reference}` makes"
            raise NotDerived(f"{reference!r} {says}")
        return read(derived_folder(name))
    if reference.startswith(BESIDE):
        return read(_inside(beside, reference))
    if reference in IMPORTED:
        folder = imported_folder(reference)
        if not (folder / FILE).is_file():
            says = f"is not imported yet, allowed: after {IMPORTED[reference]}"
            raise UnknownAircraft(f"{reference!r} {says}")
        return read(folder)
    if reference not in builtin_names():
        raise UnknownAircraft(
            f"{reference!r} is not known{suggestion(reference, builtin_names())}, jsbsim:NAME as "
            "`beaver-ftc list aircraft` has them, ./FOLDER beside the scenario"
        )
    return read(_root() / reference)


def derived_folder(name: str) -> Path:
    """Where `beaver-ftc derive` keeps what it made of an aircraft of the jsbsim package."""
    if not re.fullmatch(r"[A-Za-z0-9_-]{1,60}", name):
        raise UnknownAircraft(f"'jsbsim:{name[:60]}' is no name, allowed: letters, digits, - and _")
    return kept_folder() / "aircraft" / name


def imported_folder(name: str) -> Path:
    """Where `beaver-ftc import` keeps what it made of data that others publish."""
    return kept_folder() / "imported" / name


def kept_folder() -> Path:
    """Where `derive` and `import` keep aircraft."""
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
    return base / "beaver-ftc"


def first_line() -> str:
    """The first line of a file that was derived, by this way of deriving and of this JSBSim."""
    files = [*(_root() / name for name in _TEMPLATES), *(PACKAGE / name for name in _COPIES)]
    service = entries(SERVICES).get("derive", "").partition(":")[0]
    found = find_spec(service) if service else None
    if found and found.origin:
        files += sorted(path for path in Path(found.origin).parent.iterdir() if path.suffix in _CODE)
    return f"{DERIVED}: version {digest_of_files(*files)}, JSBSim {version('jsbsim')}.\n"


def is_derived(name: str) -> bool:
    """Whether the cache has an aircraft of the jsbsim package as it would be derived now."""
    try:
        with (derived_folder(name) / FILE).open(encoding="utf-8") as file:
            return file.readline() == first_line()
    except OSError:
        return False


def _inside(beside: Path | None, reference: str) -> Path:
    """The folder's path if it is below the scenario's own: a scenario reads nothing else.

    Without a scenario's folder: what the reference has stood for in this process, if that is one folder.
    """
    if beside is None:
        seen = _SEEN.get(reference, set())
        if len(seen) != 1:
            raise UnknownAircraft(
                f"there is no folder to find {reference!r} in, allowed: ./FOLDER in a scenario that is a file"
            )
        return next(iter(seen))
    root, folder = beside.resolve(), inside(beside, reference)
    if folder is None:
        raise UnknownAircraft(f"{reference!r} is outside, allowed: a folder below the scenario's own")
    if not folder.is_dir():
        raise UnknownAircraft(f"there is no folder {reference!r}, allowed: {_ALLOWED}")
    for path in sorted(folder.rglob("*")):
        if path.is_symlink() and not path.resolve().is_relative_to(root):
            link = f"{reference}/{path.relative_to(folder)}"
            raise UnknownAircraft(f"{link!r} leads outside, allowed: files below the scenario's own folder")
    _SEEN.setdefault(reference, set()).add(folder)
    return folder


def read(folder: Path) -> Aircraft:
    """The aircraft whose file is in a folder. Raises ScenarioError with one line a mistake."""
    path = folder / FILE
    try:
        changed_ns = path.stat().st_mtime_ns
    except OSError:
        changed_ns = -1
    return _read(folder, changed_ns)


@lru_cache(maxsize=32)
def _read(folder: Path, changed_ns: int) -> Aircraft:
    """`changed_ns`: when the file was last written, so that a changed one is read again."""
    path = folder / FILE
    document = parse_document(text_of(path, _MAX_BYTES), str(path), "the keys of an aircraft file")
    file = validate(AircraftFile, document, str(path))
    model = (folder / file.jsbsim).resolve()
    if not model.is_relative_to(folder.resolve()) or not model.is_file():
        wrong = "is not there" if model.is_relative_to(folder.resolve()) else "is outside"
        says = f"{file.jsbsim!r} {wrong}, allowed: a file beside this one"
        raise ScenarioError(str(path), [Problem(document.line(("jsbsim",)), ("jsbsim",), says)])
    return Aircraft(file, folder)


def _reduced(aircraft: Aircraft) -> tuple[Any, ...]:
    """A process that is sent an aircraft reads its file itself."""
    return read, (aircraft.folder,)


copyreg.pickle(Aircraft, _reduced)
