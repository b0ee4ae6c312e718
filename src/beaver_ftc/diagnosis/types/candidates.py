"""Which types are left: questions about the sets that the examination keeps.

Kernels of one surface answer under the premise that it is at fault; `possible` says whether it can be.
"""

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.types.registry import (
    BIAS,
    CONSTANT_LOSS,
    DOWN,
    FAMILY,
    FLOAT,
    GROWING_BIAS,
    N_CONSTANT,
    N_TYPES,
    OSCILLATORY,
    SLOW,
    STUCK,
    UP,
    VARYING_LOSS,
    shown,
)

NO_SURFACE, SEVERAL = -1, -2
# What decides whether a surface can be at fault: its estimator, or what is known of the other (pairs.py).
BY_ESTIMATOR, BY_DEDUCTION, RULED_OUT = range(3)


@kernel
def possible(fdi, s):
    """Whether anything on surface s can be the fault."""
    standing = fdi.types.surface[s].standing
    if standing != BY_ESTIMATOR:
        return standing == BY_DEDUCTION
    return not fdi.isolation.estimator[fdi.layout.position_of[s]].excluded


@kernel
def left(surface, kind):
    """Whether a type is not excluded."""
    return not surface.type_excluded[kind]


@kernel
def any_constant(surface):
    """Whether a type with a constant parameter is left."""
    for kind in range(N_CONSTANT):
        if left(surface, kind):
            return True
    return False


@kernel
def anything_left(surface):
    """Whether any type is left."""
    for kind in range(N_TYPES):
        if left(surface, kind):
            return True
    return False


@kernel
def explained(surface):
    """Whether some type explains the flight: it is left, and if it must show itself it has."""
    for kind in range(N_TYPES):
        if left(surface, kind) and shown(surface, kind):
            return True
    return False


@kernel
def swings(surface):
    """Whether the surface is known to have swung for two half-cycles and more."""
    return left(surface, OSCILLATORY) and shown(surface, OSCILLATORY)


@kernel
def would_have_swung(fdi, surface):
    """Whether there is no oscillation, or a whole one of the slowest would have shown, hidden by no stop."""
    return not left(surface, OSCILLATORY) or surface.unhidden >= 2 * fdi.types.config.patience


@kernel
def only_a_swing(surface):
    """Whether nothing but an oscillation is left, and it has not swung for long enough."""
    for kind in range(N_TYPES):
        if kind != OSCILLATORY and left(surface, kind):
            return False
    return not swings(surface)


@kernel
def loses(surface):
    """Whether a loss of effectiveness is left; one that varies counts only when no constant explains it."""
    varies = left(surface, VARYING_LOSS) and not any_constant(surface)
    return left(surface, CONSTANT_LOSS) or varies


@kernel
def held_elsewhere(surface):
    """Whether a jam or a runaway is left."""
    return left(surface, STUCK) or left(surface, UP) or left(surface, DOWN)


@kernel
def is_fixed(surface):
    """Whether the surface is known to ignore its command."""
    other = left(surface, BIAS) or (loses(surface) and not left(surface, FLOAT))
    return held_elsewhere(surface) and not other


@kernel
def one_type(surface):
    """The one type of constant parameter left, or -1; of one name, such as a runaway's two, the first."""
    found = -1
    for kind in range(N_CONSTANT):
        if left(surface, kind):
            if found >= 0 and FAMILY[kind] != FAMILY[found]:
                return -1
            found = kind if found < 0 else found
    return found


@kernel
def sole_type(surface):
    """The one type left whatever its course, or -1: in coarse sets a constant proves nothing."""
    found = -1
    for kind in range(N_TYPES):
        if left(surface, kind):
            if found >= 0 and FAMILY[kind] != FAMILY[found]:
                return -1
            found = kind if found < 0 else found
    return found if found >= 0 and shown(surface, found) else -1


@kernel
def may_be_slow(fdi, surface):
    """Whether what looks like a jam may be a slow surface that has come to where it is commanded: it has not
    stood off its command for long."""
    loud = surface.evidence - surface.quiet
    return any_constant(surface) and left(surface, SLOW) and loud < fdi.types.config.patience


@kernel
def may_creep(surface, found):
    """Whether what stands still may be a slow surface that has not been seen to do so for long enough."""
    return found in (STUCK, FLOAT, UP, DOWN) and left(surface, SLOW)


@kernel
def may_be_growing(surface, found):
    """Whether what looks like a jam or a loss may be a bias that grows as the command happens to go; or what
    looks like a runaway, one that has come to the stop by and by."""
    if found in (UP, DOWN):
        ran = surface.growing_bias.ran
        slowly = (left(surface, UP) and not ran[1]) or (left(surface, DOWN) and not ran[0])
        return slowly and left(surface, GROWING_BIAS)
    return found in (CONSTANT_LOSS, STUCK, FLOAT) and left(surface, GROWING_BIAS)


@kernel
def sole(fdi, constant):
    """The one possible surface, with a type of constant parameter left if so asked; NO_SURFACE or SEVERAL."""
    found = NO_SURFACE
    for s in range(fdi.types.surface.size):
        surface = fdi.types.surface[s]
        if surface.in_question and possible(fdi, s) and (any_constant(surface) or not constant):
            found = s if found == NO_SURFACE else SEVERAL
    return found
