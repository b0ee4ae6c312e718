"""The fault class: what each isolation estimator believes has happened to its surface.

Every hypothesis is linear in one unknown parameter per axis, phi_i = base_i + theta_i Z_i:

    loss of effectiveness   base 0          Z_i = G_is u_s      theta in [-1, 0]       [Zhang2005, eq. (4)]
    position                base -G_is u_s  Z_i = G_is          theta in the travel

LOSS on aileron, elevator and rudder is the published class. POSITION says no more than "this surface is where
it should not be": its parameter, the deflection rad, may move as it likes, so it covers whatever can befall
the surface. The two together are `fdi.fault_class: all`; what has befallen it is the question of types/.
"""

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.state import LOSS, POSITION

PARAMETER_SET = {LOSS: (-1.0, 0.0)}


@kernel
def hypothesis(kind, surface, G, Gu, base, Z):
    """Fill base (3,) rad/s2 and the regressor Z (3,) rad/s2 per unit of theta, for one fault of `surface`.

    G (3, 4) rad/s2 per rad; Gu (3, 4) rad/s2, the acceleration each commanded surface would give if healthy.
    """
    for i in range(3):
        if kind == POSITION:
            base[i], Z[i] = -Gu[i, surface], G[i, surface]
        else:
            base[i], Z[i] = 0.0, Gu[i, surface]
