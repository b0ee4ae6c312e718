"""The alarm of chance: a fault's likelihood ratio from its onset to the alarm (docs/theory.md, section 7).

What the log does not hold is kept frame by frame: signature, what declared constants multiply, variances.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.diagnosis.likelihood import N_SLOTS, RETURNING, RINGING, STEP, slot_to_start
from beaver_ftc.diagnosis.noise_model import CHANCE
from beaver_ftc.results.certificates.inequality import Document, History
from beaver_ftc.results.certificates.tape import Tape

_AS_LOGGED = 1e-9  # of the alarm's score: more than another order of summation makes
_FORGOTTEN = 1e-10  # of the limit
NOISE, SWINGS, PACE = range(3)  # what the evidence must exceed: chance alone, or bounded uncertainty besides
NOT_STATED = "chance raised it: an onset long before, a tone, a force, or moving air"


def of_alarm(tape: Tape, history: History, surfaces: Sequence[str], k: int) -> Document | None:
    """The statement that chance raised the alarm at row k; None where it is not one onset's, or too old."""
    chances = tape.alarm["fdi"]["statistical"]
    b, h, slot = _loudest(chances)
    blocks = [frame[b] for frame in tape.chances["blocks"]]
    first = next((r for r in range(k, tape.first, -1) if slot_to_start(r - tape.since) == slot), None)
    if first is None:
        return None
    since = [blocks[r - tape.first] for r in range(first - 1, k + 1)]
    said = _written(tape, history, since, h, first)
    if said is None:
        return None
    hypothesis = blocks[k - tape.first]["hypothesis"][h]
    _leave_out(said, history)
    value, limit, _ = sides(said, history)
    score = float(hypothesis["score"] / chances["tests"]["alarm_level"])
    exact = len({float(block["pace"]) for block in since}) == 1  # or less is said than was seen
    as_logged = (1.0 - _AS_LOGGED if exact else 0.0) * score <= value / limit <= (1.0 + _AS_LOGGED) * score
    if not (value > limit and as_logged):
        return None
    return {"likelihood": _column(hypothesis, surfaces), **said, "sides": [[value], [limit]]}


def with_share(said: Document, logged: float) -> Document:
    """The statement with the share that the log has: as large, or larger where another view has more."""
    (value,), (limit,) = said["sides"]
    return said | {"sides": [[value, logged * (1.0 + _AS_LOGGED)], [limit, value / limit]]}


def shares(chances: np.void, surfaces: Sequence[str]) -> Iterator[tuple[str, float]]:
    """Column, and share of the level, of each hypothesis that raises alarms, where drifts do not return."""
    for block in chances["block"][:RETURNING]:
        for hypothesis in block["hypothesis"][: block["n_hypotheses"]]:
            if hypothesis["alarms"]:
                yield _column(hypothesis, surfaces), hypothesis["score"] / chances["tests"]["alarm_level"]


def _column(hypothesis: np.void, surfaces: Sequence[str]) -> str:
    step = hypothesis["kind"] == STEP
    of = f"{AXES[hypothesis['axis']]}_step" if step else f"{surfaces[hypothesis['surface']]}_loss"
    return f"{of}_likelihood_share"


def _leave_out(said: Document, history: History) -> None:
    """Take out what decides nothing: what the filter has forgotten, and of the bounds on what is no noise."""
    _, limit, decides = sides(said, history)
    if decides == NOISE:
        for its in said["frames"]:
            del its["bounded"]
    if decides != PACE:
        del said["pace"]
    sums, *_ = _followed(said, history)
    m = len(said["tolerance"])
    matters = [j for j in range(m) if said["tolerance"][j] * abs(sums[2 + j]) > _FORGOTTEN * limit]
    said["tolerance"] = [said["tolerance"][j] for j in matters]
    said["Y"] = [[row[0], None, *(row[2 + j] for j in matters)] for row in said["Y"]]
    for its in said["frames"]:
        if "known" in its:
            its["known"] = [its["known"][j] for j in matters]
    for row, felt in zip(said["Y"], sums[2 + m :], strict=True):
        for c, tolerance in ((0, 1.0), *enumerate(said["tolerance"], 2)):
            if abs(felt * row[c]) * tolerance < _FORGOTTEN * limit:
                row[c] = None
    for place in (*said["P"], said["R"]):
        _leave_out_of(place, said, history)


def _leave_out_of(place: list[float | None], said: Document, history: History) -> None:
    """The same of one list of variances in a statement."""
    value, limit, _ = sides(said, history)
    for i, given in enumerate(place):
        place[i] = None
        without = sides(said, history)
        if max(abs(value - without[0]), abs(limit - without[1])) > _FORGOTTEN * limit:
            place[i] = given


def _loudest(chances: np.void) -> tuple[int, int, int]:
    """Block, hypothesis and slot of the largest score that raises alarms, where drifts do not return."""
    best, found = -1.0, (0, 0, 0)
    for b, block in enumerate(chances["block"][:RETURNING]):
        for h, hypothesis in enumerate(block["hypothesis"][: block["n_hypotheses"]]):
            if hypothesis["alarms"] and hypothesis["score"] > best:
                lanes = block["lane"]["score"][h * N_SLOTS : (h + 1) * N_SLOTS]
                best, found = float(hypothesis["score"]), (b, h, int(np.argmax(lanes)))
    return found


