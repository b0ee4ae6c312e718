"""The test that is told the fault, in a flight of the matrix: what it is shown, and what becomes of it."""

import numpy as np
import pytest

from beaver_ftc.aircraft import load
from beaver_ftc.design.model import DesignFunctions, design_of, inertia_coefficients
from beaver_ftc.design.plain_model import inertial
from beaver_ftc.loop.loop import fly
from beaver_ftc.results.log import Columns
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.matrix.cells import informed_counts
from beaver_ftc.studies.matrix.fault_matrix import FaultCase, scenario_of, trimmed_deg
from beaver_ftc.studies.matrix.informed import columns_of, informed_row, term_acceleration
from telling import apart

AIRCRAFT = load()


def flown(fault, surface, turbulence="none"):
    scenario = scenario_of(
        FaultCase(fault, surface, 45.0, True, turbulence=turbulence), "nominal", trimmed_deg(45.0, surface)
    )
    kept = columns_of(scenario.airframe)
    fly(scenario, kept)
    return scenario, kept


@pytest.fixture(scope="module")
def lost():
    return flown("40 % loss", "elevator")


def test_terms_add_up_to_what_the_design_model_makes_of_a_surface_and_of_none():
    rng = np.random.default_rng(2)
    n = 3
    kept = Columns()
    kept |= {name: rng.uniform(-0.2, 0.2, n) for name in ("p_rad_s", "q_rad_s", "r_rad_s", "dpt")}
    kept |= {"alpha_rad": rng.uniform(0, 0.2, n), "beta_rad": rng.uniform(-0.2, 0.2, n)}
    kept |= {"airspeed_mps": rng.uniform(35, 55, n), "qdyn_pa": rng.uniform(700, 1500, n)}
    model = DesignFunctions(design_of(Declared.of(Scenario(name="any"))))
    deflection = rng.uniform(-0.2, 0.2, n)
    apart(deflection=deflection, **kept)
    x = np.column_stack([kept[f"{axis}_rad_s"] for axis in "pqr"])
    y = np.column_stack([kept[name] for name in ("alpha_rad", "beta_rad", "airspeed_mps", "qdyn_pa", "dpt")])
    found = sum(
        t.value * term_acceleration(AIRCRAFT, t, kept, None) for t in AIRCRAFT.moments if not t.surface
    )
    turning = inertial(inertia_coefficients(AIRCRAFT.mass), x)
    expected = [model.f(*each) for each in zip(x, y, strict=True)]
    assert found + turning == pytest.approx(np.array(expected), rel=1e-9)
    for s, surface in enumerate(AIRCRAFT.surfaces):
        of_it = [term for term in AIRCRAFT.moments if term.surface == surface]
        found = sum(term.value * term_acceleration(AIRCRAFT, term, kept, deflection) for term in of_it)
        expected = [model.G(one)[:, s] * u for one, u in zip(y, deflection, strict=True)]
        assert found == pytest.approx(np.array(expected), rel=1e-9)


def test_a_loss_of_what_stands_at_neutral_is_seen_by_nobody(lost):
    scenario, kept = lost
    nothing = informed_row(*flown("total loss", "flap"), "flap")
    assert nothing["told_deflection"] < 1e-6
    assert nothing["told_chance"] < 1e-5
    assert informed_row(scenario, kept, "elevator")["told_chance"] > 0.99


def test_what_is_counted():
    def row(surface, chance, verdict):
        return {
            "surface": surface, "told_chance": chance, "verdict": verdict, "detected": verdict != "unseen"
        }  # fmt: skip

    found = informed_counts(
        [
            row("elevator", 0.9, "named"), row("elevator", 0.8, "surface"), row("elevator", 0.7, "unseen"),
            row("flap", 0.6, "open"), row("flap", 0.1, "open"), row("flap", 0.0, "unseen"),
            row("rudder", 1.0, "WRONG"),
        ]
    )  # fmt: skip
    assert (found["flights"], found["seen"], found["detected"], found["named"]) == (7, 5, 4, 2)
    assert (found["type_kept"], found["detected_but_not_told"]) == (3, 1)
    assert found["share"] == pytest.approx(0.4)
    assert found["by_surface"]["elevator"] == {"seen": 3, "named": 2}
    assert informed_counts([row("flap", 0.0, "unseen")])["share"] is None
