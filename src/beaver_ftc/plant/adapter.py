"""JSBSim for the rest of the package: a silent executive with an aircraft loaded, its properties by name, and
what fixes its state at one instant.
"""

import os
import re
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from itertools import count, takewhile
from math import cos, sin
from operator import sub
from pathlib import Path
from typing import Any, Self

import jsbsim
import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft, load
from beaver_ftc.aircraft import load as load_aircraft
from beaver_ftc.aircraft.aircraft import M_PER_FT, N_PER_LBF, kept_folder
from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.documents.files import data_root
from beaver_ftc.plant.addresses import available
from beaver_ftc.plant.model_file import check_model_has_no_side_effects, package, shared

START_LATITUDE_DEG = 45.0
_STATES = ("alpha_rad", "beta_rad", "p_rad_s", "q_rad_s", "r_rad_s", "phi_rad", "theta_rad", "psi_rad")
_AT_ZERO = dict.fromkeys(_STATES, 0.0)


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
        known = type(self).__dataclass_fields__
        for name in [name for name in given if name not in known]:
            surface = name.removesuffix("_rad")
            if name in settings:
                settings[name] = given.pop(name)
            elif surface != name and surface in surfaces_rad:
                surfaces_rad[surface] = given.pop(name)
            else:
                raise TypeError(f"a flight condition has no {name!r}")
        values = {"airspeed_mps": airspeed_mps, "altitude_m": altitude_m, **_AT_ZERO, **given}
        self.__dict__.update(values, surfaces_rad=surfaces_rad, settings=settings)

    def __getattr__(self, name: str) -> float:
        own = self.__dict__
        if name.endswith("_rad") and name[: -len("_rad")] in own.get("surfaces_rad", ()):
            return own["surfaces_rad"][name[: -len("_rad")]]
        if name in own.get("settings", ()):
            return own["settings"][name]
        raise AttributeError(name)

    def as_dict(self) -> dict[str, Any]:
        """All attributes by name: states, `<surface>_rad` and engine settings."""
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


FT_PER_M = 1.0 / M_PER_FT
_LONGEST_REASON = 300
PA_PER_PSF = N_PER_LBF / M_PER_FT**2

_AT_REST = data_root() / "aircraft" / "at_rest.xml"

# betadot enters the side force with the value of the previous run; each further run at the same state
# divides the error by more than 100 (CY_betadot qdyn S b / 2 m V^2 is at most 0.01), so five leave nothing
# above rounding.
_RUNS_TO_SETTLE = 5
_ANGULAR_ACCELERATIONS = tuple(f"accelerations/{axis}dot-rad_sec2" for axis in AXES)

# What places an aircraft. Body velocity after the attitude: JSBSim keeps what was set last when an earlier
# quantity changes.
_PLACED = (
    "ic/lat-geod-deg", "ic/long-gc-deg", "ic/h-sl-ft", "ic/phi-rad", "ic/theta-rad", "ic/psi-true-rad",
    "ic/u-fps", "ic/v-fps", "ic/w-fps", "ic/p-rad_sec", "ic/q-rad_sec", "ic/r-rad_sec",
)  # fmt: skip

_RUN_UP_S = 10.0  # in which a started engine comes to speed; a propeller's governor takes a few
_BETWEEN_PLACINGS_S = 0.1  # the aircraft is put back where it was, so that it flies nowhere meanwhile
_STARTING = {"propulsion/magneto_cmd": 3.0, "propulsion/cutoff_cmd": 0.0, "propulsion/starter_cmd": 1.0}


class UnknownProperty(SimulationFailed):
    """A property the aircraft does not have. JSBSim itself would create it and read back whatever was set."""


_ABSENT = re.compile(r"The property ([^ ]+) does not exist")


class _Errors(jsbsim.FGLogger):
    """Keeps JSBSim off the standard streams; remembers what it said about errors."""

    def __init__(self) -> None:
        super().__init__()
        self.said: list[str] = []
        self._grave = False

    @property
    def reason(self) -> str:
        """What went wrong, as one line without paths."""
        said = " ".join("".join(self.said).split()) or "no reason given"
        if missing := re.search(r"Could not open file: ([^ ]+)", said):
            said = f"it needs the file {missing[1].removesuffix('.xml')}.xml, which is not there"
        return re.sub(r"\"?/?(?:[^ \"/]*/)+(?=[^ /\"]*\.xml)", "", said)[:_LONGEST_REASON]

    def set_level(self, level):
        self._grave = level in (jsbsim.LogLevel.ERROR, jsbsim.LogLevel.FATAL)

    def message(self, message):
        if self._grave:
            self.said.append(message)

    def file_location(self, filename, line):
        pass

    def format(self, format):
        pass

    def flush(self):
        pass


