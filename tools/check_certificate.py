"""`python tools/check_certificate.py FOLDER|FILE [LOG]` exits 0 if the log proves certificate.json, else 1.

From docs/theory.md and docs/certificates.md, whose letters it takes. NumPy alone; pyarrow opens the log."""

import hashlib
import json
from pathlib import Path
from sys import argv, exit

import numpy as np
from numpy.testing import assert_ as require  # raises AssertionError, with -O as well


def read(about, log):
    """Sections 1 to 3: nu, n and what is published of eta_bar, of each row; T is as declared."""
    ends = {"x": "measured_rad_s", "F": "design_rad_s2", "eta_bar": "eta_bar_rad_s2", "T": "threshold_rad_s"}
    log |= {name: np.column_stack([log[f"{axis}_{end}"] for axis in "pqr"]) for name, end in ends.items()}
    said, dt, since, omega = about["declared"], about["dt_s"], about["since"], about.get("omega_E", 0)
    end = max(one["frame"] for one in about["statements"] if one["column"])
    c, b, g, o, beta, m = (np.array([said[name].get(axis, 0.0) for axis in "pqr"]) for name in "cbgoBm")
    x, eta, a = log["x"], log["eta_bar"], np.exp(-about.get("pole_per_s", 0) * dt)
    f = abs(x) + (o + m * abs(x)) / (1 - m)
    earth = omega * ((1 + g) * f.sum(axis=1, keepdims=True) + g * omega) + 1e-11
    log["bound"] = np.roll(c * f[:, [1, 0, 0]] * f[:, [2, 2, 1]] + b + earth, 1, 0) / about.get("instants", 1)
    log["nu"], log["n"] = np.diff(x, axis=0, prepend=x[:1]) / dt - log["F"], (n := o - beta + m * f)
    log["wrong"] = (abs(log["nu"]) > eta + (n + np.roll(n, 1, axis=0)) / dt).any(axis=1)
    require(np.flatnonzero(~log["T"][:end].any(axis=1))[-1] == since, "the diagnosis began in another frame")
    log["T"][since] = 2 * n[since]  # as if H = 0 and N = n had been logged
    H, now, then, least = log["T"] - n, slice(since + 1, end + 1), slice(since, end), 1e-14 * log["T"].max()
    require(np.allclose(H[now] - a * H[then], dt * eta[now] + (1 - a) * n[then], 1e-11, least), "thresholds")


def sides(one, said, to, about, log):
    """Section 4, of one filter in one direction: its value, its limit, and what theta multiplies in that."""
    first, last, dt, d = one["first"], one["frame"], about["dt_s"], np.array(one["d"])
    a, since = np.exp(-one["pole_per_s"] * dt) if "pole_per_s" in one else 0.0, one.get("since", last - 1)
    begins = not a or since in (about["since"], np.flatnonzero(log["detected"] == 0)[-1] + 1)
    require(begins and 0 <= since < first <= last <= said.get("frame", last), "frames do not follow")
    rows, past, n = slice(first, last + 1), slice(since + 1, last + 1), log["n"] @ abs(d)
    require(all(np.array_equal(one[it], log[it][rows]) for it in ("x", "F", "eta_bar")), "not so logged")
    require(np.allclose(log["bound"][rows] + one.get("rest", 0), one["eta_bar"], 1e-14, 0), "another bound")
    h, Z, r = (np.array(one.get(name, [0] * len(one["x"])), float) for name in "hZr")
    fault = one.get("fault", 0)
    require(min(*r, fault) >= 0 and (said["what"] or not any([*h, *Z, *r, fault])), "not to be admitted")
    wrong = log["wrong"][last - 1 : last + 2] if about["instants"] > 1 else log["wrong"][last]
    require(np.all(wrong) or said["theta"] != "constant while it shows", "health explains the frame")
    h, Z = (np.fmax(0, np.fmax(h + to[0] * Z, h + to[1] * Z)), 0 * r) if said["theta"] == "any" else (h, Z)
    w = a ** np.arange(last - since - 1.0, -1, -1)
    most = w @ (dt * log["eta_bar"][past] @ abs(d) + (1 - a) * n[since:last]) + a * w[0] * n[since] + n[last]
    most += dt * w[-len(h) :] @ (h + r) + a ** len(h) * fault
    return np.array([w @ (dt * log["nu"][past] @ d), most, dt * w[-len(h) :] @ Z])


