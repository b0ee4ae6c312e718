"""From the types left to a verdict: surface, type, and what the law does; and the findings in words.

No type is named here: the columns of the table (contract.py) say what distinguishes one from another. Kernels
of one surface assume that it is at fault; `can_be_at_fault` says whether it can be. types: of `types_dtype`;
conclusion: of `conclusion_dtype`; estimators: those of the isolation.

`fault_findings` puts the verdict in words: surface, type, candidates, estimate. estimate, by type: theta in
[-1, 0] of a loss of effectiveness; deflection in rad of a stuck, floating or runaway surface; offset in rad
of a bias; amplitude in rad of an oscillation.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.state import NOT_ISOLATED, PITCH, PITCH_GROUP, UNANTICIPATED
from beaver_ftc.diagnosis.types import registry
from beaver_ftc.diagnosis.types.contract import (
    GIVE_UP,
    REST_HIDES,
    SCALE_COMMAND,
    SUBTRACT_OFFSET,
    WAIT_FOR_SURFACE,
    observed_error,
    set_middle,
)
from beaver_ftc.diagnosis.types.registry import (
    ACCOMMODATION,
    AT_REST,
    DIRECTION,
    ERROR_ORDER,
    FIRST_OF_NAME,
    FOLLOWS_COMMAND,
    HALF_CYCLES,
    LIMIT_TYPE,
    MISTAKEN_FOR,
    MUST_SHOW,
    N_CONSTANT,
    N_TYPES,
    SERVES_TYPE,
    SHOWS_WITHIN,
    differs,
    expected_error,
    has_shown,
)

NO_SURFACE, SEVERAL_SURFACES = -1, -2
TYPE_OPEN, NO_TYPE = -1, -2  # the type of a fault of which more than one type is left, or none
# What decides whether a surface can be at fault: its estimator, or what is known of the other (pairs.py).
BY_ESTIMATOR, BY_DEDUCTION, RULED_OUT = range(3)
ABSENCE_LIMIT_S = 0.2  # a fault that has not shown for so long is taken for gone
_ROUNDING = 1e-9


@kernel
def record_refuted(surfaces, layout, estimators):
    """Keep for every surface whether its estimator is excluded."""
    for s, surface in enumerate(surfaces):
        surface.estimator_excluded = estimators[layout.position_estimator[s]].excluded


@kernel
def can_be_at_fault(surface):
    """Whether anything on a surface can be the fault."""
    if surface.status.decided_by != BY_ESTIMATOR:
        return surface.status.decided_by == BY_DEDUCTION
    return not surface.estimator_excluded


@kernel
def type_remains(surface, kind):
    """Whether a type is not excluded."""
    return not surface.feasible.excluded[kind]


@kernel
def any_constant_type_remains(surface):
    """Whether a type with a constant parameter is left."""
    return not np.all(surface.feasible.excluded[:N_CONSTANT])


@kernel
def any_type_remains(surface):
    """Whether any type is left."""
    return not np.all(surface.feasible.excluded)


@kernel
def is_explained(surface):
    """Whether some type explains the flight: it is left, and if it must show itself it has."""
    for kind in range(N_TYPES):
        if type_remains(surface, kind) and has_shown(surface, kind):
            return True
    return False


@kernel
def types_would_have_shown(config, surface):
    """Whether each type that must show itself is excluded, or has had the time to, hidden by no stop."""
    for kind in range(N_TYPES):
        if (
            type_remains(surface, kind)
            and surface.evidence.unhidden_frames < SHOWS_WITHIN[kind] * config.half_cycle_frames
        ):
            return False
    return True


@kernel
def sole_type_among(surface, n):
    """The one of the first n types that is left, or OPEN; of one name, such as a runaway's two, the first."""
    found = TYPE_OPEN
    for kind in range(n):
        if type_remains(surface, kind):
            if found >= 0 and FIRST_OF_NAME[kind] != FIRST_OF_NAME[found]:
                return TYPE_OPEN
            found = kind if found < 0 else found
    return found


@kernel
def sole_constant_type(surface):
    """The one type of constant parameter left, or OPEN."""
    return sole_type_among(surface, N_CONSTANT)


@kernel
def sole_type(surface):
    """The one type left, constant or varying, or OPEN: in coarse sets a constant proves nothing."""
    found = sole_type_among(surface, N_TYPES)
    return found if found >= 0 and has_shown(surface, found) else TYPE_OPEN


