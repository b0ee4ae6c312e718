"""What is read from the truth, written to it and logged in each frame, and how compiled code does so.

The truth is read as one array: what every aircraft has, then of all surfaces position, effective deflection
and effectiveness, then the declared signals. With n surfaces, compiled code finds surface s at POS + s,
POS + n + s and POS + 2 n + s, and signal k at POS + 3 n + k.

A property read through JSBSim's Python binding costs about 0.1 us; a frame reads and writes some forty. The
binding exports the C++ accessors of a property node, so a compiled kernel can call them on the node's own
address: 0.01 us each. That rests on how one build of the binding is laid out, so addresses.py has it proved
in a child process before it is used. The environment variable BEAVER_FTC_NATIVE=0 turns it off; the caller
reads and writes through Python then.

    bank = NodeBank([plant.node(name) for name in names])
    read_nodes(address(GETTER), bank.pointers, out)       # also from inside another compiled kernel

Likewise `advance` calls the executive's `Run`: a flight then leaves compiled code only when something
changes. An error that JSBSim raises could not be caught there. Its models of an aircraft without engines
raise none once that is loaded and trimmed; aircraft with engines are run through Python.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from beaver_ftc.aircraft import AXES, Aircraft, load
from beaver_ftc.aircraft.aircraft import M_PER_FT
from beaver_ftc.aircraft.schema import MAX_SIGNALS
from beaver_ftc.compiled import kernel, record
from beaver_ftc.plant.addresses import available, pointer
from beaver_ftc.scenario.sensors import N_IN_EQUATIONS, ROWS

if TYPE_CHECKING:
    import jsbsim


PSF = 47.88025898033584  # Pa per lbf/ft2

Channel = tuple[str, str, float]

# Log column, JSBSim property, factor to SI. The first seven are what sensors measure.
FIXED: tuple[Channel, ...] = (
    ("p_rad_s", "velocities/p-rad_sec", 1.0),
    ("q_rad_s", "velocities/q-rad_sec", 1.0),
    ("r_rad_s", "velocities/r-rad_sec", 1.0),
    ("alpha_rad", "aero/alpha-rad", 1.0),
    ("beta_rad", "aero/beta-rad", 1.0),
    ("airspeed_mps", "velocities/vt-fps", M_PER_FT),
    ("qdyn_pa", "aero/qbar-psf", PSF),
    ("phi_rad", "attitude/phi-rad", 1.0),
    ("theta_rad", "attitude/theta-rad", 1.0),
    ("psi_rad", "attitude/psi-rad", 1.0),
    ("latitude_rad", "position/lat-gc-rad", 1.0),
    ("longitude_rad", "position/long-gc-rad", 1.0),
    ("altitude_m", "position/h-sl-ft", M_PER_FT),
    ("pdot_rad_s2", "accelerations/pdot-rad_sec2", 1.0),
    ("qdot_rad_s2", "accelerations/qdot-rad_sec2", 1.0),
    ("rdot_rad_s2", "accelerations/rdot-rad_sec2", 1.0),
    ("envelope_valid", "aero/envelope-valid", 1.0),
)
_INDEX = {name: index for index, (name, _, _) in enumerate(FIXED)}

# Indices compiled code uses.
AIRSPEED, ALPHA, BETA, QDYN = (_INDEX[n] for n in ("airspeed_mps", "alpha_rad", "beta_rad", "qdyn_pa"))
PHI, LATITUDE, LONGITUDE, ALTITUDE = (
    _INDEX[n] for n in ("phi_rad", "latitude_rad", "longitude_rad", "altitude_m")
)
PDOT, ENVELOPE = _INDEX["pdot_rad_s2"], _INDEX["envelope_valid"]
POS = len(FIXED)


def usual_channels(aircraft: Aircraft) -> tuple[Channel, ...]:
    """The first channels of `truth_channels`: what the usual sensors and the log read."""
    return (
        *FIXED,
        *((f"{s}_pos_rad", of.position, 1.0) for s, of in aircraft.surface.items()),
        *((f"{s}_effective_rad", of.effective, 1.0) for s, of in aircraft.surface.items()),
        *((f"{s}_effectiveness", f"failures/{s}/effectiveness", 1.0) for s in aircraft.surfaces),
        *((name, signal.property, 1.0) for name, signal in aircraft.signals.items()),
    )


def signal_places(n: int, declared: int) -> list[int]:
    """Places in `truth_channels` of the measured signals beside the rates, of an aircraft with n surfaces and
    so many declared signals: (4 + declared,)."""
    first = POS + 3 * n
    return [ALPHA, BETA, AIRSPEED, QDYN, *range(first, first + declared)]


# What stands after them: m/s2 times slug, slug; then the sensors that the monitor alone uses; then the
# engine's.
_INERTIAL: tuple[Channel, ...] = (
    ("force_x", "forces/fbx-total-lbs", M_PER_FT),
    ("force_y", "forces/fby-total-lbs", M_PER_FT),
    ("force_z", "forces/fbz-total-lbs", M_PER_FT),
    ("mass_slug", "inertia/mass-slugs", 1.0),
)
_SAMPLED: tuple[Channel, ...] = tuple((row.name, *row.truth) for row in ROWS[N_IN_EQUATIONS:])
_ENGINE = ("engine_rpm", "manifold_pressure_inhg")
N_FURTHER = len(_INERTIAL) + len(_SAMPLED) + len(_ENGINE)


@lru_cache(maxsize=32)
def truth_channels(aircraft: Aircraft) -> tuple[Channel, ...]:
    """Channels that are read from the truth of an aircraft, in order: the same in every flight, whatever
    will break in it."""
    settings = aircraft.engine.settings
    engine = [(name, settings[name].property, 1.0) for name in _ENGINE if aircraft.has_engine_instruments]
    return (*usual_channels(aircraft), *_INERTIAL, *_SAMPLED, *engine)


def most_channels(n: int) -> int:
    """Largest number of channels of the truth of an aircraft with n surfaces."""
    return POS + 3 * n + MAX_SIGNALS + N_FURTHER


def command_properties(aircraft: Aircraft) -> tuple[str, ...]:
    """The properties that command the surfaces, in order."""
    return tuple(surface.command for surface in aircraft.surface.values())


# Of the built-in aircraft, for what does not yet ask the aircraft.
TRUTH = usual_channels(load())
COMMANDS = command_properties(load())

_STATES = (
    "airspeed_mps", "alpha_rad", "beta_rad", "p_rad_s", "q_rad_s", "r_rad_s",
    "phi_rad", "theta_rad", "psi_rad", "north_m", "east_m", "altitude_m",
)  # fmt: skip


def likelihoods(aircraft: Aircraft) -> tuple[str, ...]:
    """Columns of the statistical detector's tests."""
    return (
        *(f"{s}_loss_likelihood_share" for s in aircraft.class_of_losses),
        *(f"{axis}_step_likelihood_share" for axis in AXES),
    )


