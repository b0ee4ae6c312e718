"""A short flight with all that is declared at once."""

import pytest

from beaver_ftc.studies.mismatch import documents
from beaver_ftc.studies.mismatch.split import UNEXPLAINED, split_flight
from flying import loss, scenario

FAULTS = [
    {"type": "bias", "actuator": "elevator", "bias_deg": 1, "at_s": 0.4, "end_s": 0.8},
    {"type": "stuck", "actuator": "elevator", "at_s": 1.0, "end_s": 1.3},
    loss(magnitude=0.3, at_s=0.6, profile="incipient", kappa_per_s=2.0), loss(magnitude=0.2, at_s=1.2),
    {"type": "float", "actuator": "rudder", "at_s": 0.9}, loss("rudder", 0.5, 0.5),
    {"type": "unanticipated", "Cm_alpha3": 5, "at_s": 0.7, "profile": "incipient", "kappa_per_s": 1},
]  # fmt: skip


@pytest.fixture(scope="module")
def case():
    return scenario(
        duration_s=1.6, rate_hz=50, substeps=2, faults=FAULTS, seed=3, sensors="tactical-grade",
        actuators={"bandwidth_rad_s": 20.0, "rate_limit_deg_s": 40.0, "elevator": {"travel_deg": [-8, 6]}},
        control={"law": "nominal"},
        uncertainty={
            "inertia_coupling": {"p": 0.2, "q": -0.2, "r": 0.1},
            "coefficients": {"Cm_alpha": 1.1, "Cl_p": 0.8},
            "sinusoid": {"r": {"amplitude_rad_s2": 0.02, "frequency_rad_s": 9}},
        },
        design_model={
            "engine_terms": False, "mass": 1.1, "inertia": {"Jxz": 2.0}, "frozen_alpha": True,
            "coefficients": {"Cn_r": 0.9, "Cm_dpt": 0.8},
        },
    )  # fmt: skip


def test_what_each_source_adds(case, changed):
    """But for what rounding leaves, which is no number to hold."""
    document = documents.document(case, *split_flight(case))
    assert 0.0 < document.pop("closure") < 1e-9
    assert all(axis.pop(UNEXPLAINED)["max"] < 1e-9 for axis in document["axes"].values())
    assert not changed(document)
