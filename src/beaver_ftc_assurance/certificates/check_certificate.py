"""Check the certificate of a flight against its log and its scenario.

    python check_certificate.py FOLDER                        the folder of a run
    python check_certificate.py CERTIFICATE LOG [SCENARIO]    files that lie elsewhere

Exit status 0 if every statement holds, 1 if one does not or a file cannot be read. `beaver-ftc check RUN`
runs this same file. It imports NumPy, the reader of the log's file, the reader of the scenario's file
(PyYAML) and the standard library.

The flight's log and its scenario are taken as true. Numbers of the certificate that are in neither of them
are tested as far as Table 2 of docs/explanation/certificates.md describes. A statement is accepted if the
log's own column shows the event in the row that the statement names, and if the inequality, computed again
from the log and from the bounds that the scenario declares, is violated as stated.
"""

import sys
from dataclasses import dataclass
from hashlib import sha256
from json import dumps, loads
from math import exp, isfinite, pi, radians
from pathlib import Path
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
import yaml
from pyarrow.parquet import read_table

AXES = "pqr"
FORMAT_VERSION = 5  # version of the form of a certificate
NOISE_LIMIT_SIGMA = 4.0  # the noise of a sensor is limited to this, in standard deviations
EARTH_RATE_RAD_S = 2.0 * pi / 86164.0905
ROUNDING_RAD_S2 = 1e-11  # the part of every bound that covers rounding
MIN_EFFECT_RAD_S2 = 1e-12  # a smaller effect of a fault is rounding
MAX_RELATIVE_DIFFERENCE = 1e-12  # between a stated and the recomputed side, by the order of summation
MAX_RELATIVE_DIFFERENCE_OF_EFFECT = 1e-9  # between a stated effect and that in the log
MAX_RELATIVE_DIFFERENCE_OF_SHARE = 1e-5  # between the log's share of a level and the recomputed one
MIN_RELATIVE_EXCESS = 1e-10  # least excess of a sum of frames over its limit, as a share of the larger
DEFAULT_RATE_RAD_S = pi / 3  # rate of an actuator without limit: beaver_ftc/diagnosis/model_prediction.py
RINGING_FACTOR = 1.2  # factor on an estimated drift: beaver_ftc/diagnosis/detection/likelihood.py explains it
NO_PACE = 1e9  # pace of a bounded drift that may change at any rate
TESTS = (
    "turning p", "turning q", "turning r", "phi", "theta", "psi", "V", "alpha", "beta", "density", "altitude",
    "engine_rpm", "manifold_pressure",
)  # fmt: skip


class Relation(NamedTuple):
    """How a fault type moves a surface from its command u to p, rad: p = gain u + theta, or, if theta is a
    share, p = (gain + theta) u. theta is constant if it is one number while the fault shows."""

    gain: float
    theta_is_share: bool
    theta_is_constant: bool
    theta_low: float
    theta_high: float


# Type -> function from the travel low, high (rad) to its relation: gain, whether theta is a share, whether it
# is constant, and its range. Columns of the log define types in no table.
RELATIONS = {
    "stuck": lambda low, high: Relation(0.0, False, True, low, high),
    "float": lambda low, high: Relation(0.0, False, True, *2 * (min(max(0.0, low), high),)),
    "loss_of_effectiveness": lambda low, high: Relation(1.0, True, True, -1.0, 0.0),
    "loss_of_effectiveness that varies": lambda low, high: Relation(1.0, True, False, -1.0, 0.0),
}
# Type that many frames exclude -> comparison (section 7 below), and stop to which the surface runs, 0 for
# none.
COURSES = {
    "bias": ("offset", 0), "bias that grows": ("growing_offset", 0), "hardover up": ("runaway", 1),
    "hardover down": ("runaway", -1), "oscillatory": ("swing", 0), "rate_limit": ("approach", 0),
}  # fmt: skip
UNREADABLE = ArithmeticError, AttributeError, LookupError, TypeError, ValueError


class Refused(Exception):
    """Why a certificate, or one of its statements, is not accepted; one sentence."""


def require(condition, why):
    """Refuse with this sentence unless the condition holds."""
    if not condition:
        raise Refused(why)


def is_same(stated, known):
    """Whether a stated number is this one, but for rounding."""
    return np.isclose(stated, known, MAX_RELATIVE_DIFFERENCE, 0)


def is_same_effect(stated, known):
    """Whether a stated effect of a fault is this one, but for rounding of what it is computed from."""
    return np.isclose(stated, known, MAX_RELATIVE_DIFFERENCE_OF_EFFECT, MIN_EFFECT_RAD_S2)


# --- 1. The form: which fields there are, and what may stand in each -------------------------------------


