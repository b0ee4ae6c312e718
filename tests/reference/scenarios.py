"""Scenarios to compare in: a covering array over what the diagnosis depends on, and over what it meets."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from tools.drawn.array import CoveringArray, Factor

Document = dict[str, Any]
FAULTS = {
    "loss": {"type": "loss_of_effectiveness", "magnitude": 0.5},
    "total loss": {"type": "loss_of_effectiveness", "magnitude": 1.0},
    "stuck": {"type": "stuck", "position_deg": 2.0},
    "hardover": {"type": "hardover", "direction": 1},
    "float": {"type": "float"},
    "bias": {"type": "bias", "bias_deg": 1.5},
    "slow": {"type": "rate_limit", "scale": 0.02},
    "oscillation": {"type": "oscillatory", "amplitude_deg": 1.5, "frequency_rad_s": 6.0},
    "outside": {"type": "unanticipated", "Cm_alpha3": 10.0},
}
AT_ONCE = {"stuck", "hardover", "float"}
SECOND: dict[str, Document] = {
    "stuck": {"type": "stuck", "position_deg": -2.0}, "bias": {"type": "bias", "bias_deg": -1.5},
}  # fmt: skip
GYRO = {"noise_std_deg_s": 0.02, "bias_deg_s": 0.05, "quantum_deg_s": 0.001, "scale_error": 0.002}
SENSORS: dict[str, Any] = {
    "ideal": "ideal",
    "gyros": dict.fromkeys("pqr", GYRO),
    "steady": {"p": {"bias_deg_s": 0.1}, "q": {"scale_error": 0.01}, "V": {"scale_error": 0.01}},
    "all": {
        **dict.fromkeys("pqr", GYRO),
        "alpha": {"noise_std_deg": 0.1, "bias_deg": 0.2}, "beta": {"noise_std_deg": 0.1, "bias_deg": -0.2},
        "V": {"noise_std_mps": 0.2, "bias_mps": 0.3},
        "qdyn": {"noise_std_pa": 4.0, "quantum_pa": 1.0, "bias_pa": 2.0},
        "phi": {"noise_std_deg": 0.1}, "theta": {"bias_deg": 0.1}, "psi": {"noise_std_deg": 0.2},
        "ax": {"bias_mps2": 0.05}, "ay": {"noise_std_mps2": 0.05, "bias_mps2": 0.02},
        "az": {"noise_std_mps2": 0.1, "scale_error": 0.002},
        "altitude": {"noise_std_m": 1.0, "bias_m": 3.0, "scale_error": 0.001},
        "engine_rpm": {"bias_rpm": 10.0}, "manifold_pressure": {"noise_std_inhg": 0.05},
    },
}  # fmt: skip
SERVO = {"bandwidth_rad_s": 20.0, "rate_limit_deg_s": 60.0}
SECTIONS: dict[str, dict[str, Document]] = {
    "actuators": {
        "ideal": {}, "lag": {"bandwidth_rad_s": 15.0}, "lag and rate": SERVO, "one": {"elevator": SERVO},
    },
    "design": {
        "nominal": {}, "no engine": {"engine_terms": False}, "linearised": {"linearised": True},
        "frozen alpha": {"frozen_alpha": True}, "both": {"linearised": True, "frozen_alpha": True},
        "heavy": {
            "mass": 1.03, "inertia": {"Ix": 0.98, "Jxz": 1.05},
            "coefficients": {"Cm_alpha": 1.1, "Cl_beta": 0.9},
        },
    },
    "sharpen": {
        "default": {}, "none": {"sharpen": "none"}, "no bank": {"sharpen": {"pole_bank": False}},
        "no memory": {"sharpen": {"memory": False}}, "no sets": {"sharpen": {"set_membership": False}},
        "own axes": {"sharpen": {"shared_effectiveness": False}},
    },
    "poles": {
        "default": {},
        "others": {"detection_pole_per_s": 4.0, "pole_bank_per_s": [30, 200], "isolation_pole_per_s": 3.0},
        "many": {"pole_bank_per_s": [2.0, 20.0, 60.0, 1e6], "forgetting_time_s": 1.0},
    },
    "constant": {
        "default": {}, "other": {"constant_rad_s2": {"p": 0.05, "q": 0.03}}, "none": {"constant_rad_s2": {}},
    },
    "coupling": {"default": {}, "other": {"inertia_coupling": {"p": 0.1, "r": 0.4}}},
    "coefficients": {
        "-": {}, "all": {"coefficients": 0.04}, "some": {"coefficients": {"Cl_0": 0.1, "Cm_0": 0.05}},
    },
    "inertia": {"-": {}, "some": {"inertia": 0.03}},
    "deflection": {"-": {}, "some": {"deflection_deg": 0.1}},
    "servo errors": {
        "-": {}, "all": {"actuators": {"bandwidth": 0.2, "rate_limit": 0.1, "dead_band_deg": 0.1}},
        "some": {"actuators": {"bandwidth": 0.3, "elevator": {"dead_band_deg": 0.2}}},
    },
}  # fmt: skip
OPTIONS = {"adaptation_gain": 800.0, "initial_theta": -0.3, "network_gain": 60.0}
SCHEMES: dict[str, Document] = {
    "adaptive-estimators": {},
    "zhang2005": {"scheme": "zhang2005"},
    "no projection": {"scheme": "zhang2005", "options": {**OPTIONS, "projection": 0}},
    "no dead zone": {"scheme": "zhang2005", "options": {**OPTIONS, "dead_zone": 0}},
    "constant thresholds": {"scheme": "zhang2005", "options": {"adaptive_threshold": 0, "leave_out": 1}},
}
BOUNDS = ("constant", "coupling", "coefficients", "inertia", "deflection", "servo errors")
REFERENCES: dict[str, Document] = {
    "sines": {
        "p": [{"sine": {"amplitude_deg_s": 4, "frequency_hz": 0.5}}],
        "q": [{"sine": {"amplitude_deg_s": 3, "frequency_hz": 0.7}}],
        "r": [{"sine": {"amplitude_deg_s": 2, "frequency_hz": 0.6}}],
    },
    "doublets": {
        "p": [{"doublet": {"amplitude_deg_s": 8, "start_s": 0.4, "width_s": 0.5}}],
        "q": [{"doublet": {"amplitude_deg_s": 5, "start_s": 0.3, "width_s": 0.6}}],
    },
    "none": {},
}
RATES = {"usual": (100, 2.5), "slow": (40, 4.0), "fast": (200, 1.5)}
STRUCK = frozenset(FAULTS)
OURS = {"scheme": frozenset({"adaptive-estimators"})}
STILL = OURS | {"turbulence": frozenset({"none"})}
DETECTORS: dict[str, Document] = {
    "worst case": {},
    "either": {"statistical": {}},
    "statistical": {"statistical": {"misnaming": 0.01, "uncertainty_rad_s": 5.0}, "authority": "statistical"},
    "both": {"statistical": {"false_alarms_per_h": 10.0}, "authority": "worst-case"},
    "eager": {"statistical": {"false_alarms_per_h": 3600.0}, "authority": "statistical"},
}
SLOWEST: dict[str, Document] = {
    "default": {}, "quick": {"slowest_oscillation_rad_s": 12.0, "slowest_rate_deg_s": 2.0},
}  # fmt: skip
SINUSOID = {"amplitude_rad_s2": 0.02, "frequency_rad_s": 8.0}
TRUTHS: dict[str, Document] = {
    "as modelled": {}, "errs": {"sinusoid": dict.fromkeys("pqr", SINUSOID)}, "calm": {},
}  # fmt: skip
FACTORS = (
    Factor("aircraft", ("beaver", "beaver-split", "jsbsim:c172p")),
    Factor("rate", tuple(RATES)),
    Factor("substeps", ("1", "2", "5")),
    Factor("scheme", tuple(SCHEMES)),
    Factor("fault_class", ("published", "all")),
    Factor("detector", tuple(DETECTORS), OURS),
    Factor("pairs", ("false", "true"), {"fault_class": frozenset({"all"})}),
    Factor("slowest", tuple(SLOWEST), {"fault_class": frozenset({"all"})}),
    Factor("thresholds", ("interval", "published"), OURS),
    Factor("fault_profile", ("any", "abrupt")),
    *(Factor(name, tuple(levels), OURS if name == "sharpen" else {}) for name, levels in SECTIONS.items()),
    Factor("declared sensors", tuple(SENSORS)),
    Factor("true sensors", ("ideal", "as declared")),
    Factor("truth", ("as modelled", "errs")),
    Factor("turbulence", ("none", "light", "moderate")),
    Factor("altitude", ("1500", "40")),
    Factor("law", ("fault-tolerant", "nominal", "adaptive")),
    Factor("reference", tuple(REFERENCES)),
    Factor("fault", ("none", *FAULTS)),
    Factor("course", ("abrupt", "ended", "growing"), {"fault": STRUCK}),
    Factor("surface", ("first", "second", "third", "last"), {"fault": STRUCK - {"outside"}}),
    Factor("second", ("none", *SECOND), {"pairs": frozenset({"true"}), "fault": STRUCK - {"outside"}}),
)


OF_ALL_TYPES = {
    "scheme": ("adaptive-estimators",), "fault_class": ("all",), "fault_profile": ("any",),
    "slowest": ("quick",), "fault": tuple(FAULTS), "turbulence": ("none", "light"),
    "declared sensors": ("ideal", "gyros", "steady"), "design": ("nominal", "heavy"),
    "poles": ("default",), "constant": ("default",), "coupling": ("default",),
}  # fmt: skip
IN_GUSTS = {
    "scheme": ("adaptive-estimators",), "fault_class": ("published",), "detector": tuple(DETECTORS)[1:],
    "turbulence": ("light", "moderate"), "aircraft": ("beaver", "beaver-split"), "truth": tuple(TRUTHS),
}  # fmt: skip
PARITY = {
    "scheme": ("adaptive-estimators",), "fault_class": ("all",), "detector": ("either", "eager"),
    "substeps": ("1",), "pairs": ("false",), "slowest": ("quick",), "truth": tuple(TRUTHS),
}  # fmt: skip


LAW = {"power": {"enabled": False}}  # the second flight does not repeat it
# Parity directions, which take time, are those of the fourth kind.
PLAIN = STILL | {"fault_class": frozenset({"published"})}, STILL | {"substeps": frozenset({"2", "5"})}
DETECTOR_NEEDS: tuple[dict[str, frozenset[str]], ...] = (*PLAIN, {}, {})


def _forbidden(name: str, level: str, other: str, there: str) -> bool:
    """What is refused: pairs with noise, faults only ours have. What is not here: turbulence about a derived
    aircraft; what begins inside a frame, unless abrupt."""
    if (name, level) == ("course", "growing"):
        return there not in {"fault": FAULTS.keys() - AT_ONCE, "substeps": ("1",)}.get(other, (there,))
    if (name, level) == ("pairs", "true"):
        return there not in {"declared sensors": ("ideal",), "aircraft": ("beaver",)}.get(other, (there,))
    if (name, level) == ("fault_class", "all"):
        return other == "scheme" and there != "adaptive-estimators"
    if (name, level) == ("aircraft", "jsbsim:c172p"):
        return (other == "turbulence" and there != "none") or there in ("outside", "errs")
    return False


def scenarios(seed: int, kind: int) -> Iterator[Document]:
    """One covering array after the other, without end: 0 of all flights, 1 of those that the class of all
    types decides, 2 of the statistical detector in turbulence, or in air that is calmer than declared, 3 of
    its parity directions."""
    arrays, kept = 0, ({}, OF_ALL_TYPES, IN_GUSTS, PARITY)[kind]
    factors = [replace(one, levels=kept.get(one.name, one.levels)) for one in FACTORS]
    needs = DETECTOR_NEEDS[kind]
    factors = [replace(one, needs=needs) if one.name == "detector" else one for one in factors]
    while True:
        rng = np.random.default_rng([seed, arrays])
        for number, row in enumerate(CoveringArray(factors, _forbidden, rng).rows()):
            yield document_of(row, rng, f"compared-{seed}-{arrays}-{number}")
        arrays += 1


def document_of(row: dict[str, str], rng: np.random.Generator, name: str) -> Document:
    """A scenario of a row."""
    rate_hz, duration_s = RATES[row["rate"]]
    bounds = {key: value for section in BOUNDS for key, value in SECTIONS[section][row[section]].items()}
    bounds |= {"sensors": SENSORS[row["declared sensors"]], "turbulence": row["turbulence"]}
    fdi = {
        **SCHEMES[row["scheme"]], "fault_class": row["fault_class"], "fault_profile": row["fault_profile"],
        "bounds": bounds, **SECTIONS["poles"][row["poles"]],
    }  # fmt: skip
    if row["scheme"] == "adaptive-estimators":
        fdi |= {"sensor_monitor": "never", "pairs": row.get("pairs") == "true"}
        fdi |= DETECTORS[row.get("detector", "worst case")] | SLOWEST[row.get("slowest", "default")]
        fdi |= {"thresholds": row["thresholds"], **SECTIONS["sharpen"][row["sharpen"]]}
    moving = row["turbulence"] != "none" and row["truth"] != "calm"
    return {
        "name": name, "aircraft": row["aircraft"], "rate_hz": rate_hz, "duration_s": duration_s,
        "substeps": int(row["substeps"]), "seed": int(rng.integers(1000)),
        "initial": {"altitude_m": float(row["altitude"])},
        "reference": REFERENCES[row["reference"]], "control": LAW | {"law": row["law"]},
        "sensors": SENSORS[row["declared sensors"]] if row["true sensors"] == "as declared" else "ideal",
        "actuators": _actuators(row), "design_model": SECTIONS["design"][row["design"]], "fdi": fdi,
        "environment": {"turbulence": "dryden", "severity": row["turbulence"]} if moving else {},
        "uncertainty": TRUTHS[row["truth"]], "faults": _faults(row, rng, duration_s),
    }  # fmt: skip


def _actuators(row: dict[str, str]) -> Any:
    given = SECTIONS["actuators"][row["actuators"]]
    if not given or row["actuators"] == "one":
        return given or "ideal"
    return dict.fromkeys(SURFACES[row["aircraft"]], given)


def _faults(row: dict[str, str], rng: np.random.Generator, duration_s: float) -> list[Document]:
    if row["fault"] == "none":
        return []
    at_s = float(rng.uniform(0.2, 0.6) * duration_s)
    fault = {**FAULTS[row["fault"]], "at_s": at_s}
    if "surface" in row:
        surfaces = SURFACES[row["aircraft"]]
        fault["actuator"] = surfaces[
            ("first", "second", "third").index(row["surface"]) if row["surface"] != "last" else -1
        ]
    if row["course"] == "ended":
        fault["end_s"] = at_s + 0.2 * duration_s
    if row["course"] == "growing":
        fault |= {"profile": "incipient", "kappa_per_s": 3.0}
    if row.get("second", "none") == "none":
        return [fault]
    other = surfaces[(surfaces.index(fault["actuator"]) + 2) % 4]  # of the same plane
    later = {"actuator": other, "at_s": at_s + 0.3 * duration_s}
    return [fault, SECOND[row["second"]] | later]


SURFACES = {
    "beaver": ("aileron", "elevator", "rudder", "flap"),
    "beaver-split": ("aileron_left", "aileron_right", "elevator", "rudder", "flap_left", "flap_right"),
    "jsbsim:c172p": ("aileron", "elevator", "rudder"),
}
