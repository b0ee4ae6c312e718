"""What the truth does and the diagnosis was not told is said, one line each."""

import pytest

from beaver_ftc.scenario.schema import Scenario, load_text
from given import given

GIVEN = given(__file__)

TOLD = """
fdi: {bounds: {sensors: tactical-grade, turbulence: light, coefficients: {Cm_alpha: 0.05}, inertia: 0.05}}
"""


def warnings(text):
    return load_text(f"name: x\n{text}").warnings()


@pytest.mark.parametrize(
    ("truth", "says"),
    [
        ("sensors: {q: {noise_std_deg_s: 0.1}}", "sensors.q: "),
        ("sensors: {alpha: {delay_s: 0.01}}", "sensors.alpha: "),
        ("sensors: {az: {bias_mps2: 0.05}}", "sensors.az: "),
        ("environment: {turbulence: dryden, severity: moderate}", "environment.severity: moderate"),
        ("uncertainty: {coefficients: {Cm_alpha: 1.06}}", "uncertainty.coefficients.Cm_alpha: 1.06"),
        ("uncertainty: {coefficients: {Cm_q: 1.01}}", "uncertainty.coefficients.Cm_q: 1.01"),
        ("uncertainty: {inertia: {Iy: 0.9}}", "uncertainty.inertia.Iy: 0.9"),
        ("uncertainty: {cg_m: [0.01, 0, 0]}", "uncertainty.cg_m: "),
    ],
)
def test_an_error_beyond_the_declared_is_said(truth, says):
    (line,) = warnings(f"{TOLD}{truth}\n")
    assert line.startswith(says)


@pytest.mark.parametrize(
    "truth",
    [
        "sensors: tactical-grade",
        "environment: {turbulence: dryden, severity: light}",
        "uncertainty: {coefficients: {Cm_alpha: 0.95, CX_0: 1.3}, inertia: {Ix: 1.05}, mass: 1.1}",
        "actuators: servo",
    ],
)
def test_an_error_within_the_declared_is_not(truth):
    assert warnings(f"{TOLD}{truth}\n") == ()


@pytest.mark.parametrize(("dead_band_deg", "surfaces"), [(0.45, 0), (0.55, 4)])
def test_a_dead_band_and_an_error_of_the_position_add_up(dead_band_deg, surfaces):
    told = "fdi: {bounds: {actuators: {dead_band_deg: 0.3}, deflection_deg: 0.2}}"
    truth = f"uncertainty: {{actuators: {{dead_band_deg: {dead_band_deg}}}}}"
    assert len(warnings(f"{told}\n{truth}\n")) == surfaces


SINUSOID = {"q": {"amplitude_rad_s2": 0.03, "frequency_rad_s": 20}}
GUST = {"at_s": 1, "velocity_mps": [0, 0, 5]}


@pytest.mark.parametrize(
    ("keys", "says"),
    GIVEN["all that is undeclared is said where there is a diagnosis"],
)
def test_all_that_is_undeclared_is_said_where_there_is_a_diagnosis(keys, says):
    said = Scenario.model_validate({"name": "x", **keys}).warnings()
    assert [line[: len(start)] for line, start in zip(said, says, strict=True)] == says
    silent = {**keys, "fdi": {**keys.get("fdi", {}), "scheme": "none"}}
    assert Scenario.model_validate({"name": "x", **silent}).warnings() == ()