def is_number(value):
    """A finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)


def is_positive(value):
    """A finite number above zero."""
    return is_number(value) and value > 0


def is_non_negative(value):
    """A finite number, zero or more."""
    return is_number(value) and value >= 0


def is_row(value):
    """A row of the log, or a count: an integer, zero or more."""
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def is_mapping(value):
    """A mapping."""
    return isinstance(value, dict)


def is_text(value):
    """Words."""
    return isinstance(value, str)


def described(text, is_allowed):
    """Give a check the text by which a refusal says what is allowed."""
    is_allowed.__doc__ = text
    return is_allowed


def is_one_of(*words):
    """One of these words."""
    return described(f"One of: {', '.join(map(str, words))}.", lambda value: value in words)


def is_null_or(is_allowed):
    """Such a value, or null."""
    return described(f"Null, or: {is_allowed.__doc__}", lambda value: value is None or is_allowed(value))


def is_list_of(is_allowed, length=None):
    """A list of such values, of this length if one is given."""
    return described(
        f"A list of {length or 'any number of'} values, each: {is_allowed.__doc__}",
        lambda value: (
            isinstance(value, list) and len(value) == (length or len(value)) and all(map(is_allowed, value))
        ),
    )


def is_by_axis(is_allowed):
    """Such a value for some of the axes p, q, r."""
    return described(
        f"A mapping from some of p, q, r to a value, each: {is_allowed.__doc__}",
        lambda value: (
            isinstance(value, dict) and set(value) <= set(AXES) and all(map(is_allowed, value.values()))
        ),
    )


def is_share(value):
    """More than zero, at most one."""
    return is_positive(value) and value <= 1


def is_below_one(value):
    """Zero or more, below one."""
    return is_non_negative(value) and value < 1


is_vector = is_list_of(is_number, 3)
is_pair = is_list_of(is_number, 2)
is_values = is_list_of(is_number)
is_vectors = is_list_of(is_vector)
is_matrix = is_list_of(is_values)
is_pairs = is_list_of(is_values, 2)
is_gappy = is_list_of(is_null_or(is_number))
is_bounds = is_list_of(is_non_negative)
is_block = is_list_of(is_row, 3)
is_parts = is_list_of(is_mapping)
# Object -> fields that it needs, and fields that it may have. An event also has the fields of its evidence.
FORMS = {
    "certificate": (
        {"format": is_row, "scenario": is_text, "scenario_sha256": is_text, "rows": is_row,
         "statements": is_parts, "without": is_parts, "digest": is_text},
        {"declared": is_mapping, "dt_s": is_positive, "instants": is_row, "omega_E": is_non_negative,
         "begins_s": is_number},
    ),
    "declared": ({"m": is_by_axis(is_below_one)} | dict.fromkeys("cbgoB", is_by_axis(is_non_negative)), {}),
    "event": ({"what": is_null_or(is_text), "column": is_text, "frame": is_row}, {}),
    "term": (
        {"weight": is_positive, "d": is_vector, "first": is_row, "frame": is_row, "x": is_vectors,
         "F": is_vectors, "eta_bar": is_vectors},
        {"pole_per_s": is_positive, "since": is_row, "fault": is_non_negative, "rest": is_vectors,
         "h": is_gappy, "Z": is_gappy, "r": is_bounds},
    ),
    "bound": (
        {"d": is_vector, "first": is_row, "frame": is_row, "h": is_values, "Z": is_values, "r": is_bounds},
        {},
    ),
    "frame": (
        {"signature": is_values, "jitter": is_bounds, "drift": is_matrix},
        {"bounded": is_bounds, "pace": is_non_negative, "keep": is_share, "known": is_matrix,
         "air": is_values, "foreseen": is_values},
    ),
}  # fmt: skip
# Field that shows the kind of evidence of a statement -> fields that this needs, and fields that it may have.
EVIDENCE = {
    "terms": (
        {"theta": is_one_of("any", "constant", "constant while it shows"), "terms": is_parts,
         "sides": is_pair},
        {"block": is_block, "least": is_number, "most": is_number},
    ),
    "bounds": (
        {"theta": is_one_of("course"), "bounds": is_parts, "sides": is_pairs},
        {"block": is_block, "stops": is_values, "pace_rad_s": is_positive, "slowest_rad_s": is_positive,
         "ordered": is_values, "step": is_non_negative, "near": is_number},
    ),
    "likelihood": (
        {"likelihood": is_text, "level": is_positive, "axes": is_list_of(is_one_of(0, 1, 2)),
         "sense": is_one_of("less", "either"), "tolerance": is_list_of(is_positive),
         "R": is_list_of(is_null_or(is_non_negative)), "Y": is_list_of(is_gappy), "P": is_list_of(is_gappy),
         "first": is_row, "frames": is_parts, "sides": is_list_of(is_pair, 2)},
        {},
    ),
    "looks": ({"test": is_one_of(*TESTS), "looks": is_vectors, "sides": is_pair}, {}),
    "missing": ({"missing": is_list_of(is_row, 1), "sides": is_pair}, {}),
    "as": ({"as": is_one_of("alarm")}, {}),
}  # fmt: skip


def check_form(document, needed, allowed, where):
    """Refuse a document that lacks a needed field, has an unknown one, or a value that is not allowed."""
    require(isinstance(document, dict), f"{where}: this is no mapping")
    fields = needed | allowed
    for name in needed:
        require(name in document, f"{where}: the field {name} is missing")
    for name, value in document.items():
        require(name in fields, f"{where}: the field {name} is not known")
        require(fields[name](value), f"{where}: {name} is not allowed, allowed: {fields[name].__doc__}")


def evidence_kind(statement):
    """The kind of evidence of a statement, a key of EVIDENCE."""
    kinds = [name for name in EVIDENCE if name in statement]
    require(len(kinds) == 1, "the statement has no evidence, or more than one kind of it")
    return kinds[0]


def check_statement_form(statement):
    """Refuse a statement with wrong fields or lists of wrong lengths. Returns its `evidence_kind`."""
    kind = evidence_kind(statement)
    needed, allowed = EVIDENCE[kind]
    check_form(statement, FORMS["event"][0] | needed, allowed, "statement")
    for term in statement.get("terms", []):
        check_form(term, *FORMS["term"], "term")
        check_lengths(term, ("x", "F", "eta_bar", "rest", "h", "Z", "r"))
        require(("pole_per_s" in term) == ("since" in term), "a pole needs the frame since which it filters")
        require("fault" not in term or "pole_per_s" in term, "a frame by itself has no past")
    for bound in statement.get("bounds", []):
        check_form(bound, *FORMS["bound"], "bound")
        check_lengths(bound, ("h", "Z", "r"))
        require(all(bound["Z"]), "the surface does not act along this direction")
    if kind in ("terms", "bounds", "looks"):
        require(len(statement[kind]) > 0, "the evidence is empty")
    if kind == "likelihood":
        check_likelihood_form(statement)
    return kind


def check_lengths(span, names):
    """Refuse lists without a value for each frame from `first` to `frame`, and a direction of zero."""
    require(1 <= span["first"] <= span["frame"], "the frames are not in order")
    require(any(span["d"]), "the direction is zero")
    for name in names:
        if name in span:
            require(len(span[name]) == span["frame"] + 1 - span["first"], f"{name}: frames are missing")


def check_likelihood_form(statement):
    """Refuse lists of wrong sizes in a statistical alarm with n axes and m constants."""
    n = len(statement["axes"])
    m = len(statement["tolerance"])
    require(n in (1, 2) and len(set(statement["axes"])) == n, "axes: one or two different ones are allowed")
    require(len(statement["R"]) == n, "R: one variance for each axis")
    require([len(line) for line in statement["P"]] == [2 * n] * (2 * n), "P: two states for each axis")
    require([len(line) for line in statement["Y"]] == [2 + m] * (2 * n), "Y: two states for each axis")
    P = np.array([[value or 0.0 for value in line] for line in statement["P"]])
    require(np.array_equal(P, P.T) and (P.diagonal() >= 0).all(), "P is no covariance")
    require(statement["first"] >= 1 and statement["frames"], "frames are missing")
    for fields in statement["frames"]:
        check_form(fields, *FORMS["frame"], "frame")
        for name in ("signature", "jitter", "bounded", "air", "foreseen"):
            require(len(fields.get(name, [0] * n)) == n, f"{name}: one value for each axis")
        drift = np.array(fields["drift"])
        known = fields.get("known", [])
        require(drift.shape == (n, n) and np.allclose(drift, drift.T), "drift is no covariance")
        require((np.linalg.eigvalsh(drift) >= -1e-9 * np.abs(drift).max()).all(), "drift is no covariance")
        require(len(known) == m and all(len(line) == n for line in known), "known: a value for each constant")
        require(set(fields) == set(statement["frames"][0]), "the frames have different fields")


# --- 2. What the scenario declares -----------------------------------------------------------------------


@dataclass
class Declared:
    """The declarations of a scenario that are in force at some row.

    dt: length of a frame, s. instants: JSBSim steps in a frame. By axis: gyro_errors (offset rad/s, constant
    part of it rad/s, slope), constant_bounds rad/s2, inertia_shares: share of inertia coupling. start_row:
    row with which the diagnosis started last. scenario: all keys.
    """

    dt: float
    instants: int
    gyro_errors: dict
    constant_bounds: dict
    inertia_shares: dict
    start_row: int
    scenario: dict


def declared_at_row(scenario, row_number):
    """The declarations of a resolved scenario that are in force at a row."""
    require(
        isinstance(scenario, dict) and isinstance(scenario.get("fdi"), dict), "the scenario is no scenario"
    )
    fdi = scenario["fdi"]
    rate = float(scenario["rate_hz"])
    sensors = fdi["bounds"]["sensors"]
    start_row = 0
    for change in scenario.get("changes") or []:
        first_row = int(np.ceil((change["at_s"] - 1e-9) * rate))
        if first_row <= row_number:
            sensors = change.get("declared_sensors") or sensors
            restarted = any(change.get(name) is not None for name in ("scheme", "declared_sensors"))
            start_row = first_row if restarted else start_row
    gyro_errors = {}
    for axis in AXES:
        gyro = sensors[axis]
        bias = abs(radians(gyro["bias_deg_s"]))
        offset = NOISE_LIMIT_SIGMA * radians(gyro["noise_std_deg_s"]) + bias
        gyro_errors[axis] = offset + radians(gyro["quantum_deg_s"]) / 2, bias, abs(gyro["scale_error"])
    return Declared(
        1.0 / rate, int(scenario["substeps"]), gyro_errors, fdi["bounds"]["constant_rad_s2"],
        fdi["bounds"]["inertia_coupling"], start_row, scenario,
    )  # fmt: skip


def check_declared(document, declared):
    """Refuse bounds that are not those of the scenario.

    The bias B of a gyro may be left out: the bound on its noise is then larger, which proves less. c, b and g
    only explain the bound in the log, and are tested if omega_E is stated, as terms and bounds need it. b is
    at least the constant bound of the scenario. c must be zero on an axis for which the scenario declares no
    share.
    """
    check_form(document.get("declared"), *FORMS["declared"], "declared")
    for axis, (offset, bias, slope) in declared.gyro_errors.items():
        o, B, m = (document["declared"][name].get(axis, 0.0) for name in "oBm")
        same = is_same(o, offset) and is_same(m, slope)
        require(same and (B == 0 or is_same(B, bias)),
                f"the declared error of gyro {axis} is not that of the scenario")  # fmt: skip
        require(o >= B, f"gyro {axis}: the constant error is larger than the whole error")
        if "omega_E" not in document:
            continue
        c, b, g = (document["declared"][name].get(axis, 0.0) for name in "cbg")
        require(
            b >= declared.constant_bounds[axis] * (1 - MAX_RELATIVE_DIFFERENCE),
            f"b on {axis} is smaller than the scenario's bound",
        )
        require(c == 0 or declared.inertia_shares[axis] > 0, f"c on {axis}: the scenario declares none")
        require(g >= 1 if document["omega_E"] else g == 0, f"g on {axis} is not allowed")
    require(is_same(document.get("dt_s", declared.dt), declared.dt),
            "dt_s is not the frame of the scenario")  # fmt: skip
    require(
        document.get("instants", declared.instants) == declared.instants,
        "instants: not those of the scenario",
    )
    require(document.get("omega_E", 0) == 0 or is_same(document["omega_E"], EARTH_RATE_RAD_S),
            "omega_E is not the Earth's rate")  # fmt: skip


# --- 3. What follows from the log, by row or by block of rows ---------------------------------------------


class Frames:
    """Innovation nu and bounds of each frame k, arrays (frames, 3) of the axes p, q, r.

    nu[k] = (x[k] - x[k-1]) / dt - F[k]        without a fault |nu[k]| <= eta_bar[k] + (n[k] + n[k-1]) / dt

    docs/explanation/detection.md derives both: "The innovation", "The bound on the model error", "Changing
    error of a gyro".

    rates_rad_s: x, measured. model_rad_s2: F, the acceleration by the design model. eta_bar_rad_s2: bound on
    the error of F, from the log; stated_bound_rad_s2: the part of eta_bar that c, b, g and the Earth's rate
    explain. gyro_change_rad_s: n, bound on the changing error of the gyros. innovation_bound_rad_s2: the
    right side. late_frames: 1 if a frame has several instants, so that a fault may begin within it, else 0.
    is_unexplained (frames,): health does not explain the frame, nor its late_frames neighbours on each side:
    nu exceeds its bound on an axis, and eta_bar is below the stated bound on none.

    A block (length, first row, row after the last) divides these rows of the log into frames of so many rows;
    without one each row is a frame. A frame of several rows has the rates and n of its last row, and the mean
    of all else.
    """

    def __init__(self, document, log, declared, block=None):
        self.log = log
        self.declared = declared
        length, begin, end = block or (1, 0, len(log["t_s"]))
        require(length >= 1 and 0 <= begin < end <= len(log["t_s"]) and (end - begin) % length == 0,
                "the block has other rows")  # fmt: skip
        self.length = length
        self.begin = begin
        self.rows = slice(begin, end)
        self.dt = declared.dt * length
        instants = declared.instants
        self.model_rad_s2, self.eta_bar_rad_s2 = (
            self.mean(self.columns(f"{{}}_{of}_rad_s2")) for of in ("design", "eta_bar")
        )
        measured = self.columns("{}_measured_rad_s")
        self.rates_rad_s = self.last_rows(measured)
        gyro_change, stated_bound = errors_by_row(measured, document)
        self.gyro_change_rad_s = self.last_rows(gyro_change)
        stated_bound = np.roll(stated_bound, 1, axis=0) / instants  # at the row with which the frame began
        stated_bound[0] = np.nan
        self.stated_bound_rad_s2 = self.mean(stated_bound)
        before = np.roll(self.rates_rad_s, 1, axis=0)
        before[0] = np.nan
        self.innovation_rad_s2 = (self.rates_rad_s - before) / self.dt - self.model_rad_s2
        self.innovation_bound_rad_s2 = (
            self.eta_bar_rad_s2
            + (self.gyro_change_rad_s + np.roll(self.gyro_change_rad_s, 1, axis=0)) / self.dt
        )
        self.late_frames = int(instants * length > 1)
        beyond = (np.abs(self.innovation_rad_s2) > self.innovation_bound_rad_s2).any(axis=1)
        explained = (self.stated_bound_rad_s2 <= self.eta_bar_rad_s2 * (1 + 1e-13)).all(axis=1)
        unexplained = beyond & explained  # never in frame 0: what was before it is not known
        self.is_unexplained = (
            unexplained & np.roll(unexplained, self.late_frames) & np.roll(unexplained, -self.late_frames)
        )

    def columns(self, name):
        """The log's columns of the three axes, side by side (rows, 3)."""
        return np.column_stack([np.asarray(self.log[name.format(axis)], float) for axis in AXES])

    def last_rows(self, values):
        """The value (blocks, ...) of the last row of each block."""
        return values[self.rows][self.length - 1 :: self.length]

    def mean(self, values):
        """The mean (blocks, ...) over each block."""
        return values[self.rows].reshape(-1, self.length, *values.shape[1:]).mean(axis=1)

    def row_of(self, k):
        """The last row of the log in frame k."""
        return self.begin + (k + 1) * self.length - 1