def score(said, about, log):
    """Section 7: evidence, and what it must exceed. Columns of Y: nu, signature, constants; rows: e, -d."""
    dt, axes, n = about["dt_s"], said["axes"], len(said["axes"])
    Y, P, R = (np.nan_to_num(np.array(said[name], float)) for name in "YPR")  # null: it decides nothing
    A, Y, sums, room, w = np.kron([[1, dt], [0, 1]], np.eye(n)), np.insert(Y, 1, 0, axis=1), 0, 0, np.zeros(n)
    for k, its in enumerate(said["frames"], said["first"]):
        u = np.column_stack([log["nu"][k, axes] - its.get("air", 0), its["signature"], *its.get("known", [])])
        Y, P = A @ Y + dt * np.eye(2 * n, n) @ u, A @ (P + np.diag(its["Q"])) @ A.T
        K = P[:, :n] @ (inverse := np.linalg.inv(P[:n, :n] + np.diag(R)))
        before, w, sums = w, inverse @ Y[:n, 1], sums + inverse @ Y[:n, 1] @ Y[:n]
        swing = 1.2 * abs(np.linalg.pinv(K[n:])) @ its.get("bounded", np.zeros(n))
        room += np.array([swing @ abs(w - before), said.get("pace", 1e9) * swing @ abs(w)])
        Y, P = Y - K @ Y[:n], P - K @ P[:n]
    N = (abs(sums[0]) if said["sense"] == "either" else -sums[0]) - said["tolerance"] @ abs(sums[2:])
    most = max(z := said["level"] * np.sqrt(abs(sums[1])), min(room[0] + swing @ abs(w), room[1]) + z / 2)
    require(N / most <= log[said["likelihood"]][said["frame"]] * (1 + 1e-9), "more than the log's share")
    return N, most, 0


def failures(about, log):
    """A line for each statement that does not hold; log: column -> values."""
    text = json.dumps(about | {"digest": ""}, sort_keys=True, separators=(",", ":"))
    written = hashlib.sha256(text.encode()).hexdigest(), len(log["t_s"]), 2
    if written != (about["digest"], about["rows"], about["format"]):
        yield "this is not what was written, or not of this log"
    for said in about["statements"]:
        name, what, k, log = said["column"], said["what"], said.get("frame"), dict(log)
        try:
            require(name in ((None, f"fie_{what}_excluded") if what else ("detected",)), "of another column")
            require(not name or log[name][k:].all() > log[name][k - 1], f"{name} is not set in that frame")
            read(about, log)
            ends = said.get("least", -1e99), said.get("most", 1e99)  # no limit where an end decides nothing
            parts = [abs(one["weight"]) * sides(one, said, ends, about, log) for one in said.get("terms", [])]
            value, limit, slope = sum(parts) if parts else score(said, about, log)
            limit += abs(slope) > 1e-12 and max(ends[0] * slope, ends[1] * slope)
            require(value > limit and np.allclose([value, limit], said["sides"], 1e-12, 0), "not so")
        except (AssertionError, ValueError, KeyError, IndexError, TypeError) as why:
            yield f"{what or 'alarm'}: {why}"


if __name__ == "__main__":
    from pyarrow.parquet import read_table

    about = json.loads((file := Path(argv[1], "certificate.json" * Path(argv[1]).is_dir())).read_text())
    table = read_table(argv[2] if len(argv) > 2 else file.parent / "log.parquet")
    found = "\n".join(failures(about, {name: table[name].to_numpy() for name in table.column_names}))
    exit(found or print(len(about["statements"]), "statements hold"))
