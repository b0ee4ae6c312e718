"""Ambiguous flights, drawn: does each doublet that `beaver-ftc separate` proposes tell apart, in its time?

    python -m tools.drawn.separations [--flights N] [--seed S]

Until N flights end with two candidates or more: losses, jams, biases and floating surfaces shortly after they
strike, small references, both classes, several frame rates and substeps. Each proposal is flown. Counted are
those that leave both candidates where one is true, those that exclude the true one, exits from the envelope,
and how much processor time a proposal takes, and all of a flight, once scipy is there. Exit status 1 for any
of the first three, and for a certificate of a doublet that is refused.
"""

import argparse
import json
import time
from collections import Counter
from collections.abc import Callable

import numpy as np

import beaver_ftc as bf
from beaver_ftc.scenario.builtin import to_yaml
from beaver_ftc_assurance import separation
from beaver_ftc_assurance.certificates.certificate import as_text
from beaver_ftc_assurance.certificates.check_certificate import failures

SURFACES = ("aileron", "elevator", "rudder", "flap")
LOSS = "loss_of_effectiveness"
PARAMETERS = {LOSS: ("magnitude", 0.1, 1.0), "stuck": ("position_deg", -3.0, 3.0), "float": None}
WRONG = "both left", "true one excluded", "envelope exits", "certificates refused"
PARAMETERS |= {"bias": ("bias_deg", -3.0, 3.0)}


def main() -> None:
    """Draw, fly, count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--flights", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    import scipy.optimize  # noqa: F401 -- its import is not counted

    rng, count = np.random.default_rng(args.seed), Counter()
    took_s: dict[str, list[float]] = {"tell_apart": [], "propose": []}
    for name, each in took_s.items():
        setattr(separation, name, timed(getattr(separation, name), each))
    while count["ambiguous"] < args.flights:
        scenario = drawn(rng)
        count["flights"] += 1
        try:
            document = separation.separate(scenario)
        except bf.BadInput:
            continue
        count["ambiguous"] += 1
        fault = scenario.faults[0]
        for pair in document["pairs"]:
            if not pair["separates"]:
                count["none exists"] += 1
                continue
            names = [(one["surface"], one["type"]) for one in pair["candidates"]]
            left = [(one["surface"], one["type"]) for one in pair["left"]]
            count["proposed"] += 1
            true = (fault.actuator, fault.type)
            if len(left) == 2 and true in names:
                count["both left"] += 1
                print(f"{count['flights']}: {fault}, {names}, {pair['needs']}", flush=True)
            count["true one excluded"] += true in names and true not in left
            count["envelope exits"] += pair["envelope_exits"]
            log, proof = separation.certified(scenario, pair)
            columns = dict(zip(log.columns, log.rows.T, strict=True))
            count["certificates"] += 1
            count["certificates refused"] += bool(
                [*failures(json.loads(as_text(proof)), columns, to_yaml(scenario))]
            )
            said = {one["what"] for one in proof["statements"]}
            gone = [f"{surface} {kind}" for surface, kind in names if (surface, kind) not in left]
            proved = [what in said or what.split()[0] in said for what in gone]
            count["exclusions"] += len(gone)
            count["proved"] += sum(proved)
    print(*(f"{word} {n}" for word, n in count.items()), sep=", ")
    for name, words in (
        ("tell_apart", "a proposal, or that there is none"),
        ("propose", "those of a flight"),
    ):
        took_ms = 1e3 * np.array(took_s[name])
        print(f"{words}: median {np.median(took_ms):.1f} ms, at most {took_ms.max():.1f} ms")
    raise SystemExit(any(count[word] for word in WRONG))


def timed(function: Callable, took_s: list[float]) -> Callable:
    """The same function; the processor time of each call goes to the list."""

    def call(*arguments: object) -> object:
        began = time.process_time()
        answer = function(*arguments)
        took_s.append(time.process_time() - began)
        return answer

    return call


def drawn(rng: np.random.Generator) -> bf.Scenario:
    """A flight that ends shortly after its fault."""
    everything = bool(rng.random() < 0.8)
    kind = str(rng.choice([*PARAMETERS])) if everything else LOSS
    at_s = round(float(rng.uniform(0.3, 1.5)), 2)
    fault = {"type": kind, "actuator": str(rng.choice(SURFACES[: 4 if everything else 3])), "at_s": at_s}
    if PARAMETERS[kind]:
        name, low, high = PARAMETERS[kind]
        fault[name] = float(rng.uniform(low, high))
    reference = {
        axis: [{"sine": {"amplitude_deg_s": rng.uniform(0.2, 3), "frequency_hz": rng.uniform(0.1, 0.8)}}]
        for axis in "pqr"
    }
    more = {"aircraft": "jsbsim:c172p"} if rng.random() < 0.3 and "flap" not in fault.values() else {}
    if rng.random() < 0.3:
        more["sensors"] = {axis: {"noise_std_deg_s": 0.002, "scale_error": 1e-3} for axis in "pqr"}
    fdi = {"fault_class": "all" if everything else "published", "probing": {}}
    fdi["bounds"] = {"sensors": more.get("sensors", {})}
    duration_s = at_s + float(rng.uniform(0.02, 0.3))
    return bf.load({
        "name": "ambiguous", **more, "duration_s": duration_s, "reference": reference, "faults": [fault],
        "fdi": fdi, "rate_hz": float(rng.choice([50, 100, 200])), "substeps": int(rng.choice([1, 1, 2])),
    })  # fmt: skip


if __name__ == "__main__":
    main()