def errors_by_row(measured, document):
    """For each row the bound n on the changing error of the gyros, rad/s, and the stated part of the bound on
    the model's error, rad/s2, (rows, 3) each, from the measured rates x. y, z: the two other axes. The other
    letters are fields of the certificate (docs/explanation/certificates.md, "The fields").

    w = |x| + (o + m |x|) / (1 - m), as large as the true rates can be;    n = o - B + m w
    bound = c w_y w_z + b + omega_E ((1 + g) (w_p + w_q + w_r) + g omega_E) + rounding
    """
    c, b, g, o, B, m = (
        np.array([document["declared"][name].get(axis, 0.0) for axis in AXES]) for name in "cbgoBm"
    )
    x = np.abs(measured)
    earth = document.get("omega_E", 0.0)
    w = x + (o + m * x) / (1 - m)
    of_earth = earth * ((1 + g) * w.sum(axis=1, keepdims=True) + g * earth)
    return o - B + m * w, c * w[:, [1, 0, 0]] * w[:, [2, 2, 1]] + b + of_earth + ROUNDING_RAD_S2


# --- 4. The event: what the log's own column says --------------------------------------------------------


def event_column(what, log):
    """The column of the log for an exclusion; for the alarm if `what` is None."""
    if what is None:
        return "detected"
    estimator = f"fie_{what}_excluded"
    return estimator if estimator in log else f"{what.replace(' ', '_')}_excluded"