@kernel
def can_hide_at_rest(config, surface):
    """Whether what a constant explains may be a type that does not show in a surface at rest, such as a slow
    surface that has come to where it is commanded: it has not stood off its command for long."""
    if (
        not any_constant_type_remains(surface)
        or surface.evidence.frames - surface.evidence.rest_frames >= config.half_cycle_frames
    ):
        return False
    for kind in range(N_TYPES):
        if AT_REST[kind] == REST_HIDES and type_remains(surface, kind):
            return True
    return False


@kernel
def can_be_confused_with(surface, kind, found):
    """Whether a fault of type `kind` may look like one of the type `found`, or of another type left of that
    name and of constant parameter."""
    for other in range(N_CONSTANT):
        alike = (
            FIRST_OF_NAME[other] == FIRST_OF_NAME[found]
            and MISTAKEN_FOR[kind, other]
            and type_remains(surface, other)
        )
        if alike and not differs(surface, DIRECTION[other], kind):
            return True
    return False


@kernel
def can_be_another_type(surface, found, any_type):
    """Whether what looks like the constant type `found` may be another type that is left; unless `any_type`,
    one that does not follow the command."""
    if found >= 0:
        for kind in range(N_CONSTANT, N_TYPES):
            counts = type_remains(surface, kind) and (any_type or not FOLLOWS_COMMAND[kind])
            if counts and can_be_confused_with(surface, kind, found):
                return True
    return False


@kernel
def sole_surface(surfaces, constant):
    """The one possible surface, with a type of constant parameter left if so asked; NO_SURFACE or SEVERAL."""
    found = NO_SURFACE
    for s, surface in enumerate(surfaces):
        if (
            surface.status.is_candidate
            and can_be_at_fault(surface)
            and (any_constant_type_remains(surface) or not constant)
        ):
            found = s if found == NO_SURFACE else SEVERAL_SURFACES
    return found


@kernel
def surface_at_fault(types, layout):
    """The surface the fault is on, NOT_ISOLATED or UNANTICIPATED.

    What acts on pitch alone shows no direction, so a surface left over there must also have a type that
    explains it. Of elevator and flap, each of which can do what the other does if it only moves accordingly,
    the one is named for which a constant suffices, once a slow oscillation of the other would have shown.
    """
    s = sole_surface(types.surface, False)
    if s == NO_SURFACE:
        return UNANTICIPATED
    if s >= 0:
        return s if layout.dominant_axis[s] != PITCH or is_explained(types.surface[s]) else NOT_ISOLATED
    s = sole_surface(types.surface, True)
    return s if s >= 0 and others_refuted(types, s) else NOT_ISOLATED


@kernel
def others_refuted(types, chosen):
    """Whether every other surface can only have a fault that depends on the command of the chosen one.

    A type that must show itself is given the time to. Where errors are declared that a course can hide in,
    every type of the others must have been excluded.
    """
    config, half_cycles = types.config, 1
    for s, surface in enumerate(types.surface):
        if s != chosen and surface.status.is_candidate and can_be_at_fault(surface):
            if config.has_surface_errors and any_type_remains(surface):
                return False
            if not types_would_have_shown(config, surface):
                return False
            for kind in range(N_TYPES):
                if type_remains(surface, kind):
                    if not FOLLOWS_COMMAND[kind]:
                        return False
                    half_cycles = max(half_cycles, HALF_CYCLES[kind])
    return types.surface[chosen].evidence.frames >= half_cycles * config.half_cycle_frames


@kernel
def type_at_fault(config, surface):
    """The type of the fault on a surface, taken to be at fault; OPEN while more than one fits or one may yet
    show itself."""
    if surface.evidence.frames < config.half_cycle_frames or can_hide_at_rest(config, surface):
        return TYPE_OPEN
    if config.has_surface_errors:
        return sole_type(surface)
    waited = types_would_have_shown(config, surface)
    if any_constant_type_remains(surface):
        found = sole_constant_type(surface)
        return found if waited and not can_be_another_type(surface, found, True) else TYPE_OPEN
    return varying_type_at_fault(surface, waited)


@kernel
def varying_type_at_fault(surface, waited):
    """The same when no constant explains it: the one type left that need not show itself; else the one that
    has."""
    found = sole_varying_type(surface, False)
    if found == NO_TYPE:
        found = sole_varying_type(surface, True)
        return found if found >= 0 and has_shown(surface, found) else TYPE_OPEN
    if found < 0 or not waited:
        return TYPE_OPEN
    for kind in range(N_CONSTANT, N_TYPES):
        if type_remains(surface, kind) and MISTAKEN_FOR[kind, found]:
            return TYPE_OPEN
    return found