def _written(tape: Tape, history: History, blocks: list[np.void], h: int, first: int) -> Document | None:
    """The statement, with the frames from `first` on; blocks: from the row before that. None in moving air
    that moves several axes together, or whose drift returns."""
    start, dt = blocks[0], history.dt
    both = range(int(start["n"]))
    if start["lag"] > 0.0 or any(
        block[name][0, 1] for block in blocks for name in ("P_xx", "P_xd", "P_dd", "drift") if len(both) > 1
    ):
        return None
    felt = [i for i in both if any(block["hypothesis"][h]["signature"][i] for block in blocks[1:])]
    axes, states = [int(start["axis"][i]) for i in felt], [*felt, *(2 + i for i in felt)]
    known = [j for j in range(start["n_regressors"]) if start["tolerance"][j] > 0.0]
    known = [j for j in known if any(block["regressor_response"][j, felt].any() for block in blocks[1:])]
    frames, grown = [], np.zeros(len(felt))  # of the drift's variance: it is felt a frame later
    for r, (then, now) in enumerate(pairwise(blocks), first):
        known_then, responses = then["regressor_state"][:, states], now["regressor_response"][:, felt]
        seen = _input(then["state"][states], now["innovation"][felt], dt)
        its = {
            "signature": now["hypothesis"][h]["signature"][felt],
            "known": [_input(known_then[j], responses[j], dt) for j in known],
            "Q": [*dt * dt * then["jitter"][felt], *grown],
            "bounded": tape.chances["bounded"][r - 1 - tape.first][axes],
        }
        grown = dt * np.diag(then["drift"])[felt]
        if bool(tape.alarm["fdi"]["statistical"]["air"]["moving"]):
            its["air"] = history.innovation(slice(r, r + 1))[0, axes] - seen
        frames.append({name: np.asarray(values).tolist() for name, values in its.items() if len(values)})
    of_known = (start["regressor_state"][j, states] for j in known)
    Y = np.array([start["state"][states], np.zeros(len(states)), *of_known]).T
    xx, xd, dd = (np.diag(np.diag(start[name])[felt]) for name in ("P_xx", "P_xd", "P_dd"))
    Y, P = np.vstack([Y[: len(felt)], -Y[len(felt) :]]), np.block([[xx, xd], [xd, dd]])
    return {
        "level": float(tape.alarm["fdi"]["statistical"]["tests"]["alarm_level"]), "axes": axes,
        "sense": "less" if start["lane"]["sense"][h * N_SLOTS] else "either",
        "pace": max(float(block["pace"]) for block in blocks),
        "tolerance": [float(start["tolerance"][j]) for j in known], "R": start["noise"][felt].tolist(),
        "Y": Y.tolist(), "P": P.tolist(), "first": first, "frames": frames,
    }  # fmt: skip


def _input(then: np.ndarray, response: np.ndarray, dt: float) -> np.ndarray:
    """The acceleration (n,) that gave this response of a filter in this state (2 n,) a frame before."""
    n = len(response)
    return np.asarray((response - then[:n]) / dt + then[n:])


def sides(said: Document, history: History) -> tuple[float, float, int]:
    """Evidence, what it must exceed, and which of NOISE, SWINGS, PACE that follows from."""
    sums, swings, drifts = _followed(said, history)
    N, D, R = sums[0], sums[1], sums[2 : 2 + len(said["tolerance"])]
    evidence = (-N if said["sense"] == "less" else abs(N)) - np.array(said["tolerance"]) @ np.abs(R)
    root = said["level"] * np.sqrt(D)
    of_swings, of_pace = (room + CHANCE * root for room in (swings, drifts))
    decides = NOISE if root >= min(of_swings, of_pace) else (SWINGS if of_swings <= of_pace else PACE)
    return float(evidence), float(max(root, min(of_swings, of_pace))), decides


def _followed(said: Document, history: History) -> tuple[np.ndarray, float, float]:
    """N, D, each R, and what N owes to each state before the first frame, (2 + constants + 2 n,); what a
    bounded uncertainty adds as it swings, and at its pace."""
    axes, dt = said["axes"], history.dt
    n = len(axes)
    Y, P, R = (np.nan_to_num(np.array(said[name], float)) for name in "YPR")
    Y, pace = np.column_stack([Y, np.eye(2 * n)]), said.get("pace", 1e9)
    A, sums, w = np.kron([[1.0, dt], [0.0, 1.0]], np.eye(n)), np.zeros(Y.shape[1]), np.zeros(n)
    swings = drifts = last = 0.0
    for r, its in enumerate(said["frames"], said["first"]):
        seen = history.innovation(slice(r, r + 1))[0, axes] - its.get("air", 0.0)
        Y, P = A @ Y, A @ (P + np.diag(its["Q"])) @ A.T
        Y[:n, : -2 * n] += dt * np.column_stack([seen, its["signature"], *its.get("known", [])])
        inverse = np.linalg.inv(P[:n, :n] + np.diag(R))
        G, K = Y[:n].copy(), P[:, :n] @ inverse
        Y, P, before, w = Y - K @ G, P - K @ P[:n], w, inverse @ G[:, 1]
        sums = sums + w @ G
        swing = RINGING * np.abs(np.linalg.pinv(K[n:])) @ its.get("bounded", np.zeros(n))
        swings, drifts = swings + swing @ np.abs(w - before), drifts + pace * swing @ np.abs(w)
        last = swing @ np.abs(w)
    return sums, float(swings + last), float(drifts)