def check_event(statement, log):
    """Refuse an event whose column is not set from the stated row to the end, or was set in the row
    before."""
    name = statement["column"]
    k = statement["frame"]
    require(name == event_column(statement["what"], log), f"{name} is another column than that of this event")
    require(name in log, f"the log has no column {name}: it was not written with this certificate")
    values = np.asarray(log[name], float)
    require(k < len(values), f"the log has no row {k}")
    require((values[k:] == 1).all() and (k == 0 or values[k - 1] == 0), f"{name} is not set in row {k}")


# --- 5. What the fault can have added to the innovation ---------------------------------------------------


@dataclass
class Effect:
    """Effect of a fault on the innovation: offset + theta slope, within +-spread, rad/s2, (frames, 3); theta
    between theta_low and theta_high. theta_is_constant: one number in the frames that show the fault."""

    offset: np.ndarray
    slope: np.ndarray
    spread: np.ndarray
    theta_low: float
    theta_high: float
    theta_is_constant: bool = False

    def along(self, direction, rows):
        """h, Z and r: offset, slope and spread along a direction (3,) in these frames."""
        return (
            self.offset[rows] @ direction,
            self.slope[rows] @ direction,
            self.spread[rows] @ np.abs(direction),
        )

    def max_effect(self, h, Z, r):
        """Largest effect of a fault that may be absent; an effect of no more than rounding counts as none."""
        ends = np.maximum(h + self.theta_low * Z, h + self.theta_high * Z)
        return np.where(ends <= MIN_EFFECT_RAD_S2, 0.0, ends) + r


def effect_of_fault(what, frames):
    """The effect of the excluded fault, from columns of the log; zero for an alarm, which concerns no single
    fault."""
    if what is None:
        zero = np.zeros_like(frames.rates_rad_s)
        return Effect(zero, zero, zero, 0.0, 0.0)
    surface, _, kind = what.partition(" ")
    name = f"fie_{surface}_position" if kind else f"fie_{surface}"
    ends = f"{surface}_travel_{{}}_rad" if kind else f"{name}_theta_{{}}"
    lacking = {f"{name}_p_slope", ends.format("low")} - set(frames.log)
    require(not lacking, f"the log has no columns of {what}: it was not written with this certificate")
    columns = f"{name}_{{}}_offset_rad_s2", f"{name}_{{}}_slope", f"{name}_{{}}_spread_rad_s2"
    offset, slope, spread = (frames.mean(frames.columns(column)) for column in columns)
    low, high = (constant_value(frames.log[ends.format(end)]) for end in ("low", "high"))
    if not kind:
        return Effect(offset, slope, spread, low, high)
    gain, is_share, is_constant, low, high = relation_of(what, frames.log, low, high)
    # G (p - u) of the relation; offset and slope are those of the surface's position: -G u and G
    h = (1.0 - gain) * offset
    Z = -offset if is_share else slope
    if low == high:
        h = h + low * Z
        Z = np.zeros_like(Z)
        low = 0.0
        high = 0.0
    return Effect(h, Z, spread, low, high, bool(is_constant))


def course_of(what, log):
    """Comparison and stop of a type that many frames exclude; None for another type."""
    kind = what.partition(" ")[2]
    if kind in RELATIONS or kind in COURSES:
        return COURSES.get(kind)
    prefix = f"{what.replace(' ', '_')}_course_"
    courses = [
        (name.removeprefix(prefix), constant_value(log[name])) for name in log if name.startswith(prefix)
    ]
    return courses[0] if courses else None


def relation_of(what, log, low, high):
    """The relation of a type. low, high: the travel, rad. For a type with a course, theta is the position of
    the surface; for a swing, theta is the distance of the surface from the command."""
    kind = what.partition(" ")[2]
    course = course_of(what, log)
    if course is not None:
        return Relation(float(course[0] == "swing"), False, False, low, high)
    if kind in RELATIONS:
        return RELATIONS[kind](low, high)
    columns = [f"{what.replace(' ', '_')}_{name}" for name in Relation._fields]
    require(all(name in log for name in columns), f"neither this checker nor the log says what {kind} is")
    return Relation(*(constant_value(log[name]) for name in columns))


def constant_value(values):
    """The value of a column that is constant in all rows in which it is a number."""
    values = np.asarray(values, float)
    numbers = np.unique(values[np.isfinite(values)])
    require(len(numbers) == 1, "a column that must be constant is not")
    return float(numbers[0])


# --- 6. The sum over filters (docs/explanation/certificates.md, "The inequality") ---------------------


def term_pairs(statement, frames):
    """The sum of `weight` times d.E, and its largest value by bounds, noise and fault."""
    what = statement["what"]
    effect = effect_of_fault(what, frames)
    has_course = what is not None and " " in what and course_of(what, frames.log) is not None
    require(not has_course, "a sum of frames says nothing of this type")
    check_theta(statement, effect, frames)
    sums = [term["weight"] * evaluate_term(term, statement, frames, effect) for term in statement["terms"]]
    value, limit, slope = np.sum(sums, axis=0)
    if statement["theta"] != "any" and abs(slope) > MIN_EFFECT_RAD_S2:
        limit += max(effect.theta_low * slope, effect.theta_high * slope)
    return [(value, limit)]


