"""A trimmed flight condition and the truth linearised about it, from what a scenario says of them."""

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.configure import configure, trim_of
from beaver_ftc.plant.linear import LinearModel, differences
from beaver_ftc.plant.reuse import borrowed, give_back
from beaver_ftc.plant.trim import TrimPoint
from beaver_ftc.scenario.builtin import texts_of
from beaver_ftc.scenario.schema import Scenario, ScenarioLike, load


def trim(scenario: ScenarioLike | None = None, **initial: float) -> TrimPoint:
    """Steady straight flight, wings level, on the scenario's truth with its errors.

    scenario: a name, a path, a mapping or a Scenario; left out, the defaults. initial: keys of its section
    `initial` in place of its own, e.g. airspeed_mps=40, altitude_m=300, flap_deg=10. Raises BadInput that
    names the key, and for what cannot be trimmed.
    """
    return trimmed(_condition(scenario, initial))[1]


def linearise(scenario: ScenarioLike | None = None, **initial: float) -> LinearModel:
    """The truth about the trimmed flight that `trim` finds: xdot = A x + B u, ten states, the surfaces.

    `.state_space()` gives it as python-control has it. Raises BadInput as `trim` does.
    """
    return differences(*trimmed(_condition(scenario, initial)))


_TRIM_DEPENDS_ON = ("initial", "uncertainty", "actuators")
_MOST_TRIMS = 256
_trims: dict[tuple[object, tuple[str, ...]], TrimPoint] = {}


def ready(scenario: Scenario) -> tuple[Plant, TrimPoint]:
    """A borrowed aircraft with the scenario's errors, and its trim. Raises BadInput.

    A trim does not depend on what was flown before, so one that is known is not computed again. Engines
    remember the search for it: they take off in an aircraft that has not been through one.
    """
    plant = _configured(scenario)
    point, searched = _trim_in(scenario, plant)
    return (_configured(scenario) if searched and plant.n_engines else plant), point


def find_trim(scenario: Scenario) -> TrimPoint:
    """The scenario's trim, kept for its flights. Raises BadInput."""
    plant = _configured(scenario)
    point, _ = _trim_in(scenario, plant)
    give_back(plant)
    return point


def _trim_in(scenario: Scenario, plant: Plant) -> tuple[TrimPoint, bool]:
    """The trim, and whether it was searched for in this aircraft, which is given back if there is none."""
    key = plant.origin, texts_of(scenario, _TRIM_DEPENDS_ON)
    if key in _trims:
        return _trims[key], False
    if len(_trims) >= _MOST_TRIMS:
        _trims.clear()
    try:
        _trims[key] = trim_of(scenario, plant)
    except BadInput:
        give_back(plant)
        raise
    return _trims[key], True


def _configured(scenario: Scenario) -> Plant:
    """A borrowed aircraft with the scenario's errors. Raises BadInput."""
    plant = borrowed(scenario.rate_hz, scenario.substeps, scenario.airframe)
    try:
        configure(plant, scenario)
    except BadInput:
        give_back(plant)
        raise
    return plant


def trimmed(scenario: Scenario) -> tuple[Plant, TrimPoint]:
    """An aircraft with the scenario's errors, left near the trim, and the trim. Raises BadInput."""
    plant = Plant(scenario.rate_hz, scenario.substeps, scenario.airframe)
    configure(plant, scenario)
    return plant, trim_of(scenario, plant)


def _condition(scenario: ScenarioLike | None, initial: dict[str, float]) -> Scenario:
    base = load({} if scenario is None else scenario)
    return base.with_({f"initial.{key}": value for key, value in initial.items()})