def _per_axis(pattern: str) -> list[str]:
    return [pattern.format(axis) for axis in AXES]


def _estimator_columns(name: str) -> list[str]:
    limits = [f"fie_{name}_{axis}_{what}_rad_s" for axis in AXES for what in ("residual", "lower", "upper")]
    return [*limits, f"fie_{name}_excluded"]


@lru_cache(maxsize=32)
def log_columns(
    aircraft: Aircraft,
    estimators: tuple[str, ...],
    watch: int,
    power: str,
    profile: tuple[str, ...],
    tests: bool,
    sampled: bool = False,
) -> tuple[str, ...]:
    """The log's columns in order, for the isolation estimators of these names; watch: how many where
    instruments are held against one another; power: the engine setting commanded, empty where none is, and
    what each engine that is an effector has beside it; profile: columns of the commanded profile; tests:
    there is a statistical detector, whose tests are logged as shares of its level; sampled: sensors that are
    read at rates of their own are read.

    Of each surface's effectiveness the `estimate` is the diagnosis', 1 where nothing is estimated; `used` is
    what the law takes it for, on its way there at a limited rate, and 1 throughout under the nominal law.
    """
    surfaces = aircraft.surfaces
    return (
        "t_s", *_STATES, *_per_axis("{}dot_rad_s2"), "qdyn_pa", *aircraft.signals, "envelope_valid",
        *_per_axis("{}_measured_rad_s"), *_per_axis("{}_reference_rad_s"), *_per_axis("{}_model_rad_s"),
        *(f"{s}_{what}_rad" for s in surfaces for what in ("cmd", "pos", "effective")),
        *(f"{s}_saturated" for s in surfaces),
        *_per_axis("{}_alarm_residual_rad_s"), *_per_axis("{}_alarm_threshold_rad_s"),
        *_per_axis("{}_residual_rad_s"), *_per_axis("{}_threshold_rad_s"),
        *_per_axis("{}_eta_bar_rad_s2"), *_per_axis("{}_network_rad_s2"),
        *_per_axis("{}_design_rad_s2"),
        *(column for name in estimators for column in _estimator_columns(name)),
        *(f"{s}_effectiveness_{which}" for which in ("estimate", "used") for s in surfaces),
        "mode", "detected",
        *("watch_share", "watch_test", "watch_missing")[:watch],
        *(row.column for row in ROWS[N_IN_EQUATIONS:] if sampled),
        *((power, *(f"{engine}_difference" for engine in aircraft.effectors)) if power else ()),
        *profile,
        *(likelihoods(aircraft) if tests else ()),
    )  # fmt: skip