def check_theta(statement, effect, frames):
    """Refuse ends of theta's range that are not the log's, a constant theta that nothing justifies, and an
    alarm by blocks."""
    for end, known in (("least", effect.theta_low), ("most", effect.theta_high)):
        require(statement.get(end, known) == known, f"{end} is not the end of theta's range in the log")
    fdi = frames.declared.scenario["fdi"]
    alarm = int(np.argmax(np.asarray(frames.log["detected"]) == 1))
    if statement["theta"] == "constant":
        declares = fdi["fault_profile"] == "abrupt" or fdi["thresholds"] == "published"
        require(statement["what"] and declares, "the scenario does not declare a constant parameter")
        since = [term.get("since", term["frame"]) for term in statement["terms"]]
        require("block" not in statement and min(since) >= alarm, "a frame before the alarm may be healthy")
    if statement["theta"] == "constant while it shows":
        require(
            statement["what"] and " " in statement["what"], "only a fault type is at fault where health fails"
        )
        require(effect.theta_is_constant, "theta of this type is not one number")
    if statement["what"] is None:
        require("block" not in statement, "an alarm is raised by frames, not by blocks")


def check_term_frames(term, statement, frames):
    """Refuse frames `since`, `first` and k of a term that are out of order, later than the event, or, except
    in blocks, before the diagnosis started. For a theta that is constant while it shows, health explains
    none of the frames since + 1 to k. A term without a pole has one frame, since = k - 1. Returns `since`."""
    k = term["frame"]
    first = term["first"]
    since = term.get("since", k - 1)
    begun = frames.declared.start_row if frames.length == 1 else 0
    require(begun <= since < first <= k < len(frames.rates_rad_s), "the frames of a term are not in order")
    require(frames.row_of(k) <= statement["frame"], "a frame after the event cannot have caused it")
    require("pole_per_s" in term or first == k, "without a pole a term has one frame")
    shown = frames.is_unexplained[since + 1 : k + 1].all()
    require(statement["theta"] != "constant while it shows" or shown, "health explains a frame")
    return since


def evaluate_term(term, statement, frames, effect):
    """One filter along d: its value E, the limit on E without theta, and the slope that a constant theta
    multiplies. E and the limit are in rad/s.

    E     = sum a^(k-j) dt nu[j].d                     over j = since + 1 ... k,    a = exp(-pole_per_s dt)
    limit = sum a^(k-j) (dt eta_bar[j].|d| + (1 - a) n[j-1].|d|)             over the same j
            + a^(k-since) n[since].|d| + n[k].|d|                            gyro noise, with the term above
            + sum a^(k-j) dt phi[j]  over j = first ... k,    + a^(k+1-first) fault
    slope = sum a^(k-j) dt Z[j]      over j = first ... k,    0 if theta may change in each frame ("any")

    Without a pole a is 0, and the sums have the one frame k. phi[j], rad/s2: largest effect of the fault,
    without theta if theta is constant. The field `fault`, rad/s, is the effect that the filter has summed up
    to frame first - 1; it must be at least the sum of those effects there that the log has.
    """
    k = term["frame"]
    first = term["first"]
    dt = frames.dt
    d = np.array(term["d"])
    decay = exp(-term["pole_per_s"] * dt) if "pole_per_s" in term else 0.0
    since = check_term_frames(term, statement, frames)
    summed = np.arange(since + 1, k + 1)
    size = np.abs(d)
    weights = decay ** (k - summed.astype(float))  # weight of each frame's input at frame k
    noise = frames.gyro_change_rad_s @ size
    value = weights @ (dt * frames.innovation_rad_s2[summed] @ d)
    limit = weights @ (dt * frames.eta_bar_rad_s2[summed] @ size + (1 - decay) * noise[summed - 1])
    limit += decay * weights[0] * noise[since] + noise[k]
    stated = {"h", "Z", "r", "fault"} & set(term)
    require(statement["what"] is not None or not stated, "an alarm has no effect of a fault")
    h, Z, r = effect.along(d, summed)
    before = first - summed[0]  # frames that are not written
    check_stated_effect(term, {"h": h[before:], "Z": Z[before:], "r": r[before:]})
    largest = effect.max_effect(h, Z, r)
    known = np.isfinite(largest[:before])
    least_before = dt * decay ** (first - 1.0 - summed[:before][known]) @ largest[:before][known]
    stated = term.get("fault", 0.0)
    require(stated >= least_before * (1 - MAX_RELATIVE_DIFFERENCE_OF_EFFECT) - 1e-15,
            "the effect before the written frames is too small")  # fmt: skip
    effects = largest if statement["theta"] == "any" else h + r
    limit += weights[before:] @ (dt * effects[before:]) + decay ** (k + 1.0 - first) * stated
    slope = dt * weights[before:] @ Z[before:] if statement["theta"] != "any" else 0.0
    check_logged_values(term, frames, slice(first, k + 1))
    return np.array([value, limit, slope])


def check_stated_effect(span, effect):
    """Refuse stated h, Z, r that are not the log's. null stands where the fault adds no more than
    rounding."""
    for name, known in effect.items():
        for stated, value in zip(span.get(name, ()), known, strict=False):
            require(stated is None or is_same_effect(stated, value), f"{name} is not that of the log")
    require(np.isfinite([*effect.values()]).all(), "the log has no effect of this fault in these rows")


def check_logged_values(term, frames, rows):
    """Refuse values that are not the log's, and an eta_bar that is not its stated part and a `rest` >= 0."""
    logged = {"x": frames.rates_rad_s, "F": frames.model_rad_s2, "eta_bar": frames.eta_bar_rad_s2}
    for name, values in logged.items():
        require(np.allclose(term[name], values[rows], 1e-13, 0), f"{name} is not that of the log")
    rest = np.array(term.get("rest", np.zeros((1, 3))))
    eta_bar = frames.eta_bar_rad_s2[rows]
    require((rest >= -1e-13 * eta_bar).all(), "rest: a part of a bound is below zero")
    require(
        np.allclose(frames.stated_bound_rad_s2[rows] + rest, eta_bar, 3e-14, 0),
        "the declared bounds are not the log's",
    )


# --- 7. The course of a surface (docs/explanation/certificates.md, "Types that pairs exclude") --------


class Course(NamedTuple):
    """Bounds on the position p of a surface, its commands u, and its travel (low, high), rad. If the surface
    deflects to the negative side, the sign of each position is turned.

    p >= lower (n,), u = command (n,) in the frames first, first + 1 ... last
    p <= upper, u = upper_command in the frame upper_frame; not a number for a swing, which needs none
    """

    first: int
    last: int
    lower: np.ndarray
    command: np.ndarray
    upper_frame: int
    upper: float
    upper_command: float
    travel: list


