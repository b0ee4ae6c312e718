"""Flight conditions to fly from: an aircraft trimmed as a scenario says, and the truth linearised there.

An aircraft is loaded once and flown many times, each time as freshly loaded, to the bit. What a flight leaves
behind in JSBSim (1.3.3), and what takes it away:

    initial conditions   the attitude and the wind keep a rounding remainder of all that was set before;
                         `run_ic` and a reset leave them alone. A file that states everything: at_rest.xml,
                         short, for it is read twice a flight.
    the models           integrators, controls, turbulence, time: `reset_to_initial_conditions`.
    a gust               its direction, until it has blown over; no reset clears it. It is let blow over.
    settings             written back; a property that is written through the plant is remembered.
    random numbers       a flight in turbulence seeds its own.

Aircraft with engines are loaded again: what their engines remember is more than this.
"""

import os
from functools import lru_cache
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.addresses import executive_address
from beaver_ftc.plant.trim import TrimPoint
from beaver_ftc.plant.true_aircraft import configure, take_off, trim_of
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.kept import texts_of
from beaver_ftc.scenario.schema import Scenario, ScenarioLike, load
from beaver_ftc.scenario.truth import Truth

if TYPE_CHECKING:
    from beaver_ftc.plant.linear import LinearModel


_MODELS_ONLY = 2  # of `reset_to_initial_conditions`: initialise every model, do not run
_GUST = "atmosphere/cosine-gust"
_SHORTEST_S = 1e-9
_MOST = 8  # kept of one aircraft: more than this are hardly ever in the air at the same time

_free: dict[object, list[Plant]] = {}


def borrowed(rate_hz: float, substeps: int, aircraft: Aircraft) -> Plant:
    """An aircraft as freshly loaded: one that was given back, or a new one.

    Loaded again, within a second, when one of its files has changed.
    """
    origin = _origin(aircraft)
    try:
        plant = _free.get(origin, []).pop()
    except IndexError:
        plant = Plant(rate_hz, substeps, aircraft)
        plant.origin = origin
        if plant.native and not plant.n_engines:
            plant.executive = executive_address(plant.fdm)
    renew(plant, rate_hz, substeps)
    return plant


def _origin(aircraft: Aircraft) -> object:
    """The aircraft and when its files were last written."""
    return aircraft, _last_written_ns(aircraft.jsbsim, int(monotonic()))


def give_back(plant: Plant) -> None:
    """Return it to the pool; nothing that reads or writes its properties may be used afterwards."""
    if plant.origin is None or plant.n_engines:
        return
    others = _free.setdefault(plant.origin, [])
    if len(others) < _MOST and plant not in others:
        others.append(plant)


def renew(plant: Plant, rate_hz: float, substeps: int) -> None:
    """Take every trace of flying out of an aircraft without engines."""
    if plant.n_engines:
        return
    plant.fdm.reset_to_initial_conditions(_MODELS_ONLY)
    if f"{_GUST}/start" in plant.as_loaded:
        _blow_over(plant)
        plant.fdm.reset_to_initial_conditions(_MODELS_ONLY)
    for name, value in plant.as_loaded.items():
        if not name.startswith(("ic/", _GUST)):
            plant.write(name, value)
    plant.set_rate(rate_hz, substeps)


def _blow_over(plant: Plant) -> None:
    """Let a gust of hardly any duration begin and end."""
    for part in ("startup", "steady", "end"):
        plant.write(f"{_GUST}/{part}-duration-sec", _SHORTEST_S)
    plant.write(f"{_GUST}/start", 1.0)
    plant.run()


@lru_cache(maxsize=32)
def _last_written_ns(model: Path, second: int) -> tuple[int, ...]:
    """When the model and its systems were last written, as looked at in this second: looking takes time."""
    return tuple(os.stat(file).st_mtime_ns for file in _files_of(model))


@lru_cache(maxsize=32)
def _files_of(model: Path) -> tuple[str, ...]:
    return tuple(map(str, (model, *sorted((model.parent / "Systems").glob("*.xml")))))


def trim(scenario: ScenarioLike | None = None, **initial: float) -> TrimPoint:
    """Trim the simulated aircraft of a scenario in steady, straight flight with wings level. The aircraft has
    the errors that the scenario gives to the truth.

    - `scenario`: a built-in name, the path of a file, a mapping or a `Scenario`. By default a scenario with
      all defaults is used.
    - `initial`: keys of the section `initial`. Their values replace those of the scenario, e.g.
      `airspeed_mps=40, altitude_m=300, flap_deg=10`.

    Raises BadInput if a key or value is wrong, and if no trim exists.
    """
    return trimmed(_condition(scenario, initial))[1]


