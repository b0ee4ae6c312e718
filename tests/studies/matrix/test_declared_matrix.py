"""The fault matrix with real sensors, servos and wrong coefficients, all declared; and random faults so."""

import numpy as np
import pytest
from test_random_faults import drawn

from beaver_ftc.aircraft import load
from beaver_ftc.loop.loop import fly
from beaver_ftc.results.metrics import measure
from beaver_ftc.studies.engine.study import run_study
from beaver_ftc.studies.matrix.fault_matrix import declared_errors, matrix_study, verdict
from flying import scenario
from samples import samples

NAMES = [term.name for term in load().moments]
FLIGHTS = samples(200)


@pytest.fixture(scope="module")
def matrix(tmp_path_factory):
    return run_study(matrix_study((45.0,), declared=True), tmp_path_factory.mktemp("matrix"))


def test_no_false_alarm_no_wrong_surface_no_wrong_type(matrix):
    assert matrix["false_alarms"] == 0
    assert [row for row in matrix["flights"] if row["verdict"] == "WRONG"] == []


def test_ailerons_and_rudder_are_still_named(matrix):
    for row in matrix["flights"]:
        if row["surface"] in ("aileron", "rudder") and row["fault"] in (
            "total loss",
            "stuck +3 deg",
            "float",
        ):
            assert row["isolated"] == row["surface"], row


def random_flight(rng, faulty):
    at_s = 4 + rng.integers(0, 600) / 100
    wrong = {name: 1 + 0.05 * rng.uniform(-1, 1) for name in NAMES}
    return scenario(
        **declared_errors()
        | {
            "duration_s": at_s + 14,
            "rate_hz": int(rng.choice([50, 100])),
            "substeps": int(rng.choice([1, 1, 3])),
            "seed": int(rng.integers(1_000_000)),
            "initial": {"airspeed_mps": rng.uniform(35, 52), "altitude_m": rng.uniform(0, 3000)},
            "uncertainty": {"coefficients": wrong},
            "faults": [drawn(rng, at_s)] if faulty else [],
        }
    )


def test_random_faults_are_not_named_wrongly():
    rng = np.random.default_rng(9)
    wrong = []
    named = 0
    for _ in range(FLIGHTS):
        flight = fly(random_flight(rng, faulty=True))
        fault = flight.scenario.faults[0]
        said = verdict(measure(flight), fault.actuator, fault.type)
        named += said in ("named", "surface")
        if said == "WRONG" or (said == "surface" and not flight.candidates):
            wrong.append((fault, flight.isolated, flight.isolation_type, flight.candidates))
    assert wrong == []
    assert named >= FLIGHTS / 3


def test_no_alarm_without_a_fault():
    rng = np.random.default_rng(10)
    assert [fly(random_flight(rng, faulty=False)).detection_time_s for _ in range(10)] == [None] * 10
