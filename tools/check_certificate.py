# `check_certificate.py FOLDER|FILE [LOG]` exits 0 if the log proves it. Letters: docs/certificates.md.
import sys
from hashlib import sha256
from json import dumps, loads
from pathlib import Path

import numpy as np
from numpy.testing import assert_ as require  # raises AssertionError, with -O as well
from pyarrow.parquet import read_table


class Flight:
    def __init__(self, about, log, L=1, s=0, e=None):  # sections 1 and 2, by row, or by block of L rows
        ends, self.log = ("measured_rad_s", "design_rad_s2", "eta_bar_rad_s2"), log
        x, F, H = (np.column_stack([log[f"{i}_{end}"] for i in "pqr"]) for end in ends)
        said, w, parts = about["declared"], about.get("omega_E", 0), about.get("instants", 1)
        c, b, g, o, beta, m = (np.array([said[name].get(axis, 0.0) for axis in "pqr"]) for name in "cbgoBm")
        f, late, dt = abs(x) + (o + m * abs(x)) / (1 - m), int(parts * L > 1), about.get("dt_s", 1) * L
        B = c * f[:, [1, 0, 0]] * f[:, [2, 2, 1]] + b + w * ((1 + g) * f.sum(1)[:, None] + g * w) + 1e-11
        of = np.stack([x, o - beta + m * f, F, H, np.roll(B, 1, 0) / parts])[:, s:e].reshape(5, -1, L, 3)
        self.x, self.n, self.F, self.eta_bar, self.bound = x, n, F, H, B = *of[:2, :, -1], *of[2:].mean(2)
        self.nu, self.most = np.diff(x, 1, 0, x[:1] * np.nan) / dt - F, H + (n + np.roll(n, 1, 0)) / dt
        shows = (abs(self.nu) > self.most).any(1) & (B < H * (1 + 1e-13)).all(1)
        self.late, self.dt, self.shows = late, dt, shows & np.roll(shows, late) & np.roll(shows, -late)

    def sides(self, one, said, to):  # section 4, a filter along d: value, limit, what theta multiplies
        k, dt, d, fault, theta = one["frame"], self.dt, np.array(one["d"]), one.get("fault", 0), said["theta"]
        a, since = np.exp(-one.get("pole_per_s", np.inf) * dt), one.get("since", k - 1)
        rows, past, n = slice(one["first"], k + 1), slice(since + 1, k + 1), self.n @ abs(d)
        fits = [np.allclose(one[it], vars(self)[it][rows], 1e-13, 0) for it in ("x", "F", "eta_bar")]
        fits += [np.allclose(self.bound[rows] + one.get("rest", 0), one["eta_bar"], 1e-14, 0)]
        h, Z, r = (np.array(one.get(name, [0] * len(one["x"])), float) for name in "hZr")
        fits += [0 <= since < one["first"] <= k <= said.get("frame", k), said["what"] or not np.any([h, Z])]
        require(all(fits) and min(*r, fault) >= 0 and (self.shows[k] or "shows" not in theta), "not logged")
        h, Z = (np.fmax(0, np.fmax(h + to[0] * Z, h + to[1] * Z)), 0) if theta == "any" else (h, Z)
        w, v = a ** np.arange(k - since - 1.0, -1, -1), dt * a ** np.arange(len(h) - 1.0, -1, -1)
        most = w @ (dt * self.eta_bar[past] @ abs(d) + (1 - a) * n[since:k]) + a * w[0] * n[since] + n[k]
        return np.array([w @ (dt * self.nu[past] @ d), most + v @ (h + r) + a ** len(h) * fault, sum(v * Z)])

    def course(self, said):  # fault-types.md: frames bound a deflection; pairs: more than a type allows
        found, get, (_, kind, *how) = [], said.get, said["what"].split()
        for one in said["bounds"]:
            k, (d, h, Z, r) = np.arange(one["first"], one["frame"] + 1), (np.array(one[i]) for i in "dhZr")
            theta = (self.nu[k] @ d - h - self.most[k] @ abs(d) - r) / Z
            found.append([k, Z, np.where(self.shows[k] & (r >= 0), theta, np.nan), theta + h / Z])
        below = (rows := np.concatenate(found, axis=1))[1] > 0
        (k, _, q, off), (K, _, o, away) = rows[:, below], rows[:, ~below].sum(axis=1)  # one from above
        ahead, stops, inc = q - get("ordered", 0), get("stops", [0]), "grows" in how
        pairs = [(off[0], 0), (off[0], away), (q[0], stops[0]), (stops[-1], o), (K, k[0])]
        pairs += [(q[0] + get("pace_rad_s", 0) * self.dt * (K - k[0] - self.late), o)]
        pairs += [(len(q) - 1, np.pi / get("slowest_rad_s", 1) / self.dt), (min(ahead), 0), (sum(ahead), 0)]
        pairs += [(q[-1], o - get("step", 0) * (len(q) - 2)), (q[-1], get("near", 0)), (1, abs(K - k[0]))]
        at = {"bias": (1 - inc, 4 + inc), "hardover": (3, 6), "oscillatory": (6, 9), "rate_limit": (7, 12)}
        require(sum(~below) == (kind != "oscillatory") and np.all(np.diff(k) == 1), "frames do not follow")
        return *np.transpose(pairs[slice(*at[kind])]), 0

    def score(self, said):  # section 7: evidence, what it must exceed; Y: columns nu, signature, constants
        S, room, w, dt, eye = 0, 0, 0, self.dt, np.eye(2 * (n := len(axes := said["axes"])), n)
        Y, P, R = (np.nan_to_num(np.array(said[name], float)) for name in "YPR")  # null: it decides nothing
        for k, its in enumerate(said["frames"], said["first"]):
            u = np.stack([self.nu[k, axes] - its.get("air", 0), its["signature"], *its.get("known", [])], 1)
            Q = np.pad(np.diag(its["jitter"]), (0, n)) + np.pad(its["drift"], (n, 0))
            c, b = 1 - its.get("keep", 1), np.array(its.get("bounded", [0] * n))
            Y, P = (A := np.kron([[1, dt], [0, 1 - c]], eye[:n])) @ Y + dt * eye @ u, A @ (P + Q) @ A.T
            K, before, w = P[:, :n] @ (inv := np.linalg.inv(P[:n, :n] + np.diag(R))), w, inv @ Y[:n, 1]
            S = S + w @ np.column_stack([Y[:n], its.get("foreseen", np.zeros(n))])
            swing, stay = 1.2 * abs(np.linalg.pinv(K[n:])) @ b, c * b / (np.diag(K) * c / dt + np.diag(K[n:]))
            room += np.array([swing @ abs(w - before), its.get("pace", 1e9) * swing @ abs(w)]) + stay @ abs(w)
            Y, P = Y - K @ Y[:n], P - K @ P[:n]
        N = max(min(0, S[-1]) - S[0], S[0] * (said["sense"] == "either")) - said["tolerance"] @ abs(S[2:-1])
        most = max(z := said["level"] * np.sqrt(abs(S[1])), min(room[0] + swing @ abs(w), room[1]) + z / 2)
        return *np.transpose([(N, most), (self.log[said["likelihood"]][k] * (1 + 1e-5), N / most)]), 0


