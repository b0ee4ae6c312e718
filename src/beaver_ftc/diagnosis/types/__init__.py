"""Which type of fault is on a surface: exact feasible sets, frame by frame.

The innovation nu = eta + G_s (p_s - u_s) and |eta| <= eta_bar put the surface's true deflection p_s of each
frame in an interval, its axes agreeing on one. A type is a statement about p_s that holds in every frame in
which something is wrong; the set of its one parameter is the intersection over those frames, and the type is
excluded when nothing is left. For a bound that holds instant by instant this is the exact feasible set: no
test can exclude a type sooner without excluding a true one at some time.

    loss            p = (1 + theta) u      1 + theta in [0, 1], constant
    varying loss    the same               1 + theta anywhere in [0, 1] in every frame (incipient)
    stuck           p = c                  c in the travel
    float           p = 0
    hardover        p reaches its stop at no less than half its rate limit, and stays
    bias            p = u + b              b constant; cut off by the stops
    oscillatory     p - u swings about 0   no half-cycle longer than pi / slowest oscillation
    rate limit      p moves to u only      at any rate
    growing bias    p = u + b              b of one sign and never smaller (incipient)

A frame that eta alone explains gives no information: so a fault may be intermittent. The promise: the type,
constant while it is there, is never excluded, and so never misnamed. What cannot be distinguished stays a
candidate.

Each type is a row of a file under table/. contract.py says what is in a row, and has feasible sets and
observations of a surface; registry.py reads the rows into arrays and records. Each frame it also finds
where each surface was and tests every type; verdict.py and pairs.py conclude.
"""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.diagnosis.types.registry import NAMES as TYPE_NAMES
    from beaver_ftc.diagnosis.types.registry import TYPES as TYPE_ROWS
    from beaver_ftc.diagnosis.types.registry import WORDS as TYPE_WORDS
    from beaver_ftc.diagnosis.types.registry import kind_of
else:
    __getattr__, __dir__ = lazily(__name__)
