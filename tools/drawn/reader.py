"""A second reader of certificates, written from docs/theory.md alone: its recursions, frame by frame.

It shares no code with tools/check_certificate.py, which sums what is left of each frame; the two must agree.
"""

from collections.abc import Iterator
from hashlib import sha256
from json import dumps
from math import exp, fsum, isclose
from typing import Any

import numpy as np

Document = dict[str, Any]
Columns = dict[str, np.ndarray]
Vector = list[float]
ROUNDING_RAD_S2 = 1e-11  # rho
OTHER_TWO = ((1, 2), (0, 2), (0, 1))
_ANGLES = "turning p", "turning q", "turning r", "phi", "theta", "psi"
TESTS = (*_ANGLES, "V", "alpha", "beta", "density", "altitude", "engine_rpm", "manifold_pressure")
PUBLISHED_TO_SHARE, MEANS_TO_SHARE, SIDES_TO_SHARE = 3e-14, 1e-13, 1e-12


class Doubtful(Exception):
    """What a certificate says is not so."""


class Flight:
    """What a log says, and what follows from the declared errors, one frame at a time."""

    def __init__(self, document: Document, log: Columns) -> None:
        declared = document["declared"]
        self.log, self.rows, self.dt = log, len(log["t_s"]), document.get("dt_s")
        self.instants = document.get("instants", 1)
        self.declared = {name: _by_axis(declared[name]) for name in ("c", "b", "g", "o", "B", "m")}
        self.earth = document.get("omega_E", 0.0)

    def logged(self, quantity: str, k: int) -> Vector:
        """p, q, r of a column in row k."""
        return [float(self.log[f"{axis}_{quantity}"][k]) for axis in "pqr"]

    def innovation(self, k: int) -> Vector:
        """nu of section 1."""
        now, then = self.logged("measured_rad_s", k), self.logged("measured_rad_s", k - 1)
        F = self.logged("design_rad_s2", k)
        return [(x1 - x0) / self.dt - f for x1, x0, f in zip(now, then, F, strict=True)]

    def true_rates(self, k: int) -> Vector:
        """|x| + e of section 2: how large the rates can be."""
        x, o, m = self.logged("measured_rad_s", k), self.declared["o"], self.declared["m"]
        return [abs(x[i]) + (o[i] + m[i] * abs(x[i])) / (1.0 - m[i]) for i in range(3)]

    def noise(self, k: int) -> Vector:
        """n of section 2."""
        f, o, steady, m = self.true_rates(k), self.declared["o"], self.declared["B"], self.declared["m"]
        return [o[i] - steady[i] + m[i] * f[i] for i in range(3)]

    def bound(self, k: int) -> Vector:
        """Of section 2's bound the first terms, as the frame that ends with row k began."""
        f, found = self.true_rates(k - 1), []
        for i, (j, other) in enumerate(OTHER_TWO):
            c, b, g = (self.declared[name][i] for name in "cbg")
            turning = self.earth * ((1.0 + g) * sum(f) + g * self.earth)
            found.append((c * f[j] * f[other] + b + turning + ROUNDING_RAD_S2) / self.instants)
        return found

    def unhealthy(self, k: int) -> bool:
        """Whether more than the bound was at work in the frame that ends with row k, none with the first."""
        if k < 1:
            return False
        nu, eta, now, then = (
            self.innovation(k),
            self.logged("eta_bar_rad_s2", k),
            self.noise(k),
            self.noise(k - 1),
        )
        return any(abs(nu[i]) > eta[i] + (now[i] + then[i]) / self.dt for i in range(3))


