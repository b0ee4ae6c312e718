"""What the adaptive laws believe of each surface, moved smoothly.

The isolated estimator's theta becomes the effectiveness 1 + theta of its surface; it is rate limited, so
that a decision never kicks the surfaces, and projected: a surface weaker than `least_effectiveness` is
given up rather than divided by.
"""

from beaver_ftc.compiled import kernel


@kernel
def approach(control, target):
    """Move the effectiveness the law uses towards target (n,) by at most one step."""
    step = control.effectiveness_step
    for s in range(target.size):
        change = target[s] - control.effectiveness[s]
        control.effectiveness[s] += min(max(change, -step), step)


@kernel
def allow_for_offsets(control, G):
    """Take off the demand what the surfaces give unasked: G (3, n) rad/s2 per rad times the offsets."""
    for i in range(3):
        for s in range(G.shape[1]):
            control.demand[i] -= G[i, s] * control.offset[s]
            control.hold[i] -= G[i, s] * control.offset[s]


@kernel
def believed_effectiveness(control, G, G_believed):
    """Fill G_believed (3, n): G with each column scaled by its surface's effectiveness, or given up."""
    for s in range(G.shape[1]):
        effectiveness = control.effectiveness[s]
        if effectiveness < control.least_effectiveness:
            effectiveness = 0.0
        for i in range(3):
            G_believed[i, s] = G[i, s] * effectiveness
