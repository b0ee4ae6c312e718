"""A data base and parameters in the source's form, of made-up numbers: for where NASA's are not."""

from itertools import product

import numpy as np
import yaml
from scipy.io import savemat
from tools.gtm.flights import NAMES
from tools.gtm.specification import DATABASE

from beaver_ftc_aircraft.gtm.parameters import cases, parameters

_DEFLECTIONS = {  # deg, uneven steps; where the model knows of nothing to do, the table has zeros
    "stab": [-12.0, -5.0, 0.0, 4.0], "elev": [-30.0, -17.0, -9.0, 0.0, 8.0, 20.0],
    "ail": [-20.0, -13.0, -6.0, 0.0, 5.0, 12.0, 20.0], "rud": [-30.0, -18.0, -7.0, 0.0],
    "spo": [0.0, 14.0, 45.0],
}  # fmt: skip
# As the source has them, not as the converter does: thrust and rotors are held against these.
_ENGINES = {
    "left": {"position": [-4.32525, -1.183333, -0.6425], "angles": [0, 1.98, 2.22]},
    "right": {"position": [-4.32525, 1.183333, -0.6425], "angles": [0, 1.95, -1.18]},
    "rpm_percent": {
        "polynomial": [0.000033035538475, -0.008354385314499, 1.191126728328792, 31.518959847101669]
    },
    "thrust": {"polynomial": [0.000014847593013, 0, 0, 0.412662356277121]},
    "rotor": {"shaft_dia": 0.0625, "shaft_len": 0.5208333, "density": 15.2},
}
_ROTATION = [-0.5, -0.31, -0.17, -0.06, 0.0, 0.05, 0.2, 0.33, 0.5]


def write(folder):
    """Write both files. No two numbers of the tables are alike."""
    savemat(folder / DATABASE, tables())
    (folder / "parameters.yaml").write_text(yaml.safe_dump(_parameters()))
    return folder


def tables():
    """The content of the data base."""
    rng = np.random.default_rng(5)

    def grid(low, high, n):
        step = (high - low) / (n - 1)
        return np.linspace(low, high, n) + rng.uniform(-0.3, 0.3, n) * step

    def table(shape, **axes):
        return {"data": rng.normal(0.0, 0.1, shape), **axes}

    def angles(n=32, m=27, low=-5.0, high=85.0, side=45.0):
        return {"alpha": grid(low, high, n), "beta": grid(-side, side, m)}

    found = {"C6_bas": table((32, 27, 6), **angles()), "dC3_lgr": table((32, 2, 3), alpha=grid(-5, 85, 32))}
    for name, keys, outputs in (
        ("dC3_ele", ("stab", "elev"), 3), ("dC6_ail", ("ail",), 6), ("dC6_rud", ("rud",), 6),
        ("dC6_spo", ("spo",), 6),
    ):  # fmt: skip
        axes = {key: _DEFLECTIONS[key] for key in keys}
        found[name] = table((32, 27, *map(len, axes.values()), outputs), **angles(), **axes)
        found[name]["data"][:, :, *(axes[key].index(0.0) for key in keys)] = 0.0
    found["dC6_w"] = table((24, 9, 21, 6), alpha=grid(-5, 80, 24), what=_ROTATION, beta=grid(-40, 40, 21))
    found["dC6_w"]["data"][:, _ROTATION.index(0.0)] = 0.0
    for rate, n, reach in (("p", 24, 0.06), ("q", 24, 0.01), ("r", 25, 0.05)):
        axes = {"alpha": grid(-5, 80, n), f"{rate}hat": grid(-reach, reach, 15)}
        found[f"dC3_{rate}"] = table((n, 15, 3), **axes)
    found["dC6_damage"] = {
        "bas": table((18, 13, 6, 6), **angles(18, 13, -4.0, 40.0, 30.0)),
        "ddscale": table((18, 6, 3, 6), alpha=grid(-4, 40, 18)),
        "ddinc": table((24, 6, 3, 6), alpha=grid(-5, 80, 24)),
    }
    flaps = {f"flap{side}{place}": rng.normal(0.0, 0.01, 6) for side, place in product("lr", ("ib", "ob"))}
    return {"ver": "Polynominal Fit, with damage", **found, "flaps": flaps}


def _parameters():
    """What the specification takes, of the numbers that the converter has."""
    of = parameters()
    letters = {name: short for short, name in NAMES.items()}
    mass, engine = of["mass"], of["engine"]
    damage = {
        number: {
            "dweight_lbf": case["dweight_lbf"], "dCG_in": case["dcg_in"],
            "gain_0": [letters[name] for name in case["takes"]],
            **{f"dI{name}": value for name, value in case["inertia"].items()},
        }
        for number, case in enumerate(cases().values(), 1)
    }  # fmt: skip
    damping, stiffness = engine["spool"]["a"]
    return {
        "mass": {
            "gravity": {"value": 32.17405}, "weight": {"value": mass["weight_lbf"]},
            "cg": {"value": mass["cg_ft"]},
            "inertia": {f"I{name}": value for name, value in mass["inertia"].items()},
            "inertia_fuel_polynomials": {f"I{name}": [0.5, v] for name, v in mass["at_zero_burn"].items()},
        },
        "geometry": {"ref_cg": {"value": [-4.775025, 0.0, -0.9401]}},
        "engines": {
            "spool": {"A": [[-damping, -stiffness], [1, 0]], "B": [1, 0], "C": engine["spool"]["c"]},
            **_ENGINES,
        },
        "aero_shares": {
            "elevator_arm_spans": {"ELLOB": -0.07, "ELLIB": -0.03, "ELROB": 0.07, "ELRIB": 0.03},
            "rudder_upper": [0.5, 0.5, 0.5, 0.67, 0.67, 0.5],
            "rudder_lower": [0.5, 0.5, 0.5, 0.33, 0.33, 0.5],
            "spoiler_inboard": [0.45, 0.45, 0.45, 0.26, 0.45, 0.26],
            "spoiler_outboard": [0.55, 0.55, 0.55, 0.74, 0.55, 0.74],
        },
        "damage": {"cases": damage},
    }  # fmt: skip