# Who listens to JSBSim in each thread, by the thread's number. JSBSim lets go of a thread's logger when the
# thread has ended, without the interpreter's lock: were that the last reference, the process would abort.
_LISTENING: dict[int, _Errors] = {}


def _load(errors: _Errors, model: Path) -> jsbsim.FGFDMExec:
    """An executive with a model; engines, propellers and systems are looked for beside it first.

    Raises BadInput for a model that would act on the machine, SimulationFailed with what JSBSim says of one
    it cannot load.
    """
    check_model_has_no_side_effects(model)
    jsbsim.set_logger(errors)
    _LISTENING[threading.get_ident()] = errors
    fdm = jsbsim.FGFDMExec(str(data_root()))
    fdm.set_debug_level(0)
    fdm.set_output_path(os.devnull)  # which is no folder: should JSBSim write after all, it cannot
    folder = model.parent
    places = [str(folder), *(str(shared(folder, kind)) for kind in ("engine", "systems"))]
    try:
        loaded = fdm.load_model_with_paths(model.stem, *places, False)  # type: ignore  # stub: no model
    except jsbsim.BaseError as error:
        errors.said.append(str(error))
        loaded = False
    if not loaded:
        raise SimulationFailed(f"JSBSim cannot load {folder.name}/{model.name}: {errors.reason}")
    fdm.disable_output()
    return fdm


@contextmanager
def translated(flown: Path | str) -> Iterator[None]:
    """Turn what JSBSim raises while an aircraft is initialised or run into SimulationFailed, one line.

    flown: its model's file, or its name.
    """
    try:
        yield
    except jsbsim.BaseError as error:
        name = flown if isinstance(flown, str) else f"{flown.parent.name}/{flown.name}"
        raise _not_flown(name, error) from None


def _not_flown(name: str, error: jsbsim.BaseError) -> SimulationFailed:
    return SimulationFailed(f"JSBSim cannot fly {name}: {' '.join(str(error).split())}")


def bare(model: Path, absent: list[str] | None = None) -> jsbsim.FGFDMExec:
    """A model in an executive of its own, initialised where it is: to be looked at, not flown.

    absent: properties that nothing gives, at 0; what else nothing gives is added, if a list is given.
    """
    fdm = _load(_Errors(), model)
    for name in absent or ():
        fdm[name] = 0.0
    fdm["ic/h-sl-ft"], fdm["ic/vc-kts"] = 5000.0, 100.0
    with translated(model):
        giving(fdm, fdm.run_ic, absent)
    return fdm


def giving(fdm: jsbsim.FGFDMExec, step: Callable[[], Any], absent: list[str] | None) -> None:
    """Take a step of an executive; each property that it reads and nothing gives is at 0 if there is a list
    to add its name to."""
    while True:
        try:
            step()
            return
        except jsbsim.BaseError as error:
            found = _ABSENT.search(str(error))
            if absent is None or found is None or found[1] in absent:
                raise
            absent.append(found[1])
            fdm[found[1]] = 0.0


def _is_ours(model: Path) -> bool:
    """Whether a model is built in, of the jsbsim package, or was made of such by `derive` or `import`.

    Another's may raise an error in any frame and at any reading, which compiled code cannot catch: the
    process would end. It is read and run through Python.
    """
    homes = (data_root() / "aircraft", package(), kept_folder())
    return any(model.resolve().is_relative_to(home.resolve()) for home in homes)


