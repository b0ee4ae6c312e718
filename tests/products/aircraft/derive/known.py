"""An aircraft whose terms are known, and states whose accelerations follow from them by Euler's equations."""

from pathlib import Path

import numpy as np
import yaml

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.schema import AircraftFile
from beaver_ftc_aircraft.derive.sample import Samples

TRAINER = Path(__file__).parents[3] / "data" / "aircraft" / "trainer"
SIGNALS = ("mach", "engines_m")


def aircraft(*signals, **more):
    """The trainer, with signals that none of its terms has, and other keys of its file."""
    data = yaml.safe_load((TRAINER / "aircraft.yaml").read_text())
    data["signals"] = {name: {"property": f"of/{name}"} for name in signals}
    return Aircraft(AircraftFile.model_validate(data | more), TRAINER)


def states(of, n=400, seed=1, signals=SIGNALS):
    """Samples of an aircraft; `beside` is what its moments are but for the terms, (n, 3) of Cl, Cm, Cn."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(-0.5, 0.5, (n, 3))
    alpha, beta, V = rng.uniform((-0.1, -0.15, 35), (0.2, 0.15, 65), (n, 3)).T
    y = np.column_stack([alpha, beta, V, 0.5 * rng.uniform(0.9, 1.2, n) * V**2])
    u = rng.uniform(-0.35, 0.35, (n, 3))
    named = {name: rng.uniform(0.1, 0.4 + 0.1 * i, n) for i, name in enumerate(signals)}
    box, level, age = rng.integers(0, 4, n), rng.integers(0, 4, n), rng.choice([0, 0, 1, 2], n)
    return moving(of, Samples(x, y, named, u, np.zeros((n, 3)), box, level, age))


def moving(of, samples, beside=0.0):
    """The same, with the accelerations of its terms and of other coefficients (n, 3)."""
    mass, geometry = of.mass, of.geometry
    J = np.array([
        [mass.Ix_kg_m2, 0, -mass.Jxz_kg_m2], [0, mass.Iy_kg_m2, 0], [-mass.Jxz_kg_m2, 0, mass.Iz_kg_m2]
    ])  # fmt: skip
    arms = np.array([geometry.span_m, geometry.chord_m, geometry.span_m])
    rate = np.empty_like(samples.x)
    for k, (x, (alpha, beta, V, qdyn), u) in enumerate(zip(samples.x, samples.y, samples.u, strict=True)):
        flow = {"alpha": alpha, "beta": beta, "ph": x[0] * arms[0] / (2 * V), "qh": x[1] * arms[1] / V}
        flow |= {"rh": x[2] * arms[2] / (2 * V), **dict(zip(of.surfaces, u, strict=True))}
        flow |= {name: values[k] for name, values in samples.signals.items()}
        C = np.array([
            sum(t.value * np.prod([flow[f] for f in t.factors]) for t in of.moments if t.coefficient == name)
            for name in ("Cl", "Cm", "Cn")
        ])  # fmt: skip
        extra = np.broadcast_to(beside, rate.shape)[k]
        moment = qdyn * geometry.wing_area_m2 * arms * (C + extra)
        rate[k] = np.linalg.solve(J, moment - np.cross(x, J @ x))
    return Samples(**{**vars(samples), "rate": rate})
