"""Relations between flights, and between diagnoses of one flight, that need no expected value.

- A mirrored aircraft with mirrored readings has the same alarms, exclusions and names.
- In another unit of mass the conclusions are the same.
- A larger declared bound raises no alarm and removes no candidate.
- A fault of no size is no fault, and faults that begin together may stand in any order.
- A fault and a manoeuvre that come later are found later by as much.
"""

import shutil

import numpy as np
import pytest
import yaml

import beaver_ftc as bf
from beaver_ftc.aircraft import load
from beaver_ftc.documents.files import data_root
from flying import SINES, loss, same_log, scenario
from streamed import Flown

NOISY = {axis: {"noise_std_deg_s": 0.05} for axis in "pqr"}
ALL = {"fault_class": "all", "sensor_monitor": "never"}
FLOWN = {
    "elevator": {"faults": [loss(at_s=1.0)]},
    "aileron": {"faults": [loss("aileron", 0.7, 1.0)], "fdi": ALL},
    "rudder": {"faults": [loss("rudder", 0.7, 1.0)], "fdi": ALL | {"pairs": True}},
    "noisy": {
        "faults": [loss("rudder", 0.8, 1.0)],
        "sensors": NOISY,
        "environment": {"turbulence": "dryden", "severity": "light"},
        "fdi": {"bounds": {"sensors": NOISY, "turbulence": "light"}, "statistical": {}},
    },
}  # fmt: skip


@pytest.fixture(scope="module", params=FLOWN)
def flown(request):
    flown = Flown(**FLOWN[request.param])
    flown.verdicts = conclusions(flown.diagnosis(), flown.samples)
    return flown


def conclusions(diagnosis, samples):
    return [diagnosis.step(*sample) for sample in samples]


def altered(folder, change):
    """The Beaver with its file changed."""
    shutil.copytree(data_root() / "aircraft" / "beaver", folder / "it")
    file = folder / "it" / "aircraft.yaml"
    words = yaml.safe_load(file.read_text())
    change(words)
    file.write_text(yaml.safe_dump(words, sort_keys=False))
    return load("./it", folder)


# What changes its sign in a mirror: coefficients, what they are multiplied with, surfaces.
LATERAL, ODD, LEVERS = {"Cl", "Cn", "CY"}, {"beta", "ph", "rh", "betadoth"}, {"aileron", "rudder"}
SIGNS = [[-1, 1, -1], [1, -1, 1, 1, 1], [-1, 1, -1, 1], [-1, 1, -1]]  # of rates, signals, surfaces, angles


def mirror(words):
    for coefficient, terms in (words["moments"] | words["forces"]).items():
        for term in terms:
            powers = sum(power for name, power in term["of"].items() if name in ODD)
            term["value"] *= (-1) ** (powers + (coefficient in LATERAL) + (term.get("surface") in LEVERS))


def times(factors, values):
    return [np.multiply(factor, value) for factor, value in zip(factors, values, strict=True)]


def test_in_a_mirror_the_conclusions_are_the_same(flown, tmp_path):
    diagnosis = flown.diagnosis(altered(tmp_path, mirror), times(SIGNS[:3], flown.start))
    said = conclusions(diagnosis, [times(SIGNS, sample) for sample in flown.samples])
    assert said == flown.verdicts
    assert said[-1].detected


def quadruple(words):
    words["mass"] = {name: 4 * value for name, value in words["mass"].items()}


def test_another_unit_of_mass_changes_no_conclusion(flown, tmp_path):
    factors = [1, [1, 1, 1, 4, 1], 1, 1]  # the dynamic pressure has the unit of mass
    diagnosis = flown.diagnosis(altered(tmp_path, quadruple), times(factors[:3], flown.start))
    assert conclusions(diagnosis, [times(factors, sample) for sample in flown.samples]) == flown.verdicts


@pytest.mark.parametrize(
    "larger", [{"inertia": 0.1}, {"coefficients": 0.05}, {"actuators.bandwidth": 0.3}], ids=str
)
def test_a_larger_bound_raises_no_alarm_and_removes_no_candidate(flown, larger):
    larger = {f"fdi.bounds.{name}": value for name, value in larger.items()}
    said = conclusions(flown.diagnosis(larger=larger), flown.samples)
    for wider, narrower in zip(said, flown.verdicts, strict=True):
        assert narrower.detected or not wider.detected
        assert not wider.detected or candidates(narrower) <= candidates(wider)


def candidates(verdict):
    """As SURFACE:TYPE, also where the surface is known."""
    return {name if ":" in name else f"{verdict.isolated}:{name}" for name in verdict.candidates}


NOTHING = (
    {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 1e-300},
    {"actuator": "rudder", "type": "bias", "bias_deg": 1e-300},
    {"type": "unanticipated", "Cm_alpha3": 1e-300},
    {"sensor": "q", "type": "bias", "magnitude": 1e-300},
)  # fmt: skip


@pytest.mark.parametrize("before", [[], [loss(at_s=0.5)]], ids=len)
@pytest.mark.parametrize("fault", NOTHING, ids=str)
def test_a_fault_of_no_size_is_none(fault, before):
    base = {"name": "x", "duration_s": 2.0, "reference": SINES}
    faults = before, [*before, fault | {"at_s": 1.0}]
    without, broken = (bf.fly(base | {"faults": each}).log for each in faults)
    assert same_log(without, broken[without.columns])


def test_faults_that_begin_together_may_stand_in_any_order():
    faults = [loss(at_s=1.0), {"type": "stuck", "actuator": "rudder", "at_s": 1.0}, loss("aileron", 0.5, 1.0)]
    one, other = (bf.fly(scenario(duration_s=3.0, faults=order)).log for order in (faults, faults[::-1]))
    assert same_log(one, other)


def test_what_comes_later_is_found_later_by_as_much():
    """In trim, until the manoeuvre."""
    found = []
    for later in (0.0, 1.7):
        turn = [{"step": {"amplitude_deg_s": 3.0, "start_s": 0.5 + later, "end_s": 3.0 + later}}]
        faults = [loss("aileron", 0.6, 1.0 + later)]
        flight = bf.fly({"name": "x", "duration_s": 6.0, "reference": {"p": turn}, "faults": faults})
        found.append((flight.detection.delay_s, flight.isolation.isolated))
    assert found[0] == pytest.approx(found[1])
