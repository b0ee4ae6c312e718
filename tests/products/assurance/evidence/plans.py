"""Small plans for tests: flights of a second and a half, and plans in which it is known what is violated."""

import random

from given import given

GIVEN = given(__file__)

SHORT = {"duration_s": 1.5, "rate_hz": 50, "fdi": {"fault_class": "all"}}
LOSS = {"actuator": "elevator", "type": "loss_of_effectiveness", "at_s": 0.5}
HEALTHY = {**SHORT, "reference": {"q": [{"sine": {"amplitude_deg_s": 6, "frequency_hz": 1}}]}}
FAULTY = {**HEALTHY, "faults": [{**LOSS, "magnitude": 0.8}]}

# Of each kind: what is required, a flight that meets it, and what is changed of one that does not.
KINDS = GIVEN["kinds"]  # fmt: skip
FLIGHTS = 3  # of a requirement


def seeded(count, seed):
    """A plan of so many requirements, each violated by one flight at most; and by which, None if by none."""
    rng = random.Random(seed)
    flights, requirements, violated = {}, [], {}
    for i in range(count):
        asked, base, change = KINDS[rng.randrange(len(KINDS))]
        broken = None if change is None or rng.random() < 0.1 else rng.randrange(FLIGHTS)
        name = f"R-{i}"
        if isinstance(change, float):
            sizes = [change if k == broken else 0.8 for k in range(FLIGHTS)]
            vary = {"faults[0].magnitude": {"choice": sizes}}
            flights[f"s{i}"] = {"base": base, "vary": vary, "sampling": "grid"}
            over, flown = [f"s{i}"], [f"s{i}-{k:04d}" for k in range(FLIGHTS)]
        else:
            over = flown = [f"f{i}-{k}" for k in range(FLIGHTS)]
            flights |= {one: {**base, **(change if k == broken else {})} for k, one in enumerate(over)}
        violated[name] = None if broken is None else flown[broken]
        requirements.append({"id": name, "over": over, **asked})
    return {"name": "seeded", "flights": flights, "requirements": requirements}, violated