def linearise(scenario: ScenarioLike | None = None, **initial: float) -> "LinearModel":
    """Linear model xdot = A x + B u of the simulated aircraft of a scenario, about its trim.

    The ten states are airspeed (m/s), alpha, beta (rad), p, q, r (rad/s), phi, theta, psi (rad) and altitude
    (m). The fields `states` and `inputs` of the result contain the names of the states and of the surfaces.
    The arguments and exceptions are the same as for `trim`. The method `state_space` of the result returns
    the model for python-control.
    """
    from beaver_ftc.plant.linear import differences

    return differences(*trimmed(_condition(scenario, initial)))


_MOST_KNOWN_TRIMS = 256
_known_trims: dict[object, "KnownTrim"] = {}


class KnownTrim(NamedTuple):
    """The trim that the designer knows: rates x (3,) rad/s, the measured signals y beside them, without
    errors, and the surfaces u (n,) rad."""

    x: np.ndarray
    y: np.ndarray
    u: np.ndarray


def known_trim(declared: Declared) -> KnownTrim:
    """The trim of the aircraft in its file, at the start of the flight and in still air. The designer finds
    it without the truth: neither its errors nor its air are in it. Raises BadInput if there is none.
    """
    nominal, aircraft = Truth.as_declared(declared), declared.aircraft
    key = _origin(aircraft), texts_of(nominal, ("initial", "actuators")), (nominal.rate_hz, nominal.substeps)
    if key not in _known_trims:
        if len(_known_trims) >= _MOST_KNOWN_TRIMS:
            _known_trims.clear()
        plant, point = ready(nominal)
        take_off(plant, nominal, point)
        from beaver_ftc.plant import channels as compiled  # needs the compiler, which only flights load

        channels = compiled.truth_channels(aircraft)
        readings = np.array([plant.read(name) * factor for _, name, factor in channels])
        give_back(plant)
        y = readings[compiled.signal_places(aircraft.n, len(aircraft.signals))]
        _known_trims[key] = KnownTrim(readings[:3], y, np.array(list(point.surfaces_rad.values())))
    return _known_trims[key]


_TRIM_DEPENDS_ON = ("initial", "uncertainty", "actuators")
_MOST_TRIMS = 256
_trims: dict[tuple[object, tuple[str, ...]], TrimPoint] = {}


def ready(truth: Truth) -> tuple[Plant, TrimPoint]:
    """A borrowed aircraft with its errors, and its trim. Raises BadInput.

    A trim does not depend on what was flown before, so one that is known is not computed again. Engines
    remember the search for it: they take off in an aircraft that has not been through one.
    """
    plant = _configured(truth)
    point, searched = _trim_in(truth, plant)
    return (_configured(truth) if searched and plant.n_engines else plant), point


def forget_trims() -> None:
    """Let every trim be searched for again."""
    _trims.clear()


def find_trim(scenario: Scenario) -> TrimPoint:
    """The scenario's trim, kept for its flights. Raises BadInput."""
    truth = Truth.of(scenario)
    plant = _configured(truth)
    point, _ = _trim_in(truth, plant)
    give_back(plant)
    return point


def _trim_in(truth: Truth, plant: Plant) -> tuple[TrimPoint, bool]:
    """The trim, and whether it was searched for in this aircraft, which is given back if there is none."""
    key = plant.origin, texts_of(truth, _TRIM_DEPENDS_ON)
    if key in _trims:
        return _trims[key], False
    if len(_trims) >= _MOST_TRIMS:
        _trims.clear()
    try:
        _trims[key] = trim_of(truth, plant)
    except BadInput:
        give_back(plant)
        raise
    return _trims[key], True


def _configured(truth: Truth) -> Plant:
    """A borrowed aircraft with its errors. Raises BadInput."""
    plant = borrowed(truth.rate_hz, truth.substeps, truth.aircraft)
    try:
        configure(plant, truth)
    except BadInput:
        give_back(plant)
        raise
    return plant


def trimmed(scenario: Scenario) -> tuple[Plant, TrimPoint]:
    """An aircraft with the scenario's errors, left near the trim, and the trim. Raises BadInput."""
    truth = Truth.of(scenario)
    plant = Plant(truth.rate_hz, truth.substeps, truth.aircraft)
    configure(plant, truth)
    return plant, trim_of(truth, plant)


def _condition(scenario: ScenarioLike | None, initial: dict[str, float]) -> Scenario:
    base = load({} if scenario is None else scenario)
    return base.with_({f"initial.{key}": value for key, value in initial.items()})
