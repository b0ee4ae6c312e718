"""Drawn flights, one after the other: flown, held against their promises, kept if they break one."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

import beaver_ftc as bf
from tools.drawn.compose import Drawn
from tools.drawn.declare import Words
from tools.drawn.promises import broken, flown_again
from tools.drawn.shrink import smaller

AIRCRAFT = ("beaver", "jsbsim:c172p")
AGAIN = 3  # every so many-th flight is flown again
NO_TRIM = ("trim", "no steady straight flight")  # a refusal that the schema cannot foresee


@dataclass(frozen=True)
class Outcome:
    """The outcome of a flight. refused: the reason why it was not flown."""

    index: int
    broken: tuple[str, ...] = ()
    refused: str = ""
    detected: bool = False
    named: bool = False


def fly(drawn: Drawn, again: bool | None = None) -> Outcome:
    """Fly a scenario, and test every promise. again: whether to fly it twice; by default every third one."""
    again = drawn.index % AGAIN == 0 if again is None else again
    try:
        flight = bf.fly(drawn.scenario(), log=False)
    except bf.BadInput as error:
        known = any(word in str(error) for word in NO_TRIM)
        return Outcome(drawn.index, refused=str(error), broken=() if known else (f"refused: {error}",))
    except Exception as error:  # whatever it is, it is a find
        return Outcome(drawn.index, broken=(f"{type(error).__name__}: {error}",))
    found = list(broken(flight.scenario, flight.metrics, drawn.declared))
    if again:
        found += flown_again(flight)
    metrics = flight.metrics
    detected, named = metrics["detection"]["detected"], metrics["isolation"]["isolated"]
    return Outcome(drawn.index, tuple(found), detected=detected, named=named)


def keep_it(folder: Path, drawn: Drawn, outcome: Outcome, shrink: bool) -> None:
    """Write a counterexample to a file, or with `shrink` a smaller one that breaks the same promise."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{drawn.words['name']}.yaml"
    words = drawn.words
    if shrink:
        words = smaller(drawn, outcome.broken, lambda less: fly(less, again=True).broken)
    heading = "".join(f"# {line}\n" for line in outcome.broken)
    path.write_text(heading + yaml.safe_dump(plain(words), sort_keys=False, width=110), encoding="utf-8")


def plain(words: Words) -> Words:
    """The data without tuples and NumPy numbers, which YAML cannot write."""
    return json.loads(json.dumps(words, default=np.generic.item))