def failures(about, log):  # a line for each statement that does not hold; log: column -> values
    text = dumps(about | {"digest": ""}, sort_keys=True, separators=(",", ":")).encode()
    if (sha256(text).hexdigest(), len(log["t_s"]), 4) != (about["digest"], about["rows"], about["format"]):
        yield "this is not what was written, or not of this log"
    every = [about["statements"][0] | i if "as" in i else i for i in about["statements"]]  # as the alarm
    for said, name, what, k, get in ((i, i["column"], i["what"], i.get("frame"), i.get) for i in every):
        try:
            require(name in ((None, f"fie_{what}_excluded") if what else ("detected",)), "of another column")
            require(not name or all(log[name][k:]) > log[name][k - 1], f"{name} is not set in that frame")
            to, its = (get("least", -1e99), get("most", 1e99)), Flight(about, log, *get("block", ()))
            sums = [abs(one["weight"]) * its.sides(one, said, to) for one in get("terms", [])]
            sums += [np.array([z - foretold, may, 0]) for z, foretold, may in get("looks", [])]  # section 9
            sums += [np.array([log["watch_missing"][k] == i, 0, 0]) for i in get("missing", [])]
            value, limit, slope = sum(sums) if sums else (its.course if "bounds" in said else its.score)(said)
            require("looks" not in said or log["watch_share"][k] * (1 + 1e-9) > value / limit, "not logged")
            limit += abs(slope) > 1e-12 and max(to[0] * slope, to[1] * slope)
            require(np.all(value > limit) and np.allclose([value, limit], said["sides"], 1e-12, 0), "not so")
        except (AssertionError, ValueError, KeyError, IndexError, TypeError) as why:
            yield f"{what or 'alarm'}: {why}"


if __name__ == "__main__":
    sys.excepthook = lambda _, why, at: print("no certificate at FOLDER|FILE [LOG]:", why, file=sys.stderr)
    about = loads((file := Path(sys.argv[1], "certificate.json" * Path(sys.argv[1]).is_dir())).read_text())
    log = read_table([*sys.argv, file.parent / "log.parquet"][2]).to_pydict()
    sys.exit("\n".join(failures(about, log)) or print(len(about["statements"]), "statements hold"))
