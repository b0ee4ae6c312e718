"""The setting of [Zhang2005], and our choices for all that the paper leaves open, each with its reason."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from beaver_ftc.documents.document import parse
from beaver_ftc.documents.dotted import parse_key, with_values
from beaver_ftc.documents.files import Document
from beaver_ftc.plugins import DETECTORS, LAWS, options_of
from beaver_ftc.scenario.schema import Scenario

FAULT_AT_S = 12.0  # begin of the fault in each published case with a fault; cases.yaml repeats it
AMPLITUDE_DEG_S = 3.0  # of the reference of each body rate, a sine
ABLATION = "ablation"  # `origin` of an option that removes a part of the scheme

# Given in section VII: the sinusoids of eta, the bound on the uncertainty, scheme and law.
GIVEN: Mapping[str, Any] = {
    "uncertainty.sinusoid.p": {"amplitude_rad_s2": 0.02, "frequency_rad_s": 10},
    "uncertainty.sinusoid.q": {"amplitude_rad_s2": 0.02, "frequency_rad_s": 15},
    "uncertainty.sinusoid.r": {"amplitude_rad_s2": 0.02, "frequency_rad_s": 10},
    "fdi.bounds.inertia_coupling": {"p": 0.25, "q": 0.25, "r": 0.25},
    "fdi.bounds.constant_rad_s2": {"p": 0.02, "q": 0.02, "r": 0.02},
    "fdi.scheme": "zhang2005",
    "control.law": "zhang2005",
}


@dataclass(frozen=True)
class Choice:
    """A key of the scenario that the paper leaves open, our value, and the reason."""

    key: str
    value: Any
    reason: str


def _sine(frequency_hz: float) -> list[Document]:
    return [{"sine": {"amplitude_deg_s": AMPLITUDE_DEG_S, "frequency_hz": frequency_hz}}]


CHOICES = (
    Choice("initial.airspeed_mps", 45.0, "10 m/s or more from the ends of the validated 30 to 55 m/s"),
    Choice("initial.altitude_m", 1828.8, "6000 ft, a usual cruising altitude of a Beaver"),
    Choice("initial.engine_rpm", 1800.0, "the engine setting of the FDC trim examples"),
    Choice("initial.manifold_pressure_inhg", 20.0, "the engine setting of the FDC trim examples"),
    Choice("initial.flap_deg", 0.0, "the flap is free to take over from the elevator"),
    Choice("duration_s", 30.0, "the fault lasts more than three periods of the pitch reference"),
    Choice("rate_hz", 100.0, "ten frames in the time constant of an estimator, 0.1 s"),
    Choice("reference.p", _sine(0.25), "flights with the published faults and law stay inside the envelope"),
    Choice("reference.q", _sine(0.2), "the elevator moves, and the 30 s of a figure show six periods"),
    Choice("reference.r", _sine(0.15), "a period of its own, so that the axes are not in step"),
    Choice(
        "uncertainty.inertia_coupling",
        {"p": 0.25, "q": -0.25, "r": 0.25},
        "only the range is given: these are corners of it",
    ),
    Choice(
        "fdi.detection_pole_per_s",
        10.0,
        "a time constant of 0.1 s, short beside the references' periods",
    ),
    Choice("fdi.isolation_pole_per_s", 10.0, "that of the detection estimator"),
    Choice("control.proportional_per_s", 2.0, "error poles at -1 1/s, fast beside the 18 s after the fault"),
    Choice("control.integral_per_s2", 1.0, "Kp^2/4: the two error poles are real and equal"),
    Choice(
        "control.reference_natural_frequency_rad_s", 10.0, "faster than the loop, slower than the frame rate"
    ),
    Choice("control.reference_damping", 1.0, "no overshoot"),
    Choice("control.hand_over_s", 1.0, "continuous, and short beside the periods of the references"),
)


# The option that is no gain, because its default is 0, but that the paper leaves open.
OPTIONS = (
    Choice(
        "fdi.options.initial_theta",
        0.0,
        "theta(Td) of the isolation estimators: a healthy surface. From -0.5, the centre of the set, no "
        "known fault is named for the unanticipated one",
    ),
)


class Gain(NamedTuple):
    """A number to choose in the published scheme or law. key: of the scenario. says: its meaning. origin: how
    it was chosen."""

    key: str
    name: str
    default: float
    says: str
    origin: str


def gains() -> list[Gain]:
    """The gains: the options of scheme and law, without those that remove a part and those with the default
    0."""
    tables = (
        ("fdi.options", options_of(DETECTORS, GIVEN["fdi.scheme"])),
        ("control.options", options_of(LAWS, GIVEN["control.law"])),
    )
    return [
        Gain(f"{section}.{name}", name, row["default"], row["says"], row["origin"])
        for section, rows in tables
        for name, row in rows.items()
        if row["origin"] != ABLATION and row["default"]
    ]


def _with_keys(document: Document, values: Mapping[str, Any]) -> Document:
    """A document with other values, by dotted key."""
    return with_values(document, {parse_key(key): value for key, value in values.items()})


# GIVEN and CHOICES together, as the sections of a scenario.
SETTING = _with_keys({}, {**GIVEN, **{choice.key: choice.value for choice in CHOICES}})


def scenario(name: str, changes: Mapping[str, Any]) -> Scenario:
    """The scenario of the published setting with our choices. changes: values by dotted key."""
    return Scenario.model_validate(_with_keys({"name": name, **SETTING}, changes))


def data_of(name: str) -> Document:
    """The content of a YAML file of this folder."""
    return parse(Path(__file__).with_name(name).read_text(encoding="utf-8")).data
