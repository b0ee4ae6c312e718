"""The fault class: what each isolation estimator believes has happened to its surface.

Every hypothesis is linear in one unknown parameter per axis, phi_i = base_i + theta_i Z_i:

    loss of effectiveness   base 0          Z_i = G_is u_s      theta in [-1, 0]       [Zhang2005, eq. (4)]

A new fault type is one entry in `PARAMETER_SET` and one branch in `hypothesis`.
"""

from beaver_ftc.compiled import kernel

LOSS = 0
PARAMETER_SET = {LOSS: (-1.0, 0.0)}


@kernel
def hypothesis(kind, surface, G, Gu, base, Z):
    """Fill base (3,) rad/s2 and the regressor Z (3,) rad/s2 per unit of theta, for one fault of `surface`.

    G (3, 4) rad/s2 per rad; Gu (3, 4) rad/s2, the acceleration each commanded surface would give if healthy.
    """
    for i in range(3):
        base[i] = 0.0
        Z[i] = Gu[i, surface]