def course_pairs(statement, frames):
    """Pairs (greater, less) of the bounds of single frames; the fault type allows only greater <= less."""
    effect = effect_of_fault(statement["what"], frames)
    comparison, stop = course_of(statement["what"], frames.log) or ("", 0)
    require(comparison, "this is no type with a course")
    low, high, sign = bounds_by_frame(statement, frames, effect)
    require(
        low and sorted(low) == list(range(min(low), max(low) + 1)), "the frames do not follow one another"
    )
    require(len(high) == (comparison != "swing"), "one frame bounds the deflection from above")
    require(comparison in COMPARISONS, f"{comparison} is no known course")
    require(comparison != "runaway" or sign == stop, "the surface runs the other way")
    lower, command = np.array([low[k] for k in sorted(low)]).T
    upper_frame, (upper, upper_command) = next(iter(high.items()), (min(low), (np.nan, np.nan)))
    travel = sorted((sign * effect.theta_low, sign * effect.theta_high))
    course = Course(min(low), max(low), lower, command, upper_frame, upper, upper_command, travel)
    return COMPARISONS[comparison](statement, course, frames)


def bounds_by_frame(statement, frames, effect):
    """Frame -> (theta, u), a bound on the position and the command, for the frames that bound theta from
    below, and for those that bound it from above; and the sign by which all of them are multiplied."""
    low: dict = {}
    high: dict = {}
    signs = set()
    for bound in statement["bounds"]:
        for place, k in enumerate(range(bound["first"], bound["frame"] + 1)):
            theta, command, sign = position_bound(bound, place, k, frames, effect)
            signs.add(sign)
            (low if bound["Z"][place] > 0 else high)[k] = theta, command
    require(len(signs) == 1, "a surface deflects one way")
    return low, high, signs.pop()


def offset_pairs(statement, course, frames):
    """A constant offset p - u from the command u, unless a stop hides it:

    lower - u  >  upper - u_upper,    lower  >  low stop,    high stop  >  upper
    """
    stops = statement["stops"]
    travel = course.travel
    require(
        len(stops) == 2 and stops[0] >= travel[0] - 1e-12 and stops[1] <= travel[1] + 1e-12,
        "stops: beyond the travel in the log",
    )
    lower = course.lower[0]
    upper = course.upper
    return [(lower - course.command[0], upper - course.upper_command), (lower, stops[0]), (stops[1], upper)]


def growing_offset_pairs(statement, course, frames):
    """An offset that grows and keeps its sign: the pairs of a constant one, the upper bound in a later frame;

    lower - u  >  0,    upper_frame  >  first
    """
    pairs = offset_pairs(statement, course, frames)
    return [(pairs[0][0], 0.0), *pairs, (course.upper_frame, course.first)]


def runaway_pairs(statement, course, frames):
    """A runaway to a stop at half the rate limit or faster. In a later frame the surface is less far than
    that:

    stop  >  upper,    upper_frame  >  first,    lower + pace dt (upper_frame - first - late frames)  >  upper
    """
    require(statement["stops"] == [course.travel[1]], "the stop is not that of the log")
    scenario = frames.declared.scenario
    actuators = scenario.get("design_model", {}).get("actuators") or scenario["actuators"]
    rate = radians(actuators[statement["what"].partition(" ")[0]]["rate_limit_deg_s"]) or DEFAULT_RATE_RAD_S
    require(is_same(statement["pace_rad_s"], rate / 2), "pace_rad_s is not half the rate limit")
    later = course.upper_frame - course.first - frames.late_frames
    reached = course.lower[0] + statement["pace_rad_s"] * frames.dt * later
    return [(course.travel[1], course.upper), (course.upper_frame, course.first), (reached, course.upper)]


def swing_pairs(statement, course, frames):
    """An oscillation about the command. The surface is beyond the command for longer than half of the slowest
    period; theta is p - u:

    last - first  >  pi / (slowest_rad_s dt),    min lower  >  0,    sum lower  >  0
    """
    slowest = frames.declared.scenario["fdi"]["slowest_oscillation_rad_s"]
    require(statement["slowest_rad_s"] == slowest, "slowest_rad_s is not that of the scenario")
    longest = pi / slowest / frames.dt
    return [(course.last - course.first, longest), (course.lower.min(), 0.0), (course.lower.sum(), 0.0)]


def approach_pairs(statement, course, frames):
    """A slow surface approaches its order by a step in each frame, until it is near. Here it is beyond all
    orders, and farther away in a later frame. lower_n: lower bound of the last frame.

    min (lower - ordered)  >  0,    sum (lower - ordered)  >  0
    lower_n  >  upper - step (last - first - 1),    lower_n  >  near,    1  >  0

    The last pair belongs to the format alone: it is always true.
    """
    require(course.upper_frame == course.first, "the bound from above is not of the first frame")
    require(len(statement["ordered"]) == len(course.lower), "ordered: frames are missing")
    require(statement["near"] >= max(statement["ordered"]), "near is nearer than the order itself")
    ahead = course.lower - statement["ordered"]
    last = course.lower[-1]
    approach = statement.get("step", 0.0) * (course.last - course.first - 1)
    return [(ahead.min(), 0.0), (ahead.sum(), 0.0), (last, course.upper - approach),
            (last, statement["near"]), (1.0, 0.0)]  # fmt: skip


COMPARISONS = {
    "offset": offset_pairs, "growing_offset": growing_offset_pairs, "runaway": runaway_pairs,
    "swing": swing_pairs, "approach": approach_pairs,
}  # fmt: skip


def position_bound(bound, place, k, frames, effect):
    """The bound on theta by frame k, the command -h/Z, and the sign by which theta is multiplied.

    |nu.d - h - theta Z| <= eta_bar'.|d| + r, with the bound eta_bar' on the innovation, bounds the position
    theta from below if Z > 0, and from above if Z < 0. A deflection downwards is treated as one upwards:
    theta and the stated Z are then multiplied by -1.
    """
    require(k < len(frames.rates_rad_s) and frames.is_unexplained[k], "health explains a frame")
    d = np.array(bound["d"])
    h, Z, r = (bound[name][place] for name in "hZr")
    known_h, known_Z, known_r = (float(values[0]) for values in effect.along(d, slice(k, k + 1)))
    same = [is_same_effect(h, known_h), is_same_effect(abs(Z), abs(known_Z))]
    require(all(same) and is_same_effect(r, known_r), "h, Z or r is not that of the log")
    theta = (frames.innovation_rad_s2[k] @ d - h - frames.innovation_bound_rad_s2[k] @ np.abs(d) - r) / Z
    return theta, -h / Z, int(np.sign(Z * known_Z))


# --- 8. A statistical alarm (docs/explanation/certificates.md, "A statistical alarm") -----------------


