"""`python tools/check_certificate.py FOLDER|FILE [LOG]` exits 0 if the log proves certificate.json, else 1.

From docs/theory.md and docs/certificates.md, whose letters it takes. NumPy alone; pyarrow opens the log."""

import hashlib
import json
import sys
from pathlib import Path

import numpy as np


def require(holds, why):
    if not holds:
        raise ValueError(why)


def read(about, log):
    """Sections 1 to 3: nu, n and what is published of eta_bar, of each row; T is as declared."""
    ends = {"x": "measured_rad_s", "F": "design_rad_s2", "eta_bar": "eta_bar_rad_s2", "T": "threshold_rad_s"}
    log |= {name: np.column_stack([log[f"{axis}_{end}"] for axis in "pqr"]) for name, end in ends.items()}
    said, dt, since = about["declared"], about["dt_s"], about["since"]
    end = max(one["frame"] for one in about["statements"])
    c, b, g, o, beta, m = (np.array([said[name].get(axis, 0.0) for axis in "pqr"]) for name in "cbgoBm")
    x, eta, a, omega = log["x"], log["eta_bar"], np.exp(-said.get("pole_per_s", 0) * dt), said["omega_E"]
    f = abs(x) + (o + m * abs(x)) / (1 - m)
    earth = omega * ((1 + g) * f.sum(axis=1, keepdims=True) + g * omega) + 1e-11
    log["bound"] = (c * f[:, [1, 0, 0]] * f[:, [2, 2, 1]] + b + earth) / about["instants"]
    log["nu"], log["n"] = np.diff(x, axis=0, prepend=x[:1]) / dt - log["F"], (n := o - beta + m * f)
    log["wrong"] = (abs(log["nu"]) > eta + (n + np.roll(n, 1, axis=0)) / dt).any(axis=1)
    require(np.allclose(log["t_s"], np.arange(len(x)) * dt), "frames last otherwise")
    require(np.flatnonzero(~log["T"][:end].any(axis=1))[-1] == since, "the diagnosis began in another frame")
    H = np.vstack([n[since], (log["T"] - n)[since + 1 : end + 1]])  # H + N
    H[1:] -= a * H[:-1] + dt * eta[since + 1 : end + 1] + (1 - a) * n[since:end]
    require((abs(H[1:]) <= 1e-12 * log["T"][since + 1 : end + 1]).all(), "thresholds are not as declared")


def sides(one, said, theta, about, log):
    """Section 4, of one filter in one direction: its value, its limit, and what theta multiplies in that."""
    first, last, dt, d = one["first"], one["frame"], about["dt_s"], np.array(one["d"])
    a = np.exp(-one["pole_per_s"] * dt) if "pole_per_s" in one else 0.0
    since, fault, nothing = one.get("since", last - 1), one.get("fault", 0.0), [0.0] * (last + 1 - first)
    require(0 <= since < first <= last <= said["frame"], "frames do not follow")
    require(not a or since in (about["since"], np.argmax(log["detected"])), "no filter begins there")
    rows, past, n = slice(first, last + 1), slice(since + 1, last + 1), log["n"] @ abs(d)
    require(all(np.array_equal(one[it], log[it][rows]) for it in ("x", "F", "eta_bar")), "not so logged")
    bound = np.array(one.get("rest", 0 * log["x"][rows])) + log["bound"][first - 1 : last]
    require(np.allclose(bound, log["eta_bar"][rows], 1e-14, 0), "eta_bar is not as declared")
    h, Z, r = (np.array(one.get(name, nothing), float) for name in "hZr")
    require(min(*r, fault) >= 0 and (said["what"] or not any([*h, *Z, *r, fault])), "not to be admitted")
    wrong = log["wrong"][last - (about["instants"] > 1) :][: 1 + 2 * (about["instants"] > 1)]
    require(wrong.all() or said["theta"] != "constant while it shows", "health explains the frame")
    if said["theta"] == "any":
        h, Z = np.fmax(0, np.fmax(h + theta[0] * Z, h + theta[1] * Z)), 0 * r
    w = a ** np.arange(last - since - 1.0, -1, -1)
    most = w @ (dt * log["eta_bar"][past] @ abs(d) + (1 - a) * n[since:last]) + a * w[0] * n[since] + n[last]
    most += dt * w[-len(h) :] @ (h + r) + a ** len(h) * fault
    return np.array([w @ (dt * log["nu"][past] @ d), most, dt * w[-len(h) :] @ Z])


def check(said, about, log):
    """Raise ValueError unless the inequality follows from the log and says what the statement does."""
    require(all(one["weight"] > 0 for one in said["terms"]), "a sum of what can be turns on its signs")
    require(said["column"] or any(one["frame"] == said["frame"] for one in said["terms"]), "of another frame")
    theta = said.get("least", -1e99), said.get("most", 1e99)  # without limit where an end decides nothing
    value, limit, slope = sum(one["weight"] * sides(one, said, theta, about, log) for one in said["terms"])
    limit += abs(slope) > 1e-12 and max(theta[0] * slope, theta[1] * slope)
    require(np.allclose([value, limit], [said["value"], said["limit"]], 1e-12, 0), "both sides are others")
    require(value > limit, f"{value:g} is within {limit:g}")


def failures(about, log):
    """A line for each statement that does not hold; log: column -> values."""
    text = json.dumps(about | {"digest": ""}, sort_keys=True, separators=(",", ":"))
    of_this_log = about["rows"] == len(log["t_s"]) and about["format"] == 2
    if not of_this_log or hashlib.sha256(text.encode()).hexdigest() != about["digest"]:
        yield "this is not what was written, or not of this log"
    for said in about["statements"] + about["without"]:
        name, what, k, log = said["column"], said["what"], said.get("frame"), dict(log)
        try:
            require(name in ((None, f"fie_{what}_excluded") if what else ("detected",)), "of another column")
            require(not name or log[name][k:].all() > log[name][k - 1], f"{name} is not set in that frame")
            if said in about["statements"]:
                read(about, log)
                check(said, about, log)
        except (ValueError, KeyError, IndexError, TypeError) as why:
            yield f"{what or 'alarm'}: {why}"


if __name__ == "__main__":
    from pyarrow.parquet import read_table

    given = Path(sys.argv[1], "certificate.json" if Path(sys.argv[1]).is_dir() else "")
    about = json.loads(given.read_text())
    table = read_table(sys.argv[2] if len(sys.argv) > 2 else given.parent / "log.parquet")
    found = "\n".join(failures(about, {name: table[name].to_numpy() for name in table.column_names}))
    sys.exit(found or print(len(about["statements"]), "statements hold"))