class Plant:
    """One aircraft in one JSBSim executive. Loading takes 2 to 4 ms: `conditions.borrowed` has loaded ones.

    rate_hz:  frame rate of diagnosis and control.
    substeps: JSBSim frames per such frame; `run` advances one JSBSim frame of dt_s = 1/(rate_hz substeps).
    aircraft: what flies, if not the built-in aircraft. model: another JSBSim file in place of its own.
    """

    def __init__(
        self, rate_hz: float, substeps: int = 1, aircraft: Aircraft | None = None, model: Path | None = None
    ) -> None:
        self.aircraft = aircraft or load_aircraft()
        self.fdm = _load(_Errors(), model or self.aircraft.jsbsim)
        self.set_rate(rate_hz, substeps)
        self.run = self.fdm.run
        self._manager = self.fdm.get_property_manager()
        self._nodes: dict[str, jsbsim.FGPropertyNode] = {}
        self.as_loaded: dict[str, float] = {}  # of what has been written since
        self._inputs: dict[str, jsbsim.FGPropertyNode] = {}
        self._getters: dict[tuple[str, ...], list[Callable[[], float]]] = {}
        self._setters: dict[tuple[str, ...], list[Callable[[float], Any]]] = {}
        self.native = available() and _is_ours(model or self.aircraft.jsbsim)
        self.executive = 0  # its address, if compiled code may run it: see channels.py
        self.origin: object = None  # what it was loaded from, if it is to be flown again: see conditions.py
        self._settings: Mapping[str, float] = {}
        self._engines_run = False
        self._run_up_for: tuple[float, ...] = ()
        self.n_engines: int = self.fdm.get_propulsion().get_num_engines()
        tanks = (f"propulsion/tank[{i}]/contents-lbs" for i in count())
        self.tanks_lbs = {name: self.read(name) for name in takewhile(self.has, tanks)}  # as loaded
        if self.n_engines:
            self._initialise()  # at rest: placed in flight at once, JSBSim's turboprop reads unwritten memory

    def set_rate(self, rate_hz: float, substeps: int) -> None:
        """Frames a second of the loop, and JSBSim's in each of them."""
        self.rate_hz, self.substeps = rate_hz, substeps
        self.dt_s = 1.0 / (rate_hz * substeps)
        self.fdm.set_dt(self.dt_s)

    def node(self, name: str) -> jsbsim.FGPropertyNode:
        """The held node of a property; UnknownProperty if the aircraft lacks it."""
        if name not in self._nodes:
            found = self._manager.get_node(name)  # unlike a write by name, this creates nothing
            if found is None:
                raise UnknownProperty(f"the aircraft has no property {name!r}")
            self._nodes[name] = found
        return self._nodes[name]

    def has(self, name: str) -> bool:
        """Whether the aircraft has a property."""
        return self._manager.get_node(name) is not None

    def read(self, name: str) -> float:
        """The value of a property, in the unit its name says."""
        return self.node(name).get_double_value()

    def input(self, name: str) -> jsbsim.FGPropertyNode:
        """The held node of a property that is about to be written; what it was when loaded is kept."""
        if name not in self._inputs:
            node = self._inputs[name] = self.node(name)
            self.as_loaded[name] = node.get_double_value()
        return self._inputs[name]

    def write(self, name: str, value: float) -> None:
        """Set a property, in the unit its name says."""
        self.input(name).set_double_value(value)

    def read_all(self, names: tuple[str, ...]) -> list[float]:
        """The values of properties that are read again and again: quicker than one by one."""
        if names not in self._getters:
            self._getters[names] = [self.node(name).get_double_value for name in names]
        return [get() for get in self._getters[names]]

    def write_all(self, names: tuple[str, ...], values: Iterable[float]) -> None:
        """Set properties that are set again and again, in this order."""
        if names not in self._setters:
            self._setters[names] = [self.input(name).set_double_value for name in names]
        for put, value in zip(self._setters[names], values, strict=True):
            put(value)

    def start(self, state: FlightState, wind_mps: Sequence[float] = (0.0, 0.0, 0.0)) -> None:
        """Put the aircraft into a state at time 0: surfaces and engine in place, accelerations the state's.

        Surfaces are commanded through their properties; failures and uncertainties stay as they are set.
        wind_mps: steady wind towards north, east, down; the state is that relative to the air.
        """
        self._command_surfaces(state)
        self._settings = state.settings
        self._command_engines()
        self._place(state)
        self.fdm.set_sim_time(0.0)
        self._initialise()
        if self.n_engines:
            self._start_engines(state)
        self.settle()
        self._initialise()  # again, so that the integrator's past derivatives are the settled ones too
        if any(wind_mps):
            self._drift(state, wind_mps)

    def forget_conditions(self) -> None:
        """Let the initial conditions be those of an aircraft nobody has placed yet."""
        self.fdm.load_ic(str(_AT_REST), False)

    def _drift(self, state: FlightState, wind_mps: Sequence[float]) -> None:
        """Let the air, and the aircraft with it, move over the ground.

        As a lasting gust: JSBSim forgets a wind while initialising, and with it the right past derivatives.
        """
        ground = body_axes(state.phi_rad, state.theta_rad, state.psi_rad) @ np.asarray(wind_mps)
        for axis, speed in zip("uvw", ground, strict=True):
            name = f"ic/{axis}-fps"
            self.write(name, self.read(name) + speed * FT_PER_M)
        for axis, speed in zip(("north", "east", "down"), wind_mps, strict=True):
            self.write(f"atmosphere/gust-{axis}-fps", speed * FT_PER_M)
        self._initialise()
        self.settle()
        self._initialise()

    def _initialise(self) -> None:
        try:
            initialised = self.fdm.run_ic()
        except jsbsim.BaseError as error:
            raise _not_flown(self.aircraft.name, error) from None
        if not initialised:
            raise SimulationFailed("JSBSim cannot initialise the flight")

    def hold(self, state: FlightState, still_rad_s2: float | None = None) -> None:
        """Put the aircraft into a state with time standing still; the engines go on as they were.

        `start` comes first. The quick way to look at many states; still_rad_s2: as of `settle`.
        """
        self._command_surfaces(state)
        self._place(state)
        self._initialise()
        self.settle(still_rad_s2)

    def pass_over(self, state: FlightState) -> None:
        """Take from `hold` what later states depend on: the last bits of a place are what the places before
        it have left in JSBSim's initial conditions."""
        self._place(state)

    def _start_engines(self, state: FlightState) -> None:
        """Let all engines run as they do in steady flight with the power as it is set."""
        how = self.aircraft.engine.start
        if how == "run_up":
            self._run_up(state)
        elif how == "steady":
            if not self._engines_run:
                self.write("propulsion/set-running", -1)
                self._engines_run = True
            self._command_engines()
            self.settle()  # the power lever reaches the engines
            self.fdm.get_propulsion().get_steady_state()

    def _run_up(self, state: FlightState) -> None:
        """Start the engines as a pilot does, and let time pass with the aircraft held where it is."""
        wanted = (*self._settings.values(), state.airspeed_mps, state.altitude_m)
        if wanted == self._run_up_for:
            return
        for i in range(self.n_engines):
            self.write(f"fcs/mixture-cmd-norm[{i}]", 1.0)
            self.write(f"fcs/advance-cmd-norm[{i}]", 1.0)
        if not self._engines_run:
            self.write("propulsion/set-running", -1)
            for name, value in _STARTING.items():
                if self.has(name):  # of its kind of engine
                    self.write(name, value)
            self._engines_run = True
        for _ in range(round(_RUN_UP_S / _BETWEEN_PLACINGS_S)):
            self._command_engines()
            self._place(state)
            self._initialise()
            for _ in range(round(_BETWEEN_PLACINGS_S / self.dt_s)):
                self.run()
        self._place(state)
        self.fdm.set_sim_time(0.0)
        self._initialise()
        self._run_up_for = wanted

    def settle(self, still_rad_s2: float | None = None) -> None:
        """Run, time standing still, until accelerations belong to the state and the surfaces as commanded.

        In still air: the filters of the turbulence divide by the time step, which is zero here.
        still_rad_s2: the runs end sooner if one has changed no angular acceleration by more than this.
        """
        turbulence = self.read("atmosphere/turb-type")
        if turbulence:
            self.write("atmosphere/turb-type", 0.0)
        self.fdm.suspend_integration()
        before: list[float] = []
        for _ in range(_RUNS_TO_SETTLE):
            self.run()
            if still_rad_s2 is not None:
                now = self.read_all(_ANGULAR_ACCELERATIONS)
                if before and max(map(abs, map(sub, now, before))) <= still_rad_s2:
                    break
                before = now
        self.fdm.resume_integration()
        if turbulence:
            self.write("atmosphere/turb-type", turbulence)

    def _command_surfaces(self, state: FlightState) -> None:
        for name, surface in self.aircraft.surface.items():
            self.write(surface.command, state.surfaces_rad[name])

    def _command_engines(self) -> None:
        for name, setting in self.aircraft.engine.settings.items():
            self.write(setting.property, self._settings[name])

    def _place(self, state: FlightState) -> None:
        V = state.airspeed_mps * FT_PER_M
        alpha, beta = state.alpha_rad, state.beta_rad
        along = cos(beta)
        velocity = V * cos(alpha) * along, V * sin(beta), V * sin(alpha) * along
        where = START_LATITUDE_DEG, 0.0, state.altitude_m * FT_PER_M
        attitude = state.phi_rad, state.theta_rad, state.psi_rad
        rates = state.p_rad_s, state.q_rad_s, state.r_rad_s
        self.write_all(_PLACED, (*where, *attitude, *velocity, *rates))


def body_axes(phi_rad: float, theta_rad: float, psi_rad: float) -> np.ndarray:
    """Rotation (3, 3) from north-east-down to body axes, by yaw, pitch, roll."""
    (sphi, cphi), (sth, cth), (spsi, cpsi) = (
        (sin(angle), cos(angle)) for angle in (phi_rad, theta_rad, psi_rad)
    )
    roll = np.array([[1, 0, 0], [0, cphi, sphi], [0, -sphi, cphi]])
    pitch = np.array([[cth, 0, -sth], [0, 1, 0], [sth, 0, cth]])
    yaw = np.array([[cpsi, spsi, 0], [-spsi, cpsi, 0], [0, 0, 1]])
    return roll @ pitch @ yaw