# What `advance` needs: code and executive; whether turbulence is to be turned, and the nodes for that.
RUNNING = record(
    run=int, executive=int, turbulent=int, getter=int, setter=int, heading_pointer=int, axes_pointer=int,
)  # fmt: skip


_ADDRESS, _NUMBER, _TRUTH = ir.IntType(64), ir.DoubleType(), ir.IntType(1)


def _calling(returned, *given):
    """What makes the code that calls the function at the first argument with the others."""

    def codegen(context, builder, signature, args):
        function = builder.inttoptr(args[0], ir.FunctionType(returned, given).as_pointer())
        return builder.call(function, args[1:])

    return codegen


@intrinsic
def _call_getter(typingctx, function, node):
    return types.float64(types.int64, types.int64), _calling(_NUMBER, _ADDRESS)


@intrinsic
def _call_setter(typingctx, function, node, value):
    return types.boolean(types.int64, types.int64, types.float64), _calling(_TRUTH, _ADDRESS, _NUMBER)


@intrinsic
def _call_run(typingctx, function, executive):
    return types.boolean(types.int64, types.int64), _calling(_TRUTH, _ADDRESS)


@kernel
def advance(simulator):
    """One JSBSim frame; simulator: of dtype RUNNING. Turbulence is first turned along the heading, see
    `loop.cockpit.Cockpit.turn_air`."""
    if simulator.turbulent:
        heading: float = _call_getter(simulator.getter, simulator.heading_pointer)  # type: ignore
        _call_setter(simulator.setter, simulator.axes_pointer, -heading)
    _call_run(simulator.run, simulator.executive)  # type: ignore


@kernel
def read_nodes(getter, pointers, out):
    """Read nodes into out. getter: address(GETTER). pointers, out: (n,) int64, float64."""
    for i in range(pointers.size):
        out[i] = _call_getter(getter, pointers[i])  # type: ignore[call-arg]


@kernel
def write_nodes(setter, pointers, values):
    """Write values to nodes. setter: address(SETTER). pointers, values: (n,) int64, float64."""
    for i in range(pointers.size):
        _call_setter(setter, pointers[i], values[i])  # type: ignore[call-arg]


class NodeBank:
    """Property nodes with their C++ addresses.

    pointers: (n,) int64, valid as long as the bank lives: it keeps the nodes, and whatever `owner` it is
    given (the Plant, whose executive the tied properties read from).
    """

    def __init__(self, nodes: "Sequence[jsbsim.FGPropertyNode]", owner: object = None) -> None:
        self.nodes = tuple(nodes)
        self.owner = owner
        native = available()
        self.pointers = np.array([pointer(node) if native else 0 for node in self.nodes], dtype=np.int64)

    def read(self, out: np.ndarray) -> None:
        """Read every node into out (n,), through Python."""
        for i, node in enumerate(self.nodes):
            out[i] = node.get_double_value()

    def write(self, values: np.ndarray) -> None:
        """Write values (n,) to the nodes, through Python."""
        for node, value in zip(self.nodes, values, strict=True):
            node.set_double_value(float(value))