class Blocks(Flight):
    """A flight by blocks of frames (section 4): gyros as one ends, all else in the mean."""

    def __init__(self, flight: Flight, length: int, begin: int, end: int) -> None:
        if length < 1 or (end - begin) % length or not 0 <= begin < end <= flight.rows:
            raise Doubtful("blocks that are none")
        vars(self).update(vars(flight))
        self.frames, self.length, self.begin = flight, length, begin
        self.dt, self.rows, self.instants = flight.dt * length, (end - begin) // length, 2  # as of several

    def _of(self, k: int) -> range:
        """The rows of block k."""
        if not 0 <= k < self.rows:
            raise Doubtful(f"there is no block {k}")
        return range(self.begin + k * self.length, self.begin + (k + 1) * self.length)

    def logged(self, quantity: str, k: int) -> Vector:
        """p, q, r of a column."""
        if quantity == "measured_rad_s":
            return self.frames.logged(quantity, self._of(k)[-1])
        return _means([self.frames.logged(quantity, row) for row in self._of(k)])

    def bound(self, k: int) -> Vector:
        """Of section 2's bound the first terms."""
        return _means([self.frames.bound(row) for row in self._of(k)])


def _means(vectors: list[Vector]) -> Vector:
    return [fsum(values) / len(vectors) for values in zip(*vectors, strict=True)]


def _by_axis(given: dict[str, float]) -> Vector:
    return [float(given.get(axis, 0.0)) for axis in "pqr"]


def doubts(document: Document, log: Columns) -> Iterator[str]:
    """Why not to believe a certificate; nothing where it holds."""
    unsigned = {**document, "digest": ""}
    text = dumps(unsigned, sort_keys=True, separators=(",", ":"))
    if sha256(text.encode()).hexdigest() != document["digest"]:
        yield "the digest is of another document"
    if document["rows"] != len(log["t_s"]) or document["format"] != 4:
        yield "the document is of another log, or of another format"
    if document["statements"]:
        try:
            flight = Flight(document, log)
            _times(flight)
            for said in document["statements"]:
                _statement(_in_full(said, document["statements"][0]), flight)
        except (Doubtful, KeyError, IndexError, TypeError, ValueError, ZeroDivisionError) as why:
            yield str(why)


def _in_full(said: Document, alarm: Document) -> Document:
    """A statement; of a fault that moves nothing where chance raised the alarm, with the alarm's evidence."""
    if "as" not in said:
        return said
    if alarm["what"] is not None or "likelihood" not in alarm or alarm["frame"] > said["frame"]:
        raise Doubtful(f"{said['what']}: no alarm of chance before")
    return {**alarm, **said}


def _sets(column: np.ndarray, k: int) -> bool:
    """Whether a flag is set from row k to the end, and not before."""
    return k > 0 and column[k - 1] == 0.0 and all(flag == 1.0 for flag in column[k:])


def _times(flight: Flight) -> None:
    """Rows are frames of dt."""
    for k, t in enumerate(flight.log["t_s"]):
        if flight.dt is not None and not isclose(t, k * flight.dt, abs_tol=1e-6):
            raise Doubtful(f"row {k} is of another time")


def _statement(said: Document, flight: Flight) -> None:
    """One inequality."""
    k, what, column = said.get("frame", flight.rows), said["what"], said["column"]
    if column is None:
        if what is None:
            raise Doubtful("an alarm without a column")
    elif column != ("detected" if what is None else f"fie_{what}_excluded") or not _sets(
        flight.log[column], k
    ):
        raise Doubtful(f"{what}: {column} is not set then")
    how = _weighed if "likelihood" in said else _read if "looks" in said else _added
    how = _missed if "missing" in said else how
    how = _compared if said.get("theta") == "course" else how
    found = how(said, Blocks(flight, *said["block"]) if "block" in said else flight)
    stated = said["sides"] if how in (_weighed, _compared) else [[side] for side in said["sides"]]
    for value, limit, *two in zip(*zip(*found, strict=True), *stated, strict=True):
        if not value > limit or not all(
            isclose(*pair, rel_tol=SIDES_TO_SHARE) for pair in zip((value, limit), two, strict=True)
        ):
            raise Doubtful(f"{what}: {value} > {limit} is not what it says, or not so")


