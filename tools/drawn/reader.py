"""A second reader of certificates, written from docs/explanation alone: the recursions of detection.md and
isolation.md, frame by frame.

It shares no code with tools/check_certificate.py, which sums what is left of each frame; the two must agree.
What a fault does and which events there are it takes from the log too; what was declared, from the scenario.
"""

from collections.abc import Iterator
from hashlib import sha256
from json import dumps
from math import ceil, exp, fsum, isclose, isfinite, pi, radians
from statistics import NormalDist
from typing import Any

import numpy as np
import yaml

Document = dict[str, Any]
Columns = dict[str, np.ndarray]
Vector = list[float]
ROUNDING_RAD_S2 = 1e-11  # rho
OTHER_TWO = ((1, 2), (0, 2), (0, 1))
_ANGLES = "turning p", "turning q", "turning r", "phi", "theta", "psi"
TESTS = (*_ANGLES, "V", "alpha", "beta", "density", "altitude", "engine_rpm", "manifold_pressure")
NEVER_NEGATIVE = {
    "weight", "pole_per_s", "fault", "r", "c", "b", "g", "o", "B", "m", "level", "R", "jitter", "bounded",
    "pace", "keep", "tolerance", "dt_s", "instants", "omega_E", "step", "pace_rad_s", "slowest_rad_s",
    "frame", "first", "since", "block", "rows", "missing",
}  # fmt: skip
NEVER_ZERO = {"weight", "pole_per_s", "level", "keep", "dt_s", "instants", "tolerance", "pace_rad_s"}
PUBLISHED_TO_SHARE, MEANS_TO_SHARE, SIDES_TO_SHARE = 3e-14, 1e-13, 1e-12


class Doubtful(Exception):
    """What a certificate says is not so."""


class Flight:
    """What a log says, and what follows from the declared errors, one frame at a time."""

    length = 1

    def __init__(self, document: Document, log: Columns, scenario: Document) -> None:
        declared = document["declared"]
        self.log, self.rows, self.dt = log, len(log["t_s"]), 1.0 / scenario["rate_hz"]
        self.scenario, self.instants = scenario, scenario["substeps"]
        self.declared = {name: _by_axis(declared[name]) for name in ("c", "b", "g", "o", "B", "m")}
        self.earth = document.get("omega_E", 0.0)

    def logged(self, quantity: str, k: int) -> Vector:
        """p, q, r of a column in row k."""
        return [float(self.log[f"{axis}_{quantity}"][k]) for axis in "pqr"]

    def value(self, column: str, k: int) -> float:
        """A column of the log in row k."""
        return float(self.log[column][k])

    def row(self, k: int) -> int:
        """The last row of frame k."""
        return k

    def innovation(self, k: int) -> Vector:
        """nu of section 1."""
        if k < 1:
            raise Doubtful("nothing is known before the first row")
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

    def row(self, k: int) -> int:
        """The last row of block k."""
        return self._of(k)[-1]

    def value(self, column: str, k: int) -> float:
        """A column of the log: the mean."""
        return fsum(self.frames.value(column, row) for row in self._of(k)) / self.length

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


def doubts(document: Document, log: Columns, scenario: str = "") -> Iterator[str]:
    """Why not to believe a certificate; nothing where it follows from the log and the scenario's text."""
    unsigned = {**document, "digest": ""}
    text = dumps(unsigned, sort_keys=True, separators=(",", ":"))
    if sha256(text.encode()).hexdigest() != document.get("digest"):
        yield "the digest is of another document"
    if document.get("rows") != len(log["t_s"]) or document.get("format") != 5:
        yield "the document is of another log, or of another format"
    if sha256(scenario.encode()).hexdigest() != document.get("scenario_sha256"):
        yield "the document is of another scenario"
    elif document["statements"]:
        try:
            _signs(document)
            resolved = yaml.safe_load(scenario)
            _as_declared(document, resolved)
            flight = Flight(document, log, resolved)
            _times(flight)
            for said in document["statements"]:
                _statement(_in_full(said, document["statements"][0], flight), flight)
        except (Doubtful, LookupError, TypeError, ValueError, ArithmeticError, AttributeError) as why:
            yield str(why) or type(why).__name__


