"""Which type of fault is on a surface: exact feasible sets, frame by frame.

The innovation nu = eta + G_s (p_s - u_s), with |eta| <= eta_bar, gives an interval of the surface's true
deflection p_s in each frame, on which all axes agree (p is delta in docs/explanation/fault-types.md). A type
is a statement about p_s that holds in every frame in which something is wrong. The set of its one parameter
is the intersection over those frames, and the type is excluded when the set is empty. For a bound that holds
instant by instant, this is the exact feasible set: a test that excludes a type sooner would exclude a true
one at some time.

    loss            p = (1 + theta) u      1 + theta in [0, 1], constant
    varying loss    the same               1 + theta anywhere in [0, 1] in every frame (incipient)
    stuck           p = c                  c in the travel
    float           p = 0                  or the stop nearest to 0
    hardover        p reaches its stop at no less than half its rate limit, and stays
    bias            p = u + b              b constant; cut off by the stops
    oscillatory     p - u swings about 0   no half-cycle longer than pi / slowest oscillation
    rate limit      p moves to u only      at the slowest declared rate or faster
    growing bias    p = u + b              b of one sign and never smaller (incipient)

A frame that eta alone explains gives no information, so a fault may be intermittent. The exception is a
surface that was given up, if faults are declared to stay (`examination.count_rest`). The promise: the type of
the true fault, if its parameter is constant while it is there, is never excluded, and so no other type is
named. Types that cannot be distinguished stay candidates.

A file under table/ describes one fault type, or several that share their kernels; its `TYPES` are the rows.
This file says what is in a row (`FaultType`), and has the feasible sets: the set (low, high) of each type's
parameter; low > high is the empty set. A type is excluded once its set is empty, and stays excluded until the
surface's diagnosis restarts.

registry.py reads the rows into arrays, and records.py has the records. In each frame examination.py finds
where each surface was (observations.py) and tests every type. remaining.py concludes which type it is,
verdict.py on which surface, and pairs.py the same for two faults. modes.py chooses what the law does about
it, and findings.py puts it in words. These files name no type.

    s, srf          surface, and its record (`records.surface_types_dtype`)
    h               type: its number, the same in every array over types
    k               judged frame, the one before the elapsed
    u, p            deflection, rad: u of a healthy surface under the same command, p of this one
    lo, hi          interval, rad
    nu, nu_max (3,) innovation and its bound without a fault, rad/s2
    c, M            TYPES_CONFIG_RECORD of records.py, memory of a type
    est, fie        estimators of the isolation, and one of them
    eff             effect of the fault of an estimator in the frame (EFFECT_RECORD of estimators.py)
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.sets import EMPTY_SET, UNLIMITED_SET, intersect

Kernel = Callable[..., Any]

# Accommodation modes: the law scales the command of a surface at fault, gives the surface up, subtracts its
# offset, or waits for it at its rate.
MODES = SCALE_COMMAND, GIVE_UP, SUBTRACT_OFFSET, WAIT_FOR_SURFACE = range(4)

# `evidence_at_rest`: what a frame says of a type if the surface was given up, stays where it was, and nothing
# is wrong in the frame.
REST_IS_UNINFORMATIVE, REST_EXCLUDES_TYPE, REST_HIDES_TYPE, REST_POSITION_IS_PARAMETER = range(4)


@kernel
def reachable_range(c, srf, h, k):
    """Anywhere within the reach of the surface, rad: the range of a type that says nothing more."""
    return srf.actuator.reach_lo, srf.actuator.reach_hi


class DeflectionRelation(NamedTuple):
    """The deflection p, rad, of a surface under a type, by u, rad, of a healthy one, and one parameter theta:

        p = command_gain u + theta         theta in rad
        p = (command_gain + theta) u       if theta_is_share: theta without unit

    theta_span(low, high): returns the least and greatest theta; low, high: the travel, rad.
    """

    command_gain: float
    theta_is_share: bool
    theta_span: Callable[[float, float], tuple[float, float]]


def _no_estimate(fdi: np.void, s: int, h: int) -> None:
    """No parameter to estimate."""


@dataclass(frozen=True, kw_only=True)
class FaultType:
    """One fault type. A field that is left out has its default.

    name                    in scenarios, reports and metrics
    description             the type in words, where the name does not say which of two types it is
    has_constant_parameter  whether its parameter is constant: if so, a frame can refute what another frame
                            allows
    sort_rank               place among the types of its sort (constant or not), in numbers and in lists

    The feasible set; kernels:

    consistent_interval(c, srf, h, k)
                            the parameters (low, high) that explain the judged frame, in which something was
                            wrong; UNLIMITED_SET if every one does, EMPTY_SET (low > high) excludes the
                            type. Not of a type that `holds_surface`
    parameter_range(srf, h)
                            the parameters (low, high) that there are; unlimited if left out
    deflection_range(c, srf, h, k)
                            least and greatest deflection under it by frame k, rad; of a constant type. k is
                            the elapsed frame (pairs.py), or for `holds_surface` the judged one or the one
                            before it
    holds_surface           it holds the surface there, and may release it (release.py): that explains a frame
    memory_dtype, memory_record_name
                            a record of its own, found at `srf.<memory_record_name>`
    reset_memory(srf, h)    its memory is reset: nothing is known yet
    see_frame(c, srf, h, k, skipped)
                            called for every frame, before it is judged; skipped: it is neither judged nor
                            one in which the surface rests

    The evidence that a verdict needs:

    has_shown(srf, h)       kernel: whether the type has shown itself. A type with this part explains a flight
                            only once it has shown itself
    show_half_cycles        half-cycles of the slowest oscillation for which a verdict waits for it
    evidence_at_rest        what a surface that was given up, and stays where it was, says of the type:
                            REST_IS_UNINFORMATIVE, REST_EXCLUDES_TYPE, REST_HIDES_TYPE (it may be there all
                            the same) or REST_POSITION_IS_PARAMETER (its parameter is the deflection at
                            which the surface stands)
    wait_half_cycles        half-cycles of evidence that a fault on another surface needs while this type is
                            left here
    follows_command         of a type that is not constant: false if its deflection error may stay constant
                            under any command. Such an error looks like a constant fault of another surface:
                            while the type is left, no other surface is isolated in its place
    can_look_like           names of types that this one, not constant, can look like: they are not named
                            while it is left, unless `motion_rules_out` it
    motion_rules_out(srf, h, stop)
                            kernel: whether the surface has moved as this type cannot, towards the stop
                            of that direction (0: of a type without one)
    stop_direction          the stop that it runs to: 1 upper, -1 lower, 0 neither

    The accommodation:

    accommodation_mode      SCALE_COMMAND, GIVE_UP, SUBTRACT_OFFSET or WAIT_FOR_SURFACE
    other_accommodation_modes
                            other modes that serve it
    end_type                name of the type that it becomes at the end of its range: where both are left, the
                            modes of that one serve this one too
    deflection_error(srf, h)
                            kernel: p - u, rad; not finite if not known
    deflection_error_precedence
                            of the types left that have one, the least number gives the deflection error

    What shows from outside that it is excluded, and by which deflections it differs from another:

    deflection_relation     deflection by command and one parameter, where that is all that the type says; of
                            a type that is not constant theta may differ from frame to frame
    frames_test             name of the comparison of frames that excludes it, where one frame or two do not
                            suffice: "offset", "growing offset", "runaway", "swing" or "approach"

    Words, Python functions (findings.py):

    estimate_parameter(fdi, s, h)
                            its parameter, None without one
    estimate_parameter_interval(fdi, s, h)
                            the set that the parameter is certain to lie in, or None
    estimate_frequency_rad_s(fdi, s, h)
                            of a periodic type, or None
    """

    name: str
    has_constant_parameter: bool
    consistent_interval: Kernel | None = None
    description: str = ""
    sort_rank: int = 100
    parameter_range: Kernel | None = None
    memory_dtype: np.dtype | None = None
    memory_record_name: str = ""
    reset_memory: Kernel | None = None
    see_frame: Kernel | None = None
    deflection_range: Kernel = reachable_range
    holds_surface: bool = False
    has_shown: Kernel | None = None
    show_half_cycles: int = 0
    evidence_at_rest: int = REST_IS_UNINFORMATIVE
    wait_half_cycles: int = 1
    follows_command: bool = True
    can_look_like: tuple[str, ...] = ()
    motion_rules_out: Kernel | None = None
    stop_direction: int = 0
    accommodation_mode: int = SUBTRACT_OFFSET
    other_accommodation_modes: tuple[int, ...] = ()
    end_type: str = ""
    deflection_error: Kernel | None = None
    deflection_error_precedence: int = 100
    deflection_relation: DeflectionRelation | None = None
    frames_test: str = ""
    estimate_parameter: Callable[[np.void, int, int], float | None] = _no_estimate
    estimate_parameter_interval: Callable[[np.void, int, int], tuple[float, float] | None] = _no_estimate
    estimate_frequency_rad_s: Callable[[np.void, int, int], float | None] = _no_estimate


@kernel
def clip_travel(srf, p):
    """p, cut off by the stops, rad."""
    return min(max(p, srf.actuator.stop_lo), srf.actuator.stop_hi)


@kernel
def set_middle(srf, h):
    """The middle of the set of type h, in the unit of its parameter."""
    return 0.5 * (srf.sets.low[h] + srf.sets.high[h])


def feasible_set(fdi: np.void, s: int, h: int) -> tuple[float, float]:
    """The set (low, high) of the parameter of type h on surface s."""
    srf = fdi["types"]["surface"][s]
    return float(srf["sets"]["low"][h]), float(srf["sets"]["high"][h])


def middle_estimate(fdi: np.void, s: int, h: int) -> float:
    """The middle of the set of the parameter of type h on surface s."""
    lo, hi = feasible_set(fdi, s, h)
    return 0.5 * (lo + hi)


@kernel
def put_set(srf, h, interval):
    """Put an interval in place of the set of type h."""
    srf.sets.low[h], srf.sets.high[h] = interval


@kernel
def intersect_set(srf, h, other):
    """Intersect the set of type h with `other`, (low, high); exclude the type if the result is empty.

    low > high in the set of a type that is excluded so; one that EMPTY_SET excludes keeps its set.
    """
    if other == EMPTY_SET:
        srf.sets.excluded[h] = 1
        return
    put_set(srf, h, intersect((srf.sets.low[h], srf.sets.high[h]), other))
    if srf.sets.low[h] > srf.sets.high[h]:
        srf.sets.excluded[h] = 1