def likelihood_pairs(statement, frames):
    """The evidence and its limit; and the log's share of the level and the ratio of the two.

    evidence = |N| - sum_j tolerance_j |N_j|        sense "less": -N - max(0, -N_f) in place of |N|
    limit = max(z sqrt D, room + z/2 sqrt D)

    N, D, N_j, N_f: sums of w.g for innovation, signature, constant j and `foreseen`, see `whitened_sums`.
    """
    check_level(statement, frames)
    (N, D, *of_constants, foreseen), room = whitened_sums(statement, frames)
    require(D >= 0, "the evidence has a negative variance")
    evidence = -N - max(0.0, -foreseen) if statement["sense"] == "less" else abs(N)
    if of_constants:
        evidence -= statement["tolerance"] @ np.abs(of_constants)
    z = statement["level"]
    limit = max(z * D**0.5, room + z / 2 * D**0.5)
    require(statement["likelihood"] in frames.log, f"the log has no column {statement['likelihood']}")
    logged = float(frames.log[statement["likelihood"]][statement["frame"]]) * (
        1 + MAX_RELATIVE_DIFFERENCE_OF_SHARE
    )
    return [(evidence, limit), (logged, evidence / limit)]


def check_level(statement, frames):
    """Refuse unless the scenario has the statistical detector, its rate of false alarms allows the level, and
    no frame is missing."""
    statistical = frames.declared.scenario["fdi"].get("statistical")
    require(statistical and statement["what"] is None, "the scenario declares no statistical detector")
    one_test = statistical["false_alarms_per_h"] / (3600 / frames.dt)
    least = -NormalDist().inv_cdf(one_test)
    require(
        statement["level"] >= least * (1 - MAX_RELATIVE_DIFFERENCE_OF_EFFECT),
        "level: the declared rate allows no smaller one",
    )
    last = statement["first"] + len(statement["frames"]) - 1
    require(last == statement["frame"], "frames are missing")
    require(
        statement["likelihood"].endswith("_likelihood_share"), "likelihood: this is no share of the level"
    )


def whitened_sums(statement, frames):
    """Sums over the frames of w.g for each column g, then of w.foreseen; and the room, i.e. the largest
    contribution of a bounded drift.

    A Kalman filter with the stated variances whitens the columns of Y: innovation, signature g_s, constants.
    It has two states for each axis, a value and its drift. w = S^-1 g_s, S = P_values + R: covariance of the
    innovation. With the bound D on the drift, the part f that the drift forgets in a frame, and L = ringing
    factor |pinv(K_drifts)| D:

    room = sum f D / (f K_values / dt + K_drifts).|w| + min(sum L.|w - w before| + L.|w last|, sum pace L.|w|)
    """
    dt = frames.dt
    axes = statement["axes"]
    n = len(axes)
    Y, P, R = (array_with_zeros(statement[name]) for name in ("Y", "P", "R"))
    values = slice(None, n)
    drifts = slice(n, None)
    sums = 0.0
    stayed = 0.0
    swung = 0.0
    paced = 0.0
    w = np.zeros(n)
    last_swing = 0.0
    for k, fields in enumerate(statement["frames"], statement["first"]):
        # Prediction: the inputs of the frame are added, and the drift decays.
        innovation = frames.innovation_rad_s2[k, axes] - fields.get("air", 0)
        inputs = np.stack([innovation, fields["signature"], *fields.get("known", [])], 1)
        forgets = 1 - fields.get("keep", 1)
        transition = np.kron([[1, dt], [0, 1 - forgets]], np.eye(n))
        noise = np.pad(np.diag(fields["jitter"]), (0, n)) + np.pad(fields["drift"], (n, 0))
        Y = transition @ Y + dt * np.eye(2 * n, n) @ inputs
        P = transition @ (P + noise) @ transition.T
        # Weights of this frame's innovation.
        inverse = np.linalg.inv(P[values, values] + np.diag(R))
        K = P[:, values] @ inverse
        before = w
        w = inverse @ Y[values, 1]
        sums = sums + w @ np.column_stack([Y[values], fields.get("foreseen", np.zeros(n))])
        # Room: a drift that stays at its bound, and one that swings from one end to the other.
        bounded = np.array(fields.get("bounded", [0] * n))
        swing = RINGING_FACTOR * np.abs(np.linalg.pinv(K[drifts])) @ bounded
        swung += swing @ np.abs(w - before)
        last_swing = swing @ np.abs(w)
        paced += fields.get("pace", NO_PACE) * last_swing
        stayed += forgets * bounded / (np.diag(K) * forgets / dt + np.diag(K[drifts])) @ np.abs(w)
        # Correction.
        Y = Y - K @ Y[values]
        P = P - K @ P[values]
    return np.asarray(sums), stayed + min(swung + last_swing, paced)


def array_with_zeros(values):
    """An array of a list, or of a list of lists, null as 0."""
    return np.array(
        [array_with_zeros(value) if isinstance(value, list) else value or 0.0 for value in values]
    )


def check_exclusion_by_alarm(statement, document, frames):
    """Refuse unless the first statement is a statistical alarm, no later than this event, on axes that this
    fault does not move."""
    alarm = document["statements"][0]
    require(alarm.get("what", "") is None and "likelihood" in alarm, "there is no statistical alarm before")
    require(alarm["frame"] <= statement["frame"] and statement["what"] is not None, "the alarm came later")
    effect = effect_of_fault(statement["what"], frames)
    rows = slice(max(alarm["first"] - 1, 0), alarm["frame"] + 1)
    moved = np.abs([effect.offset[rows], effect.slope[rows], effect.spread[rows]])[..., alarm["axes"]]
    require(moved.max() == 0, "this fault moves the axes of the alarm")


# --- 9. An alarm between instruments (docs/explanation/certificates.md, same heading) ----------------


def missing_pairs(statement, frames):
    """The pair 1 > 0 of a missing reading; the log's column `watch_missing` must name the same sensor."""
    k = statement["frame"]
    require(statement["what"] is None, "instruments raise an alarm, they exclude no surface")
    require(
        np.asarray(frames.log.get("watch_missing", []), float)[k : k + 1].tolist() == statement["missing"],
        "the log says that another reading is missing, or none",
    )
    return [(1.0, 0.0)]


def monitor_pairs(statement, frames):
    """Residual and bound of the test; the log's share in that row is at least as large as their ratio.

    sum of (reading - prediction)  >  sum of (largest difference)    over the entries of `looks`
    """
    log = frames.log
    k = statement["frame"]
    require(statement["what"] is None, "instruments raise an alarm, they exclude no surface")
    require({"watch_share", "watch_test"} <= set(log), "the log has no test between instruments")
    require(TESTS[int(log["watch_test"][k])] == statement["test"], "the log has another test in this row")
    require(all(difference >= 0 for _, _, difference in statement["looks"]), "looks: a bound is below zero")
    residual = sum(reading - predicted for reading, predicted, _ in statement["looks"])
    bound = sum(difference for *_, difference in statement["looks"])
    logged = log["watch_share"][k] * (1 + MAX_RELATIVE_DIFFERENCE_OF_EFFECT)
    require(bound > 0 and logged > residual / bound, "the log's share is smaller")
    return [(residual, bound)]