def _signs(node: Any, name: str = "") -> None:
    """Every number is finite, and no size is negative."""
    if isinstance(node, dict):
        for key, value in node.items():
            inherited = name in ("o", "B", "m", "c", "b", "g") and key in ("p", "q", "r")
            _signs(value, name if inherited else key)
    elif isinstance(node, list):
        for value in node:
            _signs(value, name)
    elif isinstance(node, bool):
        raise Doubtful(f"{name} is no number")
    elif isinstance(node, int | float) and not (
        isfinite(node) and (node >= 0 or name not in NEVER_NEGATIVE) and (node != 0 or name not in NEVER_ZERO)
    ):
        raise Doubtful(f"{name} has a value that it cannot have")


def _as_declared(document: Document, scenario: Document) -> None:
    """The errors of gyros, the frame and the instants are what the scenario says at the first event."""
    rate, sensors = scenario["rate_hz"], scenario["fdi"]["bounds"]["sensors"]
    for change in scenario["changes"]:
        if change.get("declared_sensors") and ceil(change["at_s"] * rate - 1e-6) <= min(
            said["frame"] for said in document["statements"]
        ):
            sensors = change["declared_sensors"]
    for axis in "pqr":
        of, said = sensors[axis], {name: document["declared"][name].get(axis, 0.0) for name in "oBm"}
        beta = radians(abs(of["bias_deg_s"]))
        off = radians(4.0 * of["noise_std_deg_s"] + 0.5 * of["quantum_deg_s"]) + beta
        if not isclose(said["o"], off, rel_tol=1e-12) or not isclose(said["m"], abs(of["scale_error"])):
            raise Doubtful(f"another error of gyro {axis} was declared")
        if said["B"] and not isclose(said["B"], beta, rel_tol=1e-12):
            raise Doubtful(f"another bias of gyro {axis} was declared")
    if not isclose(document.get("dt_s", 1.0 / rate), 1.0 / rate, rel_tol=1e-12):
        raise Doubtful("the scenario has another frame")
    if document.get("instants", scenario["substeps"]) != scenario["substeps"]:
        raise Doubtful("the scenario has other substeps")
    if document.get("omega_E", 0.0) and not isclose(document["omega_E"], 2 * pi / 86164.0905, rel_tol=1e-12):
        raise Doubtful("the Earth turns at another rate")


def _in_full(said: Document, alarm: Document, flight: Flight) -> Document:
    """A statement; of a fault that moves nothing where chance raised the alarm, with the alarm's evidence."""
    if "as" not in said:
        return said
    if alarm["what"] is not None or "likelihood" not in alarm or alarm["frame"] > said["frame"]:
        raise Doubtful(f"{said['what']}: no alarm of chance before")
    for k in range(alarm["first"] - 1, alarm["frame"] + 1):
        for quantity in ("offset_rad_s2", "slope", "spread_rad_s2"):
            for axis in alarm["axes"]:
                if flight.value(f"fie_{said['what']}_{'pqr'[axis]}_{quantity}", k) != 0.0:
                    raise Doubtful(f"{said['what']} moves an axis of the alarm")
    return {**alarm, **said}


def _sets(column: np.ndarray, k: int) -> bool:
    """Whether a flag is set from row k to the end, and not before."""
    return (k == 0 or column[k - 1] == 0.0) and len(column) > k and all(flag == 1.0 for flag in column[k:])


def _times(flight: Flight) -> None:
    """Rows are frames of dt."""
    for k, t in enumerate(flight.log["t_s"]):
        if flight.dt is not None and not isclose(t, k * flight.dt, abs_tol=1e-6):
            raise Doubtful(f"row {k} is of another time")