def _added(said: Document, flight: Flight) -> list[tuple[float, float]]:
    """Both sides of a sum over filters."""
    value = limit = slope = 0.0
    for one in said["terms"]:
        if one["weight"] <= 0.0 or one["frame"] > said.get("frame", flight.rows):
            raise Doubtful(f"{said['what']}: a term of no use")
        E, most, S = _followed(one, said, flight)
        value, limit = value + one["weight"] * E, limit + one["weight"] * most
        slope += one["weight"] * S
    if abs(slope) > 1e-12:
        limit += (said["most"] if slope > 0.0 else said["least"]) * slope
    return [(value, limit)]


def _read(said: Document, flight: Flight) -> list[tuple[float, float]]:
    """A residual of section 9 and its bound: what the look before left of both, and what this one adds."""
    k, residual, bound = said["frame"], 0.0, 0.0
    for reading, foretold, most in reversed(said["looks"]):
        if most < 0.0:
            raise Doubtful("sound instruments that differ by less than nothing")
        residual, bound = residual + reading - foretold, bound + most
    if said["what"] is not None or TESTS[int(flight.log["watch_test"][k])] != said["test"]:
        raise Doubtful(f"row {k} is of another test")
    if residual / bound > flight.log["watch_share"][k] * (1.0 + 1e-9):  # the largest of the row's looks
        raise Doubtful(f"the share in row {k} is smaller")
    return [(residual, bound)]


def _missed(said: Document, flight: Flight) -> list[tuple[float, float]]:
    """How many readings are missing, where sound instruments leave out none."""
    if said["what"] is not None or [flight.log["watch_missing"][said["frame"]]] != said["missing"]:
        raise Doubtful("another reading is missing, or none")
    return [(1.0, 0.0)]


def _followed(one: Document, said: Document, flight: Flight) -> tuple[float, float, float]:
    """A filter along d, frame by frame: E; T with what the fault can have done; what theta multiplies."""
    first, last, d = one["first"], one["frame"], one["d"]
    a = exp(-one["pole_per_s"] * flight.dt) if "pole_per_s" in one else 0.0
    since = one["since"] if "pole_per_s" in one else last - 1
    if not 0 <= since < first <= last or one.get("fault", 0.0) < 0.0:
        raise Doubtful("frames or effects out of order")
    _written_frames(one, flight, first, last)
    E = H = S = 0.0
    N, U = _along(d, flight.noise(since), size=True), one.get("fault", 0.0)
    for k in range(since + 1, last + 1):
        E = a * E + flight.dt * _along(d, flight.innovation(k))
        H = a * H + flight.dt * _along(d, flight.logged("eta_bar_rad_s2", k), size=True)
        N = a * N + (1.0 - a) * _along(d, flight.noise(k - 1), size=True)
        if k >= first:
            effect, multiplied = _effect(one, said, k - first)
            U, S = a * U + flight.dt * effect, a * S + flight.dt * multiplied
    if said["theta"] == "constant while it shows":
        beside = range(last - 1, last + 2) if flight.instants > 1 else range(last, last + 1)
        if not all(flight.unhealthy(k) for k in beside if k < flight.rows):
            raise Doubtful("health explains a frame")
    return E, H + N + _along(d, flight.noise(last), size=True) + U, S


def _written_frames(one: Document, flight: Flight, first: int, last: int) -> None:
    """The numbers that stand in the log as well, and the bound of section 2."""
    lengths = {len(one[name]) for name in ("x", "F", "eta_bar", "rest", "h", "Z", "r") if name in one}
    if lengths != {last + 1 - first}:
        raise Doubtful("frames are missing")
    for k in range(first, last + 1):
        place, eta = k - first, flight.logged("eta_bar_rad_s2", k)
        rest, published = one["rest"][place] if "rest" in one else [0.0] * 3, flight.bound(k)
        for name, column in (("x", "measured_rad_s"), ("F", "design_rad_s2"), ("eta_bar", "eta_bar_rad_s2")):
            for stated, known in zip(one[name][place], flight.logged(column, k), strict=True):
                if not isclose(stated, known, rel_tol=MEANS_TO_SHARE):
                    raise Doubtful(f"{name} of row {k} is another")
        for i in range(3):
            if not isclose(published[i] + rest[i], eta[i], rel_tol=PUBLISHED_TO_SHARE):
                raise Doubtful(f"the bound of row {k} is another")


