"""The fault class: what each isolation estimator believes has happened to its surface.

Every hypothesis is linear in one unknown parameter per axis, phi_i = base_i + theta_i Z_i:

    loss of effectiveness   base 0          Z_i = G_is u_s      theta in [-1, 0]       [Zhang2005, eq. (4)]
    position                base -G_is u_s  Z_i = G_is          theta in the travel

LOSS on aileron, elevator and rudder is the published class. POSITION says only that the surface is not
where its command puts it: its parameter, the deflection in rad, may change in any way, so it covers every
fault of the surface. The two together are `fdi.fault_class: all`; types/ finds out which type of fault it is.
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
