"""Linear systems, and a linear aircraft as one: modes by name, zeros, frequency responses.

Classical eight states: position, altitude and heading are left out. On a flat Earth nothing depends on
heading; on a turning one lift does a little (2 Omega cos(latitude) per rad), which moves the slow spiral
root by up to 7e-4 1/s.

python-control gives the same (tests/studies/test_linear_systems.py). It is no dependency for these twenty
lines: it imports matplotlib, and with it a command begins a second later.
"""

from dataclasses import dataclass

import numpy as np

LONGITUDINAL = ("airspeed", "alpha", "q", "theta")
LATERAL = ("beta", "p", "r", "phi")
CLASSICAL = LONGITUDINAL + LATERAL
MODES = ("short_period", "phugoid", "roll", "dutch_roll", "spiral")
MAX_ZERO_PER_S = 1e6  # a larger root is a zero at infinity, made finite by rounding
CHANNELS = (("aileron", "p"), ("elevator", "q"), ("rudder", "r"))


@dataclass(frozen=True)
class Mode:
    """One mode: its pole with the larger imaginary part, 1/s."""

    pole: complex

    @property
    def frequency_rad_s(self) -> float:
        """Undamped natural frequency; for a real pole its magnitude."""
        return abs(self.pole)

    @property
    def damping(self) -> float:
        """Damping ratio: 1 for a stable real pole."""
        return -self.pole.real / abs(self.pole)


def modes(A: np.ndarray) -> dict[str, Mode]:
    """The five modes of a system matrix (8, 8) over CLASSICAL, by name.

    The lateral poles are assumed to be a complex pair, the dutch roll, and two real roots: the faster is the
    roll, the slower the spiral. If these form a second pair (a lateral phugoid), both names get a pole of
    it. Of the four longitudinal poles the fastest is the short period, the slowest the phugoid.
    """
    poles, shapes = np.linalg.eig(A)
    share = np.abs(shapes * np.linalg.inv(shapes).T)  # participation of each state in each mode
    lateral = share[len(LONGITUDINAL) :].sum(axis=0) / share.sum(axis=0)
    order = np.argsort(lateral)
    slow, *_, fast = sorted(poles[order[:4]], key=abs)
    dutch, _, *real = sorted(poles[order[4:]], key=lambda pole: -abs(pole.imag))
    spiral, roll = sorted(real, key=abs)
    found = {"short_period": fast, "phugoid": slow, "roll": roll, "dutch_roll": dutch, "spiral": spiral}
    return {name: Mode(complex(found[name].real, abs(found[name].imag))) for name in MODES}


def deviation(pole: complex, reference: complex) -> float:
    """Distance of two poles over the reference's magnitude."""
    return abs(pole - reference) / abs(reference)


def response(A: np.ndarray, b: np.ndarray, row: int, frequency_rad_s: np.ndarray) -> np.ndarray:
    """Frequency response (n,), complex, from an input (column b) to state `row`."""
    identity = np.eye(len(A))
    return np.array([np.linalg.solve(1j * w * identity - A, b)[row] for w in frequency_rad_s])


def zeros(A: np.ndarray, b: np.ndarray, row: int) -> np.ndarray:
    """Transmission zeros from input column b to state `row`, slowest first, of a pair the upper one first.

    The finite generalised eigenvalues of [[A, b], [c, 0]] against [[I, 0], [0, 0]].
    """
    from scipy.linalg import eigvals

    n = len(A)
    c = np.eye(n)[row]
    system = np.block([[A, b[:, None]], [c[None, :], np.zeros((1, 1))]])
    found = eigvals(system, np.diag([1.0] * n + [0.0]))
    finite = found[np.isfinite(found) & (np.abs(found) < MAX_ZERO_PER_S)]
    size = [float(f"{each:.6g}") for each in np.abs(finite)]  # the last digits of a pair differ by machine
    return finite[np.lexsort((-finite.imag, size))]


def held_over_frame(A: np.ndarray, B: np.ndarray, dt_s: float) -> tuple[np.ndarray, np.ndarray]:
    """The discrete system (n, n), (n, m) for inputs held over a frame; exact."""
    from scipy.linalg import expm

    n, m = B.shape
    whole = expm(np.block([[A, B], [np.zeros((m, n + m))]]) * dt_s)
    return whole[:n, :n], whole[:n, n:]
