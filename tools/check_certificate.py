"""`python tools/check_certificate.py FOLDER|FILE [LOG]` exits 0 if the log proves certificate.json, else 1.

From docs/theory.md, sections 1 to 4, and docs/certificates.md. NumPy alone; pyarrow opens the log."""

import hashlib
import json
import sys
from pathlib import Path

import numpy as np

FRAMES = ("x", "model", "eta_bar", "rest", "offset", "slope", "spread")


def require(holds, why):
    if not holds:
        raise ValueError(why)


def errors(declared, x):
    """Section 2: the published bound on eta at the instant of each row, and n; (rows, 3)."""
    o, beta, m = (np.array(declared["gyro"][name]) for name in ("offset_rad_s", "steady_rad_s", "slope"))
    f = abs(x) + (o + m * abs(x)) / (1 - m)
    omega, g, c = declared["earth_rad_s"], np.array(declared["earth_share"]), declared["inertia_coupling"]
    earth = omega * ((1 + g) * f.sum(axis=1, keepdims=True) + g * omega) + 1e-11
    coupled = c * np.abs(declared["coupling"]) * f[:, [1, 0, 0]] * f[:, [2, 2, 1]]
    return coupled + declared["constant_rad_s2"] + earth, o - beta + m * f


def filtered(a, inputs, start=0.0):
    """Section 3: y[k] = a y[k-1] + input[k] from y = start; the last one."""
    return a ** len(inputs) * start + a ** np.arange(len(inputs) - 1.0, -1, -1) @ inputs


def sides(one, said, about, log):
    """Of one filter in one direction: its value, the most it can be, and what theta multiplies in that."""
    since, first, last, dt = one["since"], one["first"], one["frame"], about["dt_s"]
    a = np.exp(-one["pole_per_s"] * dt) if one["pole_per_s"] else 0.0
    require(0 <= since < first <= last <= said["frame"] and (a or since + 1 == last), "frames do not follow")
    rows, past, d = slice(first, last + 1), slice(since + 1, last + 1), np.array(one["direction"])
    of = {name: np.array(one["frames"].get(name, 0 * log["x"][rows])) for name in FRAMES}
    for name in FRAMES[:3]:
        require(np.array_equal(of[name], log[name][rows]), f"{name} is not that of the log")
    published, n = errors(said["declared"], log["x"])
    bound = published[first - 1 : last] / about["instants"] + of["rest"]
    require(np.allclose(bound, log["eta_bar"][rows], 1e-9, 1e-13), "eta_bar is not as declared")
    nu, size = np.diff(log["x"], axis=0, prepend=log["x"][:1]) / dt - log["model"], abs(d)
    many, room = about["instants"] > 1, log["eta_bar"] + (n + np.roll(n, 1, axis=0)) / dt
    wrong = (abs(nu) > room)[last - many : last + 1 + many].any(axis=1)
    require(wrong.all() or not said["shown"], "health explains the frame")
    offset, slope, spread = of["offset"] @ d, of["slope"] @ d, of["spread"] @ size
    require(min(of["rest"].min(), spread.min(), one["fault"]) >= 0, "less than nothing is admitted")
    require(said["what"] or not np.any([offset, slope, spread]), "a fault is allowed for")
    if said["constant"]:
        require(first == since + 1 and one["fault"] == 0, "a constant parameter has no past of its own")
    else:
        offset = np.maximum(0, np.max([offset + theta * slope for theta in said["theta"]], axis=0))
    fault = filtered(a, dt * (offset + spread), one["fault"])
    noise = filtered(a, (1 - a) * n[since:last] @ size, n[since] @ size) + n[last] @ size
    most = filtered(a, dt * log["eta_bar"][past] @ size) + noise + fault
    return np.array([filtered(a, dt * nu[past] @ d), most, said["constant"] and filtered(a, dt * slope)])


def check(said, about, log):
    """Raise ValueError unless the inequality follows from the log and says what the statement does."""
    k, name, what = said["frame"], said["column"], said["what"]
    require(name in ((None, f"fie_{what}_excluded") if what else ("detected",)), "of another column")
    flag = log[name] if name else np.arange(len(log["x"])) >= max(one["frame"] for one in said["terms"])
    require(flag[k:].all() and not flag[k - 1], f"{name} is not set in that frame")
    require(all(one["weight"] > 0 for one in said["terms"]), "a sum of what can be turns on its signs")
    value, limit, slope = sum(one["weight"] * sides(one, said, about, log) for one in said["terms"])
    limit += max(theta * slope for theta in said["theta"])
    require(
        np.allclose([value, limit], [said["value"], said["limit"]], 1e-9, 0), "it comes to something else"
    )
    require(value > limit, f"{value:g} is within {limit:g}")


def failures(about, log):
    """A line for each statement that does not hold; log: column -> values."""
    ends = {"x": "measured_rad_s", "model": "design_rad_s2", "eta_bar": "eta_bar_rad_s2"}.items()
    log = log | {name: np.column_stack([log[f"{axis}_{end}"] for axis in "pqr"]) for name, end in ends}
    text = json.dumps(about | {"digest": ""}, sort_keys=True, separators=(",", ":"))
    if hashlib.sha256(text.encode()).hexdigest() != about["digest"] or about["rows"] != len(log["x"]):
        yield "this is not what was written, or not of this log"
    for said in about["statements"]:
        try:
            check(said, about, log)
        except (ValueError, KeyError, IndexError, TypeError) as why:
            yield f"{said['what'] or 'alarm'}: {why}"


if __name__ == "__main__":
    from pyarrow.parquet import read_table

    given = Path(sys.argv[1], "certificate.json" if Path(sys.argv[1]).is_dir() else "")
    about = json.loads(given.read_text())
    table = read_table(sys.argv[2] if len(sys.argv) > 2 else given.parent / "log.parquet")
    found = "\n".join(failures(about, {name: table[name].to_numpy() for name in table.column_names}))
    sys.exit(found or print(len(about["statements"]), "statements hold"))