# --- 10. All statements ----------------------------------------------------------------------------------

# The pairs (greater, less) of each kind of evidence; a statement holds if greater > less. "as" has none.
PAIRS = {
    "terms": term_pairs, "bounds": course_pairs, "likelihood": likelihood_pairs, "looks": monitor_pairs,
    "missing": missing_pairs,
}  # fmt: skip


def check_statement(statement, document, log, declared):
    """Raise Refused unless the statement follows from log and scenario."""
    kind = check_statement_form(statement)
    check_event(statement, log)
    is_bounded = "omega_E" in document or not {"terms", "bounds"} & {*statement}
    require(is_bounded, "omega_E is missing: without it b is not compared with the scenario's bound")
    frames = Frames(document, log, declared, statement.get("block"))
    if kind == "as":
        check_exclusion_by_alarm(statement, document, frames)
        return
    sides = np.array(PAIRS[kind](statement, frames), float).T
    stated = np.reshape(statement["sides"], (2, -1))  # a single pair is written without inner lists
    require(np.isfinite(sides).all() and sides.shape == stated.shape, "the sides are no numbers")
    excess = (
        sides[0] - sides[1] - (MIN_RELATIVE_EXCESS * np.abs(sides).max(axis=0) if kind == "terms" else 0.0)
    )
    greater, less = sides[:, excess.argmin()]
    require(excess.min() > 0, f"{greater:.6g} is not more than {less:.6g}")
    same = np.allclose(sides, stated, MAX_RELATIVE_DIFFERENCE, 0)
    require(same, "the stated sides are not the recomputed ones")


def digest(document):
    """SHA-256 of the certificate without its own digest, keys sorted, no spaces."""
    plain = dumps(document | {"digest": ""}, sort_keys=True, separators=(",", ":"))
    return sha256(plain.encode()).hexdigest()


def failures(document, log, scenario=""):
    """Yield a sentence for each reason to refuse. log: column -> values; scenario: the text of
    scenario.yaml."""
    try:
        declared = check_document(document, log, scenario)
    except Refused as why:
        yield str(why)
        return
    except (*UNREADABLE, yaml.YAMLError) as why:
        yield f"certificate, log and scenario do not fit together: {type(why).__name__}: {why}"
        return
    for statement in document["statements"]:
        try:
            check_statement(statement, document, log, declared)
        except Refused as why:
            yield f"{statement_name(statement)}: {why}"
        except UNREADABLE as why:
            yield f"{statement_name(statement)}: the numbers do not fit the log: {type(why).__name__}: {why}"


def check_document(document, log, scenario):
    """Refuse a document that belongs to another log or scenario. Returns the declarations of the scenario,
    None if there are no statements."""
    check_form(document, *FORMS["certificate"], "certificate")
    require(
        document["format"] == FORMAT_VERSION,
        f"this checker reads format {FORMAT_VERSION}, not {document['format']}",
    )
    require(
        digest(document) == document["digest"],
        "SHA-256 does not match: the file was edited, or belongs to another log",
    )
    rows = len(log["t_s"])
    require(
        rows == document["rows"],
        f"the log has {rows} rows, not {document['rows']}: the certificate belongs to another log",
    )
    require(
        sha256(scenario.encode()).hexdigest() == document["scenario_sha256"],
        "SHA-256 of scenario.yaml does not match: it was edited, or is of another flight",
    )
    if not document["statements"]:
        return None
    events = [statement.get("frame") for statement in document["statements"]]
    require(all(map(is_row, events)), "statement: the field frame is missing, or no row")
    declared = declared_at_row(yaml.safe_load(scenario), min(events))
    check_declared(document, declared)
    require(
        np.allclose(np.asarray(log["t_s"], float), np.arange(rows) * declared.dt, 0, 1e-6),
        "dt_s: the log's rows are not that far apart",
    )
    return declared


def statement_name(statement):
    """Words for the event of a statement."""
    what = statement.get("what")
    return "alarm" if what is None else f"{what} excluded"


def sentences(document, log):
    """Yield a sentence for each statement of the certificate."""
    for statement in document["statements"]:
        row = statement["frame"]
        at = f"{statement_name(statement)} at {log['t_s'][row]:.3f} s (row {row})"
        kind = (statement.get("what") or "").partition(" ")[2]
        if kind and kind not in {*RELATIONS, *COURSES}:
            at += f", {kind} being what the log defines"
        if "as" in statement:
            yield f"{at}: the statistical alarm came on axes that this fault does not move"
        elif "missing" in statement:
            yield f"{at}: instrument {statement['missing'][0]} gave no reading"
        elif "bounds" in statement:
            yield f"{at}: the surface moved as this type cannot"
        elif "likelihood" in statement:
            (value, _), (limit, _) = statement["sides"]
            yield f"{at}: evidence {value:.4g} is more than {limit:.4g} at the declared rate of false alarms"
        else:
            unit = "" if statement.get("theta", "any") != "any" or statement.get("test") else " rad/s"
            value, limit = statement["sides"]
            yield f"{at}: {value:.4g}{unit} is more than {limit:.4g}{unit}, the most that bounds allow"


def refuse_json_constant(name):
    """JSON has no NaN and no infinity."""
    raise ValueError(f"{name} is no number of JSON")


def check(certificate, log=None, scenario=None):
    """Read the files and check them. Returns the statements in sentences, and the reasons to refuse.

    certificate: the folder of a run, or the file; log, scenario: their paths if they are not in the same
    folder.
    """
    file = Path(certificate, "certificate.json") if Path(certificate).is_dir() else Path(certificate)
    log = Path(log) if log else file.parent / "log.parquet"
    scenario = Path(scenario) if scenario else log.parent / "scenario.yaml"
    document = loads(file.read_text(encoding="utf-8"), parse_constant=refuse_json_constant)
    require(isinstance(document, dict), f"{file}: this is no certificate")
    table = read_table(log)
    columns = {name: table[name].to_numpy() for name in table.column_names}
    reasons = list(failures(document, columns, scenario.read_text(encoding="utf-8")))
    if reasons:
        return [], reasons
    not_certified = [
        f"not certified: {statement_name(statement)}: {statement.get('because')}"
        for statement in document["without"]
    ]
    return [*sentences(document, columns), *not_certified], []


def main(arguments):
    """Print the statements, or the reasons to refuse them. Returns the exit status."""
    try:
        lines, why = check(*arguments)
    except (OSError, TypeError, ValueError, LookupError, RecursionError, Refused) as error:
        print(f"no certificate at FOLDER, or CERTIFICATE LOG [SCENARIO]: {error}", file=sys.stderr)
        return 1
    print(*why, sep="\n", end="\n" * bool(why), file=sys.stderr)
    print(*lines, sep="\n", end="\n" * bool(lines))
    if not why:
        print(f"{sum(not line.startswith('not certified') for line in lines)} statements hold")
    return int(bool(why))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