@kernel
def sole_varying_type(surface, must_show):
    """The one type of a parameter that varies which is left, of those that must show themselves or of those
    that need not; NO_TYPE, or OPEN if there are several."""
    found = NO_TYPE
    for kind in range(N_CONSTANT, N_TYPES):
        if type_remains(surface, kind) and MUST_SHOW[kind] == must_show:
            found = kind if found == NO_TYPE else TYPE_OPEN
            if found == TYPE_OPEN:
                return TYPE_OPEN
    return found


@kernel
def decide_surface_and_type(types, conclusion, layout, estimators, t):
    """The finding on the surface and, when it is certain, on the type, for `conclusion.record_finding`.

    conclusion: that of the frame before, which gives the instants of what has not changed; t s.
    """
    s, before = surface_at_fault(types, layout), conclusion.isolated
    if before >= 0:
        before = estimators[before].surface
    kind = type_at_fault(types.config, types.surface[s]) if s >= 0 else -1
    isolated_at_s = t if s != before else conclusion.isolated_at_s
    type_at_s = t if kind != conclusion.type else conclusion.type_at_s
    isolated = estimator_of_fault(layout, s, kind) if s >= 0 else s
    lead, lead_kind = choose_accommodated_surface(types, isolated, layout, estimators)
    return isolated, isolated_at_s, kind, type_at_s, lead, lead_kind


@kernel
def estimator_of_fault(layout, s, kind):
    """The estimator that stands for a fault of this type (OPEN if open) on surface s."""
    return (
        layout.loss_estimator[s]
        if kind >= 0 and ACCOMMODATION[kind] == SCALE_COMMAND
        else layout.position_estimator[s]
    )


@kernel
def accommodation_mode(surface):
    """The mode of accommodation for a surface at fault as far as is known: LOSES, FIXED, LAGS or SHIFTED.

    SHIFTED subtracts what the last frame shows to be off: that is right for a bias and an oscillation, serves
    a loss of effectiveness meanwhile, and moves the command so that a jam shows in the next frame.
    """
    constant = any_constant_type_remains(surface)
    for mode in (GIVE_UP, SCALE_COMMAND, WAIT_FOR_SURFACE):
        if constant and serves_all_constant_types(surface, mode):
            return mode
    for mode in (SCALE_COMMAND, WAIT_FOR_SURFACE, GIVE_UP):
        if not constant and suits_a_varying_type(surface, mode):
            return mode
    return SUBTRACT_OFFSET


@kernel
def serves_all_constant_types(surface, mode):
    """Whether a mode is that of some type of constant parameter left, and serves all of them."""
    suits = False
    for kind in range(N_CONSTANT):
        if type_remains(surface, kind):
            suits = suits or ACCOMMODATION[kind] == mode
            at_limit = (
                LIMIT_TYPE[kind] >= 0
                and type_remains(surface, LIMIT_TYPE[kind])
                and SERVES_TYPE[mode, LIMIT_TYPE[kind]]
            )
            if not (SERVES_TYPE[mode, kind] or at_limit):
                return False
    return suits


@kernel
def suits_a_varying_type(surface, mode):
    """Whether a mode is that of some type left whose parameter varies."""
    for kind in range(N_CONSTANT, N_TYPES):
        if type_remains(surface, kind) and ACCOMMODATION[kind] == mode:
            return True
    return False


@kernel
def presumed_surface(types, isolated, layout, estimators):
    """The surface the law acts upon: the one at fault, or the likeliest; NO_SURFACE yet.

    It acts before all doubt is gone, since it can take it back. Of elevator and flap it does not matter which
    is thought to be off, as long as both follow their commands: the moment is the same.
    """
    if isolated >= 0:
        return estimators[isolated].surface
    s = sole_surface(types.surface, True)
    if s >= 0:
        return s
    for s, surface in enumerate(types.surface):
        if layout.dominant_axis[s] == PITCH and can_be_at_fault(surface):
            return s
    return NO_SURFACE


@kernel
def set_mode(surface, mode):
    """Replace the mode of accommodation of a surface, -1 for none."""
    surface.accommodation.mode = mode


@kernel
def clear_modes(surfaces):
    """Let the law act upon no surface."""
    for surface in surfaces:
        set_mode(surface, -1)


