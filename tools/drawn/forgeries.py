"""Forged certificates: does the checker accept a statement that is false?

    python -m tools.drawn.forgeries [--flights N] [--seed S] [--forged F]

The true certificates of N drawn flights of our scheme, and of N healthy ones, are taken. F times in all a
false statement is put into one of them: an alarm in a row in which there was none, an exclusion of a fault
that is not excluded, or at another time. Its evidence is altered by one to three of ROADS, its sides and the
digest are written again. Log and scenario stay as they are. Exit status 1 where the checker accepts a
forged certificate, or refuses a true one. How often each road was taken is printed.
"""

import argparse
import copy
import json
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import numpy as np
import yaml

import beaver_ftc as bf
from beaver_ftc.scenario.builtin import to_yaml
from beaver_ftc_assurance.certificates import check_certificate as checker
from beaver_ftc_assurance.certificates.certificate import as_text, with_digest
from tools.drawn.certificates import certified

Document = dict[str, Any]
Log = dict[str, np.ndarray]
TYPES = ("stuck", "float", "bias", "loss_of_effectiveness", "hardover up", "oscillatory", "rate_limit")
WIDE = 10.0 ** np.arange(-12.0, 13.0)


def main() -> None:
    """Forge, check, count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--flights", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--forged", type=int, default=5000)
    args = parser.parse_args()
    np.seterr(all="ignore")  # forged numbers overflow
    rng, count = np.random.default_rng(args.seed), Counter[str]()
    roads, reasons = Counter[str](), Counter[str]()
    for written, log, scenario in flights(args.seed, args.flights):
        count["true certificates"] += 1
        if refused := [*checker.failures(written, log, scenario)]:
            count["true ones refused"] += 1
            print(f"refused: {refused[0][:200]}", flush=True)
        due = -(-args.forged * count["true certificates"] // (2 * args.flights)) - count["forged"]
        for forged, names in forgeries(rng, written, log, scenario, due):
            count["forged"] += 1
            roads.update(names)
            why = [*checker.failures(forged, log, scenario)]
            reasons.update(one.rpartition(": ")[2][:60] for one in why[:1])
            count["accepted"] += not why
            if not why:
                print(f"accepted: {names}: {as_text(forged)[:400]}", flush=True)
    print(*(f"{word} {n}" for word, n in count.items()), sep=", ")
    print("roads:", ", ".join(f"{name} {n}" for name, n in sorted(roads.items())))
    for reason, n in reasons.most_common(25):
        print(f"{n:6d} {reason}")
    raise SystemExit(bool(count["true ones refused"] or count["accepted"]))


def flights(seed: int, n: int) -> Iterator[tuple[Document, Log, str]]:
    """Certificate, log and scenario of n drawn flights, and of as many healthy ones."""
    for k, (_, written, log, scenario) in enumerate(certified(seed, n)):
        yield written, log, scenario
        given = {
            "name": "healthy",
            "duration_s": 4.0,
            "seed": seed + k,
            "initial": {"airspeed_mps": 35 + k % 15},
        }
        given |= {"reference": {"q": [{"sine": {"amplitude_deg_s": 1 + k % 4, "frequency_hz": 0.3}}]}}
        given |= {"fdi": {"fault_class": ("all", "published")[k % 2]}}
        flight = bf.fly(given)
        proof = flight.proof()
        yield json.loads(as_text(proof.certificate)), proof.log, to_yaml(flight.scenario)


def forgeries(
    rng: np.random.Generator, written: Document, log: Log, scenario: str, n: int
) -> Iterator[tuple[Document, tuple[str, ...]]]:
    """So many documents with a statement that is false, and the roads by which each was made to hold."""
    for _ in range(n):
        forged = Forgery(rng, written, log)
        chosen = tuple(rng.choice([*ROADS], size=rng.integers(1, 4), replace=False))
        for name in chosen:
            with suppress(TypeError):  # a road after one that left a field of another type
                ROADS[name](forged)
        forged.restate(scenario)
        yield with_digest(json.loads(json.dumps(forged.document))), chosen


def _is_event(what: str | None, k: int, log: Log) -> bool:
    """Whether the log has this event in this row."""
    column = log.get(checker.event_column(what, log))
    return column is not None and bool(column[k:].all() and (k == 0 or not column[k - 1]))


def _copies(first: int, last: int, log: Log) -> Document:
    of = {"x": "measured_rad_s", "F": "design_rad_s2", "eta_bar": "eta_bar_rad_s2"}
    return {
        name: [[float(log[f"{axis}_{column}"][k]) for axis in "pqr"] for k in range(first, last + 1)]
        for name, column in of.items()
    }


class Forgery:
    """A document with one statement alone, `said`, of an event that the log does not have."""

    def __init__(self, rng: np.random.Generator, written: Document, log: Log) -> None:
        self.rng, self.log, self.document = rng, log, copy.deepcopy(written)
        rows, true = len(log["t_s"]), [one for one in written["statements"] if "as" not in one]
        surfaces = [name.removesuffix("_cmd_rad") for name in log if name.endswith("_cmd_rad")]
        excluded = {(one["what"], one["frame"]) for one in written["statements"]}
        while True:
            k, kind = int(rng.integers(1, rows)), rng.integers(3)
            surface = str(rng.choice(surfaces))
            what = (None, surface, f"{surface} {rng.choice(TYPES)}")[kind]
            columns = [checker.event_column(what, log), f"fie_{surface}_excluded", "detected", "t_s"]
            column = str(rng.choice(columns, p=[0.7, 0.1, 0.1, 0.1]))
            if (what, k) not in excluded and not _is_event(what, k, log):
                break
        if true and rng.random() < 0.6:  # the evidence of another event
            self.said = copy.deepcopy(true[rng.integers(len(true))])
            if rng.random() < 0.5:
                self._move(k - self.said["frame"])
        else:
            d = [0.0, 0.0, 0.0]
            d[k % 3] = (-1.0) ** (k // 3)
            term = {"weight": 1.0, "d": d, "first": k, "frame": k, **_copies(k, k, log)}
            self.said = {"theta": "any", "terms": [term], "sides": [0.0, 0.0]}
            self.document.setdefault("declared", {name: {} for name in "cbgoBm"})
            self.document.setdefault("dt_s", float(np.median(np.diff(log["t_s"]))))
        self.said |= {"what": what, "column": column, "frame": k}
        self.document["statements"] = [self.said]

    def _move(self, by: int) -> None:
        """The evidence at another time."""
        said = self.said
        for one in (*said.get("terms", ()), *said.get("bounds", ())):
            if "block" not in said and 0 < one["first"] + by <= one["frame"] + by < len(self.log["t_s"]):
                one["first"], one["frame"] = one["first"] + by, one["frame"] + by
                if "since" in one:
                    one["since"] = max(one["since"] + by, 0)
                if "x" in one:
                    one.update(_copies(one["first"], one["frame"], self.log))
        if "likelihood" in said:
            said["first"] = max(said["first"] + by, 1)

    def replace(self, **evidence: Any) -> None:
        """Other evidence for the same event."""
        for name in [name for name in self.said if name not in ("what", "column", "frame")]:
            del self.said[name]
        self.said |= evidence

    def restate(self, scenario: str) -> None:
        """Write rest and sides as the numbers now have it: the checker's own sums, whatever they are. Where
        the checker refuses before it has sums, no sides would hold."""
        said = self.said
        with suppress(Exception):
            declared = checker.declared_at_row(yaml.safe_load(scenario), said["frame"])
            frames = checker.Frames(self.document, self.log, declared, said.get("block"))
            for term in said.get("terms", ()):
                rows = slice(term["first"], term["frame"] + 1)
                term["rest"] = (np.array(term["eta_bar"]) - frames.stated_bound_rad_s2[rows]).tolist()
            sides = np.array(checker.pairs_of(said, frames, declared), float).T
            said["sides"] = sides.tolist() if {"likelihood", "bounds"} & set(said) else sides[:, 0].tolist()


# --- the roads: each alters one thing that could make a statement hold -----------------------------------


def _dt(of: Forgery) -> None:
    of.document["dt_s"] = float(of.document.get("dt_s", 0.01) * of.rng.choice([-1.0, *WIDE]))


def _instants(of: Forgery) -> None:
    of.document["instants"] = of.rng.choice([-1e9, 0, 0.5, 2, 50]).item()


def _noise(of: Forgery) -> None:
    given = {
        axis: float(v)
        for axis, v in zip("pqr", of.rng.choice([-1e3, -1e-3, 0, 1e-6, 0.5, 1e3], 3), strict=True)
    }
    of.document.setdefault("declared", {name: {} for name in "cbgoBm"})[str(of.rng.choice([*"oBm"]))] = given


def _no_bounds(of: Forgery) -> None:
    of.document["declared"] = {name: {} for name in "cbgoBm"}
    of.document["omega_E"] = of.rng.choice([0.0, -1e3, 7.292115857915991e-05]).item()


def _of_terms(alter: Callable[..., None]) -> Callable[..., None]:
    def road(of: Forgery) -> None:
        for term in (*of.said.get("terms", ()), *of.said.get("bounds", ())):
            if isinstance(term, dict):  # `bounds` of some statements are names
                alter(of.rng, term)

    return road


def _direction(rng: np.random.Generator, term: Document) -> None:
    term["d"] = rng.choice([-1.0, 0.0, 1.0, 0.3, 1e300], 3).tolist()


def _pole(rng: np.random.Generator, term: Document) -> None:
    term["pole_per_s"] = float(rng.choice([-1.0, 1.0], p=[0.7, 0.3]) * rng.choice([0.1, 5, 50, 200, 1e4]))
    term["since"] = int(max(term["frame"] - rng.integers(1, 60), 0))


def _since(rng: np.random.Generator, term: Document) -> None:
    term["since"] = int(rng.integers(-5, term["frame"] + 3))


def _weight(rng: np.random.Generator, term: Document) -> None:
    term["weight"] = float(rng.choice([-1.0, 0.0, 1e-300, 1e300, np.inf, np.nan]))


def _effect(rng: np.random.Generator, term: Document) -> None:
    for name in rng.choice([*"hZr"], rng.integers(1, 4), replace=False):
        n = term["frame"] + 1 - term["first"]
        term[str(name)] = rng.choice([-1e3, -1.0, 0.0, 1.0, 1e-13], n).tolist()


def _no_effect(rng: np.random.Generator, term: Document) -> None:
    for name in ("h", "Z", "r", "fault"):
        term.pop(name, None)


def _past(rng: np.random.Generator, term: Document) -> None:
    term["fault"] = float(rng.choice([-1e3, -1e-3, 0.0]))


def _copy(rng: np.random.Generator, term: Document) -> None:
    for name in rng.choice(["x", "F", "eta_bar"], rng.integers(1, 4), replace=False):
        if name in term:
            term[str(name)] = (np.array(term[str(name)]) * rng.choice([-1.0, 0.0, 2.0])).tolist()


def _theta(of: Forgery) -> None:
    of.said["theta"] = str(of.rng.choice(["any", "constant", "constant while it shows", "course", "none"]))
    of.said |= {
        "least": float(of.rng.choice([-1.0, 0.0, 5.0])),
        "most": float(of.rng.choice([-5.0, 0.0, 1.0])),
    }


def _block(of: Forgery) -> None:
    length = int(of.rng.choice([-1, 0, 1, 2, 20]))
    of.said["block"] = [length, 0, (len(of.log["t_s"]) // max(length, 1)) * max(length, 1)]


def _looks(of: Forgery) -> None:
    looks = of.rng.choice(
        [[1.0, 0.0, -2.0], [1.0, 0.0, 0.0], [1e3, 0.0, 1.0], [np.nan, 0.0, -1.0]], 2
    ).tolist()
    of.replace(test=str(of.rng.choice(checker.TESTS)), looks=looks, sides=[1.0, 0.0])


def _missing(of: Forgery) -> None:
    of.replace(missing=[of.rng.choice([-1, 0, 3]).item()], sides=[1.0, 0.0])


def _as_alarm(of: Forgery) -> None:
    alarm = {"likelihood": "t_s", "axes": [1], "first": 1, "what": None, "column": "detected", "frame": 1}
    of.document["statements"].insert(0, alarm)
    of.replace(**{"as": "alarm"})


def _chance(of: Forgery) -> None:
    k, shares = of.said["frame"], [name for name in of.log if name.endswith("_likelihood_share")]
    frame: Document = {"jitter": [float(of.rng.choice([0, -1e-6]))], "drift": [[0.0]], "signature": [1.0]}
    if of.rng.random() < 0.5:
        frame["bounded"] = [float(of.rng.choice([0.0, -1e6]))]
    tolerance = [-1e3] if of.rng.random() < 0.3 else []
    if tolerance:
        frame["known"] = [[1.0]]
    of.replace(
        likelihood=str(of.rng.choice([*shares, "t_s", "airspeed_mps"])),
        level=float(of.rng.choice([-50.0, 1e-9, 0.0, 6.0])), sense=str(of.rng.choice(["either", "less"])),
        axes=[int(of.rng.integers(3))], R=[float(of.rng.choice([1e-6, -1e-6, 0.0]))],
        P=[[1e-6, 0], [0, float(of.rng.choice([1e-6, -1e-6]))]], Y=[[0.0] * (2 + len(tolerance))] * 2,
        tolerance=tolerance, first=k, frames=[frame], sides=[[1.0, 1.0], [0.0, 0.0]],
    )  # fmt: skip


def _course(of: Forgery) -> None:
    k = of.said["frame"]
    frames = sorted({max(k - 2, 1), k})
    bounds = [{"d": [0.0, 1.0, 0.0], "first": j, "frame": j, "h": [0.0],
               "r": [float(of.rng.choice([0.0, -1e6]))],
               "Z": [float(z)]} for j, z in zip(frames, (1.0, -1.0), strict=False)]  # fmt: skip
    of.replace(theta="course", bounds=bounds, stops=[1e9], pace_rad_s=1e9, slowest_rad_s=1e9, near=-1e9,
             ordered=[-1e9], sides=[[1.0], [0.0]])  # fmt: skip


def _empty(of: Forgery) -> None:
    of.replace(theta=str(of.rng.choice(["any", "course"])), terms=[], sides=[1.0, 0.0])


def _odd(of: Forgery) -> None:
    """A value of another type in some field of the statement."""
    name = str(of.rng.choice([*of.said]))
    of.said[name] = [None, "1", True, [], {}, [[]], 1e400, -1][of.rng.integers(8)]


ROADS: dict[str, Callable[[Forgery], None]] = {
    "dt": _dt, "instants": _instants, "noise": _noise, "no bounds": _no_bounds,
    "direction": _of_terms(_direction), "pole": _of_terms(_pole), "since": _of_terms(_since),
    "weight": _of_terms(_weight), "effect": _of_terms(_effect), "no effect": _of_terms(_no_effect),
    "past": _of_terms(_past), "copies": _of_terms(_copy), "theta": _theta, "block": _block, "looks": _looks,
    "missing": _missing, "as the alarm": _as_alarm, "chance": _chance, "course": _course, "empty": _empty,
    "odd": _odd,
}  # fmt: skip


if __name__ == "__main__":
    main()
