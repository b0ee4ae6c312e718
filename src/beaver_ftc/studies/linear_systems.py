"""Linear systems, and a linear aircraft as one: modes by name, zeros, frequency responses.

CLASSICAL has eight states: position, altitude and heading are left out. On a flat Earth nothing depends on
heading. On a turning Earth, lift depends on it a little (2 Omega cos(latitude) per rad), which moves the slow
spiral root by up to 7e-4 1/s.

python-control gives the same results (tests/studies/test_linear_systems.py). It is no dependency, because it
imports matplotlib, and a command would begin a second later.
"""

from dataclasses import dataclass

import numpy as np

LONGITUDINAL = ("airspeed", "alpha", "q", "theta")
LATERAL = ("beta", "p", "r", "phi")
CLASSICAL = LONGITUDINAL + LATERAL
MODES = ("short_period", "phugoid", "roll", "dutch_roll", "spiral")
MAX_ZERO_PER_S = 1e6  # a larger root is a zero at infinity that rounding has made finite
CHANNELS = (("aileron", "p"), ("elevator", "q"), ("rudder", "r"))  # surface and the rate that it controls


@dataclass(frozen=True)
class Mode:
    """One mode. pole: of a complex pair, the pole with the positive imaginary part, 1/s."""

    pole: complex

    @property
    def frequency_rad_s(self) -> float:
        """Undamped natural frequency |pole|, rad/s."""
        return abs(self.pole)

    @property
    def damping(self) -> float:
        """Damping ratio -Re(pole) / |pole|: 1 for a stable real pole."""
        return -self.pole.real / abs(self.pole)


def modes(A: np.ndarray) -> dict[str, Mode]:
    """The five modes of a system matrix (8, 8) over CLASSICAL, by name.

    The four poles with the largest participation of lateral states are lateral. Of these, the pair with the
    largest imaginary part is the Dutch roll; the faster of the others is the roll mode, the slower the spiral
    mode. If the others are a second pair (a lateral phugoid), both names get a pole of it. Of the four
    longitudinal poles, the fastest is the short period, the slowest the phugoid.
    """
    poles, shapes = np.linalg.eig(A)
    share = np.abs(shapes * np.linalg.inv(shapes).T)  # participation of each state in each mode
    lateral = share[len(LONGITUDINAL) :].sum(axis=0) / share.sum(axis=0)
    order = np.argsort(lateral)
    slow, *_, fast = sorted(poles[order[:4]], key=abs)
    dutch, _, *others = sorted(poles[order[4:]], key=lambda pole: -abs(pole.imag))
    spiral, roll = sorted(others, key=abs)
    pole_of = {"short_period": fast, "phugoid": slow, "roll": roll, "dutch_roll": dutch, "spiral": spiral}
    return {name: Mode(complex(pole_of[name].real, abs(pole_of[name].imag))) for name in MODES}


def deviation(pole: complex, reference: complex) -> float:
    """Distance of two poles over the magnitude of the reference."""
    return abs(pole - reference) / abs(reference)


def response(A: np.ndarray, b: np.ndarray, row: int, frequency_rad_s: np.ndarray) -> np.ndarray:
    """Frequency response (n,), complex: element `row` of (i w I - A)^-1 b, b (states,) the column of an
    input."""
    identity = np.eye(len(A))
    return np.array([np.linalg.solve(1j * w * identity - A, b)[row] for w in frequency_rad_s])


def zeros(A: np.ndarray, b: np.ndarray, row: int) -> np.ndarray:
    """Transmission zeros from the input with column b to state `row`, 1/s, slowest first; of a pair, the zero
    with the positive imaginary part first.

    They are the finite generalised eigenvalues of [[A, b], [c, 0]] and [[I, 0], [0, 0]], c the unit row of
    the state.
    """
    from scipy.linalg import eigvals

    n = len(A)
    c = np.eye(n)[row]
    system = np.block([[A, b[:, None]], [c[None, :], np.zeros((1, 1))]])
    eigenvalues = eigvals(system, np.diag([1.0] * n + [0.0]))
    finite = eigenvalues[np.isfinite(eigenvalues) & (np.abs(eigenvalues) < MAX_ZERO_PER_S)]
    # six digits: the last digits of a pair differ by machine
    size = [float(f"{magnitude:.6g}") for magnitude in np.abs(finite)]
    return finite[np.lexsort((-finite.imag, size))]


def held_over_frame(A: np.ndarray, B: np.ndarray, dt_s: float) -> tuple[np.ndarray, np.ndarray]:
    """The exact discrete system Ad (n, n), Bd (n, m) for inputs held over a frame:

    [[Ad, Bd], [0, I]] = exp([[A, B], [0, 0]] dt_s)
    """
    from scipy.linalg import expm

    n, m = B.shape
    E = expm(np.block([[A, B], [np.zeros((m, n + m))]]) * dt_s)
    return E[:n, :n], E[:n, n:]
