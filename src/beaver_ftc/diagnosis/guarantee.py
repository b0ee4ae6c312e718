"""The instant from which detection is certain, whatever the uncertainty does.

If |int e^{-lam (t - tau)} phi_i dtau| > 2 ebar_i for some i, the fault has been detected by t [Zhang2002]: at worst an admissible eta
hides ebar_i of the fault's effect. The effect phi is the truth's, so this is an analyst's figure: the diagnosis never sees it.
"""

from numba import njit


@njit(cache=True)
def track(fdi, phi, t):
    """Advance the filtered effect of the fault and note the first instant of certainty.

    phi (3,) rad/s2, the fault's angular acceleration in this frame; t s, the frame's time. Call before the FDAE's `predict`.
    """
    for i in range(3):
        if fdi.certain_after_s < 0.0 and abs(fdi.effect[i]) > 2.0 * fdi.threshold[i]:
            fdi.certain_after_s = t
        fdi.effect[i] = fdi.decay[i] * fdi.effect[i] + fdi.dt * phi[i]