def _statement(said: Document, flight: Flight) -> None:
    """One inequality, of the event that the log has."""
    k, what, column = said["frame"], said["what"], said["column"]
    event = "detected" if what is None else f"fie_{what}_excluded"
    if event not in flight.log:
        event = f"{'_'.join(what.split())}_excluded"
    if column != event or not _sets(flight.log[column], k):
        raise Doubtful(f"{what}: {column} is not set then")
    evidence = {"terms", "bounds", "likelihood", "looks", "missing"} & set(said)
    if len(evidence) != 1 or (evidence & {"likelihood", "looks", "missing"} and what and "as" not in said):
        raise Doubtful(f"{what}: evidence of another kind")
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
    fault = Fault(said["what"], flight)
    if said["what"] and fault.kind.split(" ")[0] not in ("", "stuck", "float", "loss_of_effectiveness"):
        raise Doubtful("a sum says nothing of a course")
    if any(said.get(end, known) != known for end, known in (("least", fault.low), ("most", fault.high))):
        raise Doubtful("theta has other ends")
    if said["theta"] == "constant":
        fdi, alarm = flight.scenario["fdi"], next(k for k, v in enumerate(flight.log["detected"]) if v)
        if fdi["fault_profile"] != "abrupt" and fdi["thresholds"] != "published":
            raise Doubtful("theta may change")
        if any(one.get("since", one["frame"]) < alarm for one in said["terms"]):
            raise Doubtful("before the alarm the fault may not have begun")
    for one in said["terms"]:
        if flight.row(one["frame"]) > said["frame"] or not any(one["d"]):
            raise Doubtful(f"{said['what']}: a term of no use")
        E, most, S = _followed(one, said, flight)
        value, limit = value + one["weight"] * E, limit + one["weight"] * most
        slope += one["weight"] * S
    if abs(slope) > 1e-12:
        limit += max(fault.low * slope, fault.high * slope)
    if not value - limit > 1e-10 * max(abs(value), abs(limit)):
        raise Doubtful(f"{said['what']}: {value} > {limit} is rounding, or not so")
    return [(value, limit)]


class Fault:
    """What a fault does at most, from the log's columns: h + theta Z along d, give or take r, in frame k."""

    def __init__(self, what: str | None, flight: Flight) -> None:
        self.flight, self.what, self.low, self.high = flight, what, 0.0, 0.0
        if what is None:
            return
        self.surface, _, self.kind = what.partition(" ")
        self.name = f"fie_{self.surface}_position" if self.kind else f"fie_{what}"
        ends = "{}_travel_{}_rad" if self.kind else "fie_{}_theta_{}"
        self.travel = [
            float(np.nanmin(flight.log[ends.format(self.surface, end)])) for end in ("low", "high")
        ]
        low, high = self.travel
        self.low, self.high = low, high
        if self.kind.startswith("loss"):
            self.low, self.high = -1.0, 0.0
        elif self.kind == "float":
            self.low = self.high = 0.0

    def does(self, d: Vector, k: int) -> tuple[float, float, float]:
        """h, Z and r in frame k."""
        if self.what is None:
            return 0.0, 0.0, 0.0
        offset, slope, spread = (
            [self.flight.value(f"{self.name}_{axis}_{quantity}", k) for axis in "pqr"]
            for quantity in ("offset_rad_s2", "slope", "spread_rad_s2")
        )
        h, Z, r = _along(d, offset), _along(d, slope), _along(d, spread, size=True)
        if self.kind.startswith("loss"):
            h, Z = 0.0, -h
        elif self.kind == "float":
            h, Z = h + min(max(0.0, self.travel[0]), self.travel[1]) * Z, 0.0
        elif self.kind == "oscillatory":
            h = 0.0
        if not isfinite(h + Z + r):
            raise Doubtful(f"the log does not say what {self.what} does in frame {k}")
        return h, Z, r


