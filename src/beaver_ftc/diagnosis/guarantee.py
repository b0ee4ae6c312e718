"""The instant from which detection is certain, whatever the uncertainty does.

If |int e^{-lam (t - tau)} phi_i dtau| > 2 ebar_i for some i, the fault has been detected by t [Zhang2002]:
at worst an admissible eta hides ebar_i of the fault's effect. With a bank of poles, the first of theirs.
The effect phi is the truth's, so this is an analyst's figure: the diagnosis never sees it.
"""

from beaver_ftc.compiled import kernel


@kernel
def track(fdi, phi):
    """Advance the filtered effect of the fault by a frame; phi (3,) rad/s2, its mean over that frame."""
    for i in range(3):
        for m in range(fdi.n_poles):
            fdi.effect[m, i] = fdi.bank_decay[m] * fdi.effect[m, i] + fdi.dt * phi[i]


@kernel
def judge(fdi, t):
    """Note the first instant t (s) of certainty."""
    for i in range(3):
        for m in range(fdi.n_poles):
            if fdi.certain_after_s < 0.0 and abs(fdi.effect[m, i]) > 2.0 * fdi.bank_threshold[m, i]:
                fdi.certain_after_s = t