@kernel
def choose_accommodated_surface(types, isolated, layout, estimators):
    """The surface on which the law acts, or NO_SURFACE, and how; isolated: an estimator, if any."""
    s = presumed_surface(types, isolated, layout, estimators)
    clear_modes(types.surface)
    if s < 0:
        return NO_SURFACE, -1
    surface = types.surface[s]
    mode = accommodation_mode(surface)
    if fault_is_present(types.config, surface, mode, True):
        set_mode(surface, mode)
        return s, mode
    return NO_SURFACE, mode


@kernel
def fault_is_present(config, surface, mode, at_fault):
    """Whether the fault of a surface shows, or did a moment ago."""
    seen, accommodation = surface.elapsed, surface.accommodation
    deflection = deflection_error(surface, at_fault) + seen.command
    there = seen.low <= deflection <= seen.high or mode == SCALE_COMMAND
    accommodation.frames_absent = 0 if there else accommodation.frames_absent + 1
    return accommodation.frames_absent * config.dt < ABSENCE_LIMIT_S - _ROUNDING


@kernel
def deflection_error(surface, at_fault):
    """How far a surface is off its command, rad: by the types left if it is at fault, or as the last frame
    shows it."""
    if at_fault:
        for kind in ERROR_ORDER:
            if type_remains(surface, kind):
                error = expected_error(surface, kind)
                if np.isfinite(error):
                    return error
                break
    return observed_error(surface)


@kernel
def effectiveness_left(types, layout, estimators, s):
    """What surface s has left of its effectiveness.

    The estimator fits both axes of a surface, so with a second fault the set of a constant loss is used.
    """
    surface = types.surface[s]
    if types.pair.enabled and can_be_at_fault(surface):
        for kind in range(N_CONSTANT):
            if ACCOMMODATION[kind] == SCALE_COMMAND and type_remains(surface, kind):
                return set_middle(surface, kind)
    return 1.0 + estimators[layout.loss_estimator[s]].theta[layout.dominant_axis[s]]


Findings = dict[str, Any]
_NOTHING: Findings = {
    "isolated": None, "isolation_type": None, "estimate": None, "isolation_time_s": None,
    "candidates": (), "faults": (),
}  # fmt: skip


def fault_findings(fdi: np.void, surfaces: Sequence[str]) -> Findings:
    """isolated, isolation_type, candidates, estimate and more of a Flight diagnosed for every type.

    surfaces: their names.
    """
    if not fdi["verdict"]["detected"]:
        return dict(_NOTHING)
    if fdi["types"]["pair"]["enabled"]:
        return _found_of_several(fdi, surfaces)
    return _found_of_one(fdi, surfaces)


def _found_of_several(fdi: np.void, names: Sequence[str]) -> Findings:
    """The fault named first as if it were alone, and all of them; what is open in a plane where none is."""
    status = fdi["types"]["surface"]["status"]
    at_fault = sorted(np.flatnonzero(status["named"]).tolist(), key=lambda s: status["named_at_s"][s])
    faults = [_found_on(fdi, s, int(status["type"][s]), names) for s in at_fault]
    planes = fdi["types"]["pair"]["alarmed"]
    surfaces_of = [np.flatnonzero(fdi["layout"]["group"] == g).tolist() for g in range(len(planes))]
    if not planes.any() and not faults and int(fdi["verdict"]["isolated"]) == NOT_ISOLATED:
        planes = np.ones_like(planes)  # a statistical alarm by itself says of no plane that it is there
    open_planes = [
        {**_NOTHING, "candidates": tuple(_remaining_candidates(fdi, plane, names))}
        for alarmed, plane in zip(planes, surfaces_of, strict=True)
        if alarmed and not set(plane) & set(at_fault)
    ]
    if faults:
        return {**faults[0], "faults": (*faults, *open_planes)}
    if int(fdi["verdict"]["isolated"]) == UNANTICIPATED:
        return {**_found_of_one(fdi, names), "faults": tuple(open_planes)}
    left = tuple(candidate for plane in open_planes for candidate in plane["candidates"])
    return {**_NOTHING, "candidates": left, "faults": tuple(open_planes)}