def _read(said: Document, flight: Flight) -> list[tuple[float, float]]:
    """A residual of section 9 and its bound: what the look before left of both, and what this one adds."""
    k, residual, bound = said["frame"], 0.0, 0.0
    for reading, predicted, most in reversed(said["looks"]):
        if most < 0.0:
            raise Doubtful("sound instruments that differ by less than nothing")
        residual, bound = residual + reading - predicted, bound + most
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
    if not 0 <= since < first <= last or ("pole_per_s" not in one and first != last):
        raise Doubtful("frames or effects out of order")
    _written_frames(one, flight, first, last)
    fault = Fault(said["what"], flight)
    E = H = S = earlier = 0.0
    N, U = _along(d, flight.noise(since), size=True), one.get("fault", 0.0)
    for k in range(since + 1, last + 1):
        E = a * E + flight.dt * _along(d, flight.innovation(k))
        H = a * H + flight.dt * _along(d, flight.logged("eta_bar_rad_s2", k), size=True)
        N = a * N + (1.0 - a) * _along(d, flight.noise(k - 1), size=True)
        if k >= first:
            effect, multiplied = _effect(one, said, k - first, fault.does(d, k), fault)
            U, S = a * U + flight.dt * effect, a * S + flight.dt * multiplied
        else:
            try:
                earlier = a * earlier + flight.dt * _largest(*fault.does(d, k), fault)
            except Doubtful:  # before the frames that the log has of the fault
                earlier *= a
    if one.get("fault", 0.0) < earlier * (1.0 - 1e-9) - 1e-15:
        raise Doubtful("the fault has done more before")
    if said["theta"] == "constant while it shows":
        if fault.kind.endswith("that varies"):
            raise Doubtful("the parameter of this type is not one number")
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
            if rest[i] < -1e-13 * eta[i]:
                raise Doubtful("a part of a bound is negative")
            if not isclose(published[i] + rest[i], eta[i], rel_tol=PUBLISHED_TO_SHARE):
                raise Doubtful(f"the bound of row {k} is another")


def _effect(
    one: Document, said: Document, place: int, known: tuple[float, float, float], fault: Fault
) -> tuple[float, float]:
    """What the fault can do at most in a frame, and what a theta that is one number multiplies."""
    for name, value in zip("hZr", known, strict=True):
        stated = one[name][place] if name in one else None
        if stated is not None and not isclose(stated, value, rel_tol=1e-9, abs_tol=1e-12):
            raise Doubtful(f"{name} is {value} in the log")
    h, Z, r = known
    return (_largest(h, Z, r, fault), 0.0) if said["theta"] == "any" else (h + r, Z)


def _largest(h: float, Z: float, r: float, fault: Fault) -> float:
    """Of a fault that may move, or be absent; less than rounding is nothing."""
    most = max(h + fault.low * Z, h + fault.high * Z)
    return (most if most > 1e-12 else 0.0) + r


def _along(d: Vector, values: Vector, size: bool = False) -> float:
    """The sum of a vector's parts along d, or of their sizes."""
    return sum((abs(part) if size else part) * value for part, value in zip(d, values, strict=True))


Where = dict[int, tuple[float, float]]  # of a frame: deflection at least, or at most, and the command


def _where(said: Document, flight: Flight, fault: Fault) -> tuple[Where, Where, bool]:
    """What single frames say of a deflection: at least, at most, and whether it is counted upwards."""
    at_least: Where = {}
    at_most: Where = {}
    turned = set()
    for one in said["bounds"]:
        for place, k in enumerate(range(one["first"], one["frame"] + 1)):
            beside = range(k - 1, k + 2) if flight.instants > 1 else (k,)
            if one["r"][place] < 0.0 or not all(flight.unhealthy(j) for j in beside):
                raise Doubtful(f"frame {k} says nothing")
            h, Z, r = fault.does(one["d"], k)
            turned.add(one["Z"][place] * Z > 0.0)
            for stated, known in ((one["h"][place], h), (abs(one["Z"][place]), abs(Z)), (one["r"][place], r)):
                if not isclose(stated, known, rel_tol=1e-9, abs_tol=1e-12):
                    raise Doubtful(f"the log says otherwise of what the fault does in frame {k}")
            said_of = at_least if one["Z"][place] > 0.0 else at_most
            said_of[k] = (_deflection(one, place, k, flight), -one["h"][place] / one["Z"][place])
    if len(turned) != 1:
        raise Doubtful("the surface goes both ways")
    return at_least, at_most, turned.pop()


