"""What is known of a stranger's aircraft before it is flown: units, and the speed it is sampled about."""

from math import sqrt
from pathlib import Path

import pytest

from beaver_ftc.plant import instrumented
from beaver_ftc_aircraft.derive import outline

# Square feet, slugs and feet, as JSBSim says it.
PROPERTIES = {
    "metrics/Sw-sqft": 174.0, "metrics/bw-ft": 35.8, "metrics/cbarw-ft": 4.9, "inertia/mass-slugs": 70.0,
    "inertia/ixx-slugs_ft2": 948.0, "inertia/iyy-slugs_ft2": 1346.0, "inertia/izz-slugs_ft2": 1967.0,
    "inertia/ixz-slugs_ft2": 50.0,
}  # fmt: skip
TRAVEL = {"aileron": (-0.3, 0.3), "elevator": (-0.5, 0.4), "rudder": (-0.28, 0.28)}


@pytest.fixture
def found(monkeypatch):
    monkeypatch.setattr(outline, "bare", lambda model: PROPERTIES)
    return outline.outline("c172x", Path("c172x.xml"), TRAVEL, lift=0.5)


def test_mass_and_geometry_are_in_si(found):
    """1 slug is 14.5939 kg, 1 foot 0.3048 m; JSBSim's Ixz enters with the other sign."""
    mass = [70.0 * 14.5939, *(14.5939 * 0.3048**2 * of for of in (948.0, 1346.0, 1967.0, -50.0))]
    assert list(found["mass"].values()) == pytest.approx(mass, rel=1e-5)
    assert list(found["mass"]) == ["mass_kg", "Ix_kgm2", "Iy_kgm2", "Iz_kgm2", "Jxz_kgm2"]
    assert found["geometry"] == pytest.approx(
        {"wing_area_m2": 16.16513, "span_m": 10.91184, "chord_m": 1.49352}, rel=1e-6
    )


def test_the_envelope_is_built_about_level_flight_at_this_lift(found):
    """L = W at 1500 m, where the standard atmosphere weighs 1.058 kg/m3; a fifth less to a quarter more."""
    speed_mps = sqrt(2 * 1021.573 * 9.81 / (1.058 * 16.16513 * 0.5))
    assert found["envelope"]["airspeed_mps"] == pytest.approx([0.8 * speed_mps, 1.25 * speed_mps], rel=1e-5)
    assert found["envelope"]["alpha_deg"] == [-5, 15]
    assert found["start"] == {"altitude_m": 1500.0}


def test_engines_whose_moment_does_not_last_are_run_up(tmp_path):
    """JSBSim's steady state of the C-130's propellers rolls it, and is gone after a frame."""
    travel = dict.fromkeys(("aileron", "elevator", "rudder"), (-0.3, 0.3))
    model = instrumented.instrument(instrumented.source_of("C130"), tmp_path / "copy", travel)
    data = outline.outline("C130", model, travel, 0.45)
    (note,) = outline.choose_start(data, model.parent)
    assert "its engines do not carry it" in note
    assert data["engine"]["start"] == "run_up"