def _found_of_one(fdi: np.void, names: Sequence[str]) -> Findings:
    verdict, at_s = int(fdi["verdict"]["isolated"]), float(fdi["verdict"]["isolated_at_s"])
    if verdict == NOT_ISOLATED:
        return {**_NOTHING, "candidates": tuple(_remaining_candidates(fdi, range(len(names)), names))}
    if verdict == UNANTICIPATED:
        said = "unanticipated"
        return {**_NOTHING, "isolated": said, "isolation_type": said, "isolation_time_s": at_s}
    s, kind = int(fdi["isolation"]["estimator"][verdict]["surface"]), int(fdi["verdict"]["type"])
    return {
        **_found_on(fdi, s, kind, names),
        "isolation_time_s": at_s,
        "type_time_s": float(fdi["verdict"]["type_at_s"]) if kind >= 0 else None,
    }


def _found_on(fdi: np.void, s: int, kind: int, names: Sequence[str]) -> Findings:
    """What is known of surface s, which is at fault; kind: of which type, -1 if open."""
    surface = fdi["types"]["surface"][s]
    return {
        "isolated": names[s],
        "isolation_time_s": float(surface["status"]["named_at_s"]),
        "isolation_type": registry.NAMES[kind] if kind >= 0 else None,
        "type_time_s": float(surface["status"]["type_at_s"]) if kind >= 0 else None,
        "candidates": (registry.NAMES[kind],) if kind >= 0 else tuple(_types_left(fdi, s)),
        "estimate": estimate_of(fdi, s, kind),
        "estimate_interval": _of_type(kind, "interval", fdi, s, kind),
        "frequency_rad_s": _of_type(kind, "frequency_rad_s", fdi, s, kind),
    }


def estimate_of(fdi: np.void, s: int, kind: int) -> float | None:
    """What is known of the size of a fault of this type on surface s; see the top of this file."""
    estimate: float | None = _of_type(kind, "estimate", fdi, s, kind)
    return estimate


def _of_type(kind: int, what: str, *arguments: Any) -> Any:
    """What a type's row says; None while the type is open."""
    return getattr(registry.TYPES[kind], what)(*arguments) if kind >= 0 else None


def _can_be_at_fault(fdi: np.void, s: int) -> bool:
    surface = fdi["types"]["surface"][s]
    if surface["status"]["named"] or surface["status"]["decided_by"] == BY_DEDUCTION:
        return True
    return not (surface["status"]["decided_by"] == RULED_OUT or surface["estimator_excluded"])


def _types_left(fdi: np.void, s: int) -> list[str]:
    """Types still possible on surface s, each once.

    Where a constant explains the flight, a type that varies and need not show itself counts only until the
    constant has been seen for long enough, or until those types are excluded that it can look like.
    """
    surface = fdi["types"]["surface"][s]
    left = [
        kind
        for kind, out in enumerate(surface["feasible"]["excluded"])
        if _can_be_at_fault(fdi, s) and not out
    ]
    constant = [kind for kind in left if kind < registry.N_CONSTANT]
    if constant and not fdi["types"]["config"]["has_surface_errors"]:
        evidence, half_cycle_frames = surface["evidence"], fdi["types"]["config"]["half_cycle_frames"]
        early = evidence["frames"] - evidence["rest_frames"] < half_cycle_frames
        left = [kind for kind in left if kind in constant or early or _is_open(kind, constant)]
    second_is_possible = fdi["types"]["pair"]["enabled"] and fdi["layout"]["group"][s] == PITCH_GROUP
    if second_is_possible and any(registry.ACCOMMODATION[kind] == GIVE_UP for kind in constant):
        # if the other surface is off as well, each constant may be one of another type
        left += sorted(
            range(registry.N_CONSTANT), key=lambda kind: registry.ACCOMMODATION[kind] == SCALE_COMMAND
        )
    return list(dict.fromkeys(registry.NAMES[kind] for kind in left))


def _is_open(kind: int, constant: list[int]) -> bool:
    """Whether a varying type counts together with these constant ones: it may yet show itself, or looks like
    one of them."""
    return bool(registry.MUST_SHOW[kind] or registry.MISTAKEN_FOR[kind, constant].any())


def _remaining_candidates(fdi: np.void, among: Iterable[int], names: Sequence[str]) -> Iterator[str]:
    """`surface:type` for each that is possible; bare surfaces and `unanticipated` where no type fits.

    Of one plane also both its surfaces, as `elevator+flap`.
    """
    possible = [s for s in among if _can_be_at_fault(fdi, s)]
    for s in possible:
        types = _types_left(fdi, s)
        yield from (f"{names[s]}:{kind}" for kind in types) if types else (names[s],)
    if fdi["types"]["pair"]["enabled"]:
        yield "+".join(names[s] for s in among)
    if not any(_types_left(fdi, s) for s in possible):
        yield "unanticipated"