def _compared(said: Document, flight: Flight) -> list[tuple[float, float]]:
    """What frames say of a deflection, pair by pair, of the type that is excluded."""
    fault = Fault(said["what"], flight)
    at_least, at_most, up = _where(said, flight, fault)
    stops = fault.travel if up else [-end for end in reversed(fault.travel)]
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
        if lowest < stops[0] - 1e-12 or highest > stops[1] + 1e-12:
            raise Doubtful("the stops are further in")
        pairs = [(low - command, high - commanded), (low, lowest), (highest, high)]
        return [(low - command, 0.0), *pairs, (above, first)] if kind == "bias that grows" else pairs
    if kind.startswith("hardover"):
        known = flight.scenario["design_model"].get("actuators") or flight.scenario["actuators"]
        spare, actuator = 1 if flight.instants > 1 else 0, known[fault.surface]
        pace = 0.5 * (radians(actuator["rate_limit_deg_s"]) or pi / 3)
        if said["stops"] != [stops[1]] or not isclose(said["pace_rad_s"], pace) or up != kind.endswith("up"):
            raise Doubtful("another stop, or another pace")
        reached = low + said["pace_rad_s"] * (above - first - spare) * flight.dt
        return [(said["stops"][0], high), (above, first), (reached, high)]
    if kind == "oscillatory":
        if at_most or said["slowest_rad_s"] != flight.scenario["fdi"]["slowest_oscillation_rad_s"]:
            raise Doubtful("the slowest oscillation is another")
        off = [theta for theta, _ in at_least.values()]
        return [(last - first, np.pi / said["slowest_rad_s"] / flight.dt), (min(off), 0.0), (sum(off), 0.0)]
    if kind != "rate_limit" or above != first:
        raise Doubtful(f"{kind} is no type, or begins elsewhere")
    if said["near"] < max(said["ordered"]):
        raise Doubtful("nearer than the order")
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
    statistical = flight.scenario["fdi"]["statistical"]
    if said["level"] < -NormalDist().inv_cdf(
        statistical["false_alarms_per_h"] / (3600.0 * flight.scenario["rate_hz"])
    ) * (1.0 - 1e-9):
        raise Doubtful("a level at which alarms come more often than declared")
    if not said["likelihood"].endswith("_likelihood_share"):
        raise Doubtful("no column of a share")
    axes, tolerance, filters = said["axes"], np.array(said["tolerance"]), Whitening(said)
    N, D, R, predicted, w = 0.0, 0.0, np.zeros(len(tolerance)), 0.0, np.zeros(len(axes))
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
        predicted += w @ its.get("foreseen", np.zeros(len(axes)))
        if "bounded" in its:
            most, returns = 1.2 * np.abs(np.linalg.inv(K_d)) @ its["bounded"], 1.0 - its.get("keep", 1.0)
            swinging, last = swinging + most @ abs(w - before), most @ abs(w)
            pacing += last * its.get("pace", 1e9)
            for K, of_drift, bound, weight in zip(np.diag(K_x), np.diag(K_d), its["bounded"], w, strict=True):
                staying += flight.dt * returns / (K * returns + flight.dt * of_drift) * bound * abs(weight)
    evidence = -N - max(0.0, -predicted) if said["sense"] == "less" else abs(N)
    evidence -= tolerance @ abs(R)
    if D < 0.0:
        raise Doubtful("information that is none")
    level = said["level"] * D**0.5
    limit = max(level, staying + min(swinging + last, pacing) + 0.5 * level)
    logged = float(flight.log[said["likelihood"]][last_row]) * (1.0 + 1e-5)
    return [(evidence, limit), (logged, evidence / limit)]