def _effect(one: Document, said: Document, place: int) -> tuple[float, float]:
    """What the fault can do at most in a frame, and what a theta that is one number multiplies."""
    h, Z, r = (one[name][place] if name in one else 0.0 for name in "hZr")
    if r < 0.0 or (said["what"] is None and (h, Z, r) != (0.0, 0.0, 0.0)):
        raise Doubtful("an effect that is none")
    if said["theta"] != "any":
        return h + r, Z
    if h is None or Z is None:
        return r, 0.0
    products = [said[end] * Z for end in ("least", "most") if end in said and Z]
    unlimited = ("most" not in said and Z > 0.0) or ("least" not in said and Z < 0.0)
    if unlimited:
        raise Doubtful("theta is not limited")
    return max(0.0, *(h + product for product in products or [0.0])) + r, 0.0


def _along(d: Vector, values: Vector, size: bool = False) -> float:
    """The sum of a vector's parts along d, or of their sizes."""
    return sum((abs(part) if size else part) * value for part, value in zip(d, values, strict=True))


def _compared(said: Document, flight: Flight) -> list[tuple[float, float]]:
    """What single frames say of a deflection, pair by pair, of the type that is excluded."""
    at_least, at_most = {}, {}
    for one in said["bounds"]:
        for place, k in enumerate(range(one["first"], one["frame"] + 1)):
            beside = range(k - 1, k + 2) if flight.instants > 1 else (k,)
            if one["r"][place] < 0.0 or not all(flight.unhealthy(j) for j in beside):
                raise Doubtful(f"frame {k} says nothing")
            said_of = at_least if one["Z"][place] > 0.0 else at_most
            said_of[k] = (_deflection(one, place, k, flight), -one["h"][place] / one["Z"][place])
    first, last = min(at_least), max(at_least)
    frames = range(first, last + 1)
    if [*at_least] != [*frames] or len(at_most) > 1:
        raise Doubtful("frames do not follow")
    low, command = at_least[first]
    above = next(iter(at_most), first)
    high, commanded = at_most.get(above, (float("nan"), float("nan")))
    kind = said["what"].split(" ", 1)[1]
    if kind.startswith("bias"):
        lowest, highest = said["stops"]
        pairs = [(low - command, high - commanded), (low, lowest), (highest, high)]
        return [(low - command, 0.0), *pairs, (above, first)] if kind == "bias that grows" else pairs
    if kind.startswith("hardover"):
        spare = 1 if flight.instants > 1 else 0
        reached = low + said["pace_rad_s"] * (above - first - spare) * flight.dt
        return [(said["stops"][0], high), (above, first), (reached, high)]
    if kind == "oscillatory":
        off = [theta for theta, _ in at_least.values()]
        return [(last - first, np.pi / said["slowest_rad_s"] / flight.dt), (min(off), 0.0), (sum(off), 0.0)]
    if kind != "rate_limit" or above != first:
        raise Doubtful(f"{kind} is no type, or begins elsewhere")
    off = [theta - told for (theta, _), told in zip(at_least.values(), said["ordered"], strict=True)]
    here, come = at_least[last][0], said["step"] * (last - first - 1) if "step" in said else 0.0
    return [(min(off), 0.0), (sum(off), 0.0), (here, high - come), (here, said["near"]), (1.0, 0.0)]


def _deflection(one: Document, place: int, k: int, flight: Flight) -> float:
    """The least, or the greatest, theta with which nu = h + theta Z in frame k, give or take all there is."""
    now, then, published = flight.noise(k), flight.noise(k - 1), flight.bound(k)
    eta = flight.logged("eta_bar_rad_s2", k)
    if any(published[i] > eta[i] * (1.0 + 1e-13) for i in range(3)):
        raise Doubtful(f"the bound of row {k} is another")
    most = [eta[i] + (now[i] + then[i]) / flight.dt for i in range(3)]
    value = _along(one["d"], flight.innovation(k)) - one["h"][place]
    return (value - _along(one["d"], most, size=True) - one["r"][place]) / one["Z"][place]


