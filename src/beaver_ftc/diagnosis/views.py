"""The directions in which the rates are looked at to tell what a surface cannot have done (across.py)."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.diagnosis.across import AN_AXIS, MAX_VIEWS, THE_VANE
from beaver_ftc.diagnosis.forces import ASIDE, UP, told_by_force
from beaver_ftc.diagnosis.likelihood import LATERAL, MAX_HYPOTHESES, N_SLOTS, PITCH_BLOCK, SENSE, STEP
from beaver_ftc.diagnosis.state import LOSS, NORMAL, PITCH, ROLL, SIDE, YAW
from beaver_ftc.scenario.diagnosis import FdiConfig

PRIOR_DRIFT_RAD_S2 = 1.0  # what a drift may be at the start of a flight: soon forgotten
IN_PITCH, LATERALLY, IN_YAW = (PITCH, NORMAL), (ROLL, YAW), (YAW, SIDE)  # planes that several surfaces move


class Direction(NamedTuple):
    """What a view looks along. across: a surface, THE_VANE or AN_AXIS; tries: whose losses."""

    across: int
    mix: tuple[float, ...]
    plane: tuple[int, int]
    tries: list[int]
    inertial: bool = False
    asks: bool = False  # the vanes, in moving air: they do not see it roll


def views_of(aircraft: Aircraft, with_force: bool = False) -> Iterator[Direction]:
    """The axes for themselves; in roll and yaw across the column of each surface that leads one of them.
    With accelerometers, in a rate and its force across those of what moves both, and that of the vane."""
    in_pitch = [s for s, axis in enumerate(aircraft.dominant_axis) if axis == PITCH]
    lateral = [s for s, axis in enumerate(aircraft.dominant_axis) if axis != PITCH]
    yield Direction(AN_AXIS, _along((PITCH,)), IN_PITCH, in_pitch, asks=True)
    yield Direction(AN_AXIS, _along((ROLL,)), LATERALLY, lateral)
    yield Direction(AN_AXIS, _along((YAW,)), LATERALLY, lateral, asks=True)
    for s in lateral:
        if aircraft.surfaces[s] in aircraft.primary:
            past_roll, others = aircraft.dominant_axis[s] == ROLL, [other for other in lateral if other != s]
            yield Direction(s, _along((ROLL,)), LATERALLY, others, asks=past_roll)
    if not with_force:
        return
    for f, plane, movers in ((UP, IN_PITCH, in_pitch), (ASIDE, IN_YAW, lateral)):
        found = told_by_force(aircraft, f)
        for s in found:
            own = aircraft.dominant_axis[s], plane[1]
            yield Direction(s, _along(own), own, [other for other in movers if other != s])
        if found:
            yield Direction(THE_VANE, _along(plane), plane, movers)
            yield Direction(AN_AXIS, _along(plane[1:]), plane, movers, inertial=True)


def _along(components: tuple[int, ...]) -> tuple[float, ...]:
    return tuple(float(i in components) for i in range(NORMAL + 1))


def across_a_column(config: FdiConfig, instants: int) -> bool:
    """Whether what goes on across a surface's column excludes it.

    Within a frame of several instants a column turns with the incidence while the surface moves, and shows
    across its mean.
    """
    return config.looks_across and instants <= 1


def set_up_views(statistical: np.void, aircraft: Aircraft) -> None:
    """Fill the views of a statistical record whose blocks, and normal force, are set up."""
    forces = statistical["forces"]
    told = [told_by_force(aircraft, f) for f in (ASIDE, UP)]
    with_air = forces["known"] and statistical["air"]["moving"] and all(told)
    views = list(views_of(aircraft, bool(forces["known"])))[:MAX_VIEWS]
    statistical["n_views"] = len(views)
    for view, (surface, mix, plane, movers, inertial, asks) in zip(statistical["views"], views, strict=False):
        view["surface"], view["mix"], view["plane"], block = surface, mix, plane, view["block"]
        view["axis"] = mix.index(1.0) if surface == AN_AXIS and not inertial else plane[0]
        axes = statistical["block"][PITCH_BLOCK if plane == IN_PITCH else LATERAL]
        # A law answers a gust by the vanes before the gyros feel it pitch, and the vanes are not asked here:
        # what an elevator does in moving air goes along with the noise, and no test of its loss is fair.
        answered = statistical["air"]["moving"] and mix[PITCH]
        tried = [] if answered else movers[: MAX_HYPOTHESES - 1]
        kinds, n = [STEP, *(LOSS for _ in tried)], int(axes["n_regressors"])
        block["n"], block["n_hypotheses"], block["keep"] = 1, len(kinds), 1.0
        block["P_xx"][0, 0], block["P_dd"][0, 0] = axes["noise"].max(), PRIOR_DRIFT_RAD_S2**2
        for name in ("level", "chance", "pace"):
            block[name] = axes[name]
        block["tolerance"][:n] = axes["tolerance"][:n]
        if asks and with_air:  # the vanes for the gust
            view["cleared_by"] = NORMAL if plane == IN_PITCH else SIDE
        if any(mix[SIDE:]):
            force, view["cleared_by"] = forces["component"][plane[1] - SIDE], plane[1]
            view["tolerated"], of_force = 1, int(force["n"])
            block["tolerance"][n : n + of_force] = force["tolerance"][:of_force]
            n += of_force
            if inertial:
                block["tolerance"][n], n = force["drift"], n + 1
        block["n_regressors"] = n + (surface != AN_AXIS)
        block["tolerance"][n] = float(surface != AN_AXIS)  # of how far errors turn the column, in flight
        hypotheses = block["hypothesis"][: len(kinds)]
        hypotheses["kind"], hypotheses["surface"] = kinds, [-1, *tried]
        view["past_gust"] = surface == THE_VANE and plane == IN_YAW and statistical["air"]["moving"]
        view["inertial"], view["clears"] = inertial, inertial or surface == THE_VANE
        sense = block["lane"]["sense"].reshape(-1, N_SLOTS)
        sense[:] = 0.0
        sense[: len(kinds)] = [[SENSE[kind]] for kind in kinds]