class Whitening:
    """Section 7's filter: what it makes of the innovation, of a fault and of constants."""

    def __init__(self, said: Document) -> None:
        n = len(said["axes"])
        P, Y = (np.array([[value or 0.0 for value in row] for row in said[name]]) for name in "PY")
        if not np.array_equal(P, P.T):
            raise Doubtful("variances that are none")
        self.xx, self.xd, self.dd = P[:n, :n], P[:n, n:], P[n:, n:]
        self.noise = np.diag([value or 0.0 for value in said["R"]])
        self.e, self.d = Y[:n], -Y[n:]

    def take(
        self, inputs: np.ndarray, its: Document, dt: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """The whitened g (n, inputs), its covariance S, and the gains K_x and K_d."""
        alpha, self.dd = its.get("keep", 1.0), self.dd + np.array(its["drift"])
        self.xx = self.xx + np.diag(its["jitter"]) + dt * (self.xd + self.xd.T) + dt * dt * self.dd
        self.xd, self.dd = alpha * (self.xd + dt * self.dd), alpha * alpha * self.dd
        S = self.xx + self.noise
        K_x, K_d = np.linalg.solve(S, self.xx).T, np.linalg.solve(S, self.xd).T
        g = self.e + dt * (inputs - self.d)
        self.e, self.d = g - K_x @ g, alpha * self.d + K_d @ g
        left = np.linalg.solve(S, self.noise).T  # 1 - K_x
        self.xx, self.dd, self.xd = left @ self.xx, self.dd - K_d @ self.xd, left @ self.xd
        return g, S, K_x, K_d


def _weighed(said: Document, flight: Flight) -> list[tuple[float, float]]:
    """The evidence for a fault, and what it must exceed: the level, or half of it beside bounds."""
    axes, tolerance, filters = said["axes"], np.array(said["tolerance"]), Whitening(said)
    N, D, R, foretold, w = 0.0, 0.0, np.zeros(len(tolerance)), 0.0, np.zeros(len(axes))
    swinging = pacing = last = staying = 0.0
    last_row = said["first"] + len(said["frames"]) - 1
    if last_row > said["frame"] or (last_row != said["frame"] and "as" not in said):
        raise Doubtful("frames are missing")
    for k, its in enumerate(said["frames"], said["first"]):
        nu = np.array([flight.innovation(k)[axis] for axis in axes]) - its.get("air", 0.0)
        inputs = np.column_stack([nu, its["signature"], *its.get("known", [])])
        g, S, K_x, K_d = filters.take(inputs, its, flight.dt)
        before, w = w, np.linalg.solve(S, g[:, 1])
        N, D, R = N + w @ g[:, 0], D + w @ g[:, 1], R + w @ g[:, 2:]
        foretold += w @ its.get("foreseen", np.zeros(len(axes)))
        if "bounded" in its:
            most, returns = 1.2 * np.abs(np.linalg.inv(K_d)) @ its["bounded"], 1.0 - its.get("keep", 1.0)
            swinging, last = swinging + most @ abs(w - before), most @ abs(w)
            pacing += last * its.get("pace", 1e9)
            for K, of_drift, bound, weight in zip(np.diag(K_x), np.diag(K_d), its["bounded"], w, strict=True):
                staying += flight.dt * returns / (K * returns + flight.dt * of_drift) * bound * abs(weight)
    evidence = -N - max(0.0, -foretold) if said["sense"] == "less" else abs(N)
    evidence -= tolerance @ abs(R)
    if D < 0.0:
        raise Doubtful("information that is none")
    level = said["level"] * D**0.5
    limit = max(level, staying + min(swinging + last, pacing) + 0.5 * level)
    logged = float(flight.log[said["likelihood"]][last_row]) * (1.0 + 1e-5)
    return [(evidence, limit), (logged, evidence / limit)]
