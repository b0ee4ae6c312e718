"""What is declared of the design model: corners, random inertias, and the poles by brute force."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc.aircraft import load
from beaver_ftc.design.model import design_record, inertia_coefficients
from beaver_ftc.diagnosis import bounds as bound_kernels
from beaver_ftc.diagnosis.bounds import bound_dtype, errors_dtype
from beaver_ftc.scenario.declared import Declared, SensorErrors
from beaver_ftc.scenario.schema import load as scenario
from beaver_ftc.scenario.sensors import SIGNALS
from flying import declared_in
from telling import not_zero

AIRCRAFT = load()


def coefficients(mass):
    return np.array(inertia_coefficients(mass))


def test_no_inertia_within_its_tolerance_changes_a_coefficient_by_more():
    rng, nominal = np.random.default_rng(1), coefficients(AIRCRAFT.mass)
    names = bound_kernels._INERTIA_NAMES
    slack = bound_kernels.inertia_bounds(0.1, AIRCRAFT.mass)
    largest = np.zeros(12)
    for k in range(400):
        share = rng.uniform(-0.1, 0.1, 4) if k % 2 else 0.1 * rng.choice([-1.0, 1.0], 4)
        changed = {
            name: getattr(AIRCRAFT.mass, name) * (1.0 + part) for name, part in zip(names, share, strict=True)
        }
        apart = np.abs(coefficients(replace(AIRCRAFT.mass, **changed)) - nominal)
        assert (apart <= slack * (1.0 + 1e-12)).all()
        largest = np.maximum(largest, apart)
    assert largest == pytest.approx(slack)  # at one of the sixteen corners
    assert not bound_kernels.inertia_bounds(0.0, AIRCRAFT.mass).any()
    with pytest.raises(ValueError, match="read-only"):
        slack[0] = 0.0


def admit(**bounds):
    fdi = scenario({"name": "x", "fdi": {"bounds": bounds}}).fdi
    record = np.zeros(1, errors_dtype(4))[0]
    bound_kernels.fill_errors(record, declared_in(fdi.bounds, AIRCRAFT), design_record()[0], AIRCRAFT.mass)
    return record


def test_a_reading_is_off_by_four_sigma_its_bias_and_half_a_step():
    sensors = {
        "q": {"noise_std_deg_s": 0.02, "bias_deg_s": -0.1, "quantum_deg_s": 0.04},
        "V": {"scale_error": -0.01},
    }
    record = admit(sensors=sensors)
    names = list(SIGNALS)
    q, V = names.index("q"), names.index("V")
    assert record["e0"][q] == pytest.approx(np.radians(4.0 * 0.02 + 0.1 + 0.02))
    assert record["steady"] == pytest.approx([0.0, np.radians(0.1), 0.0])
    assert record["e1"][V] == pytest.approx(0.01)
    assert np.count_nonzero(record["e0"]) == np.count_nonzero(record["e1"]) == 1


@pytest.mark.parametrize("noise", [1e-4, 2e-3])
@pytest.mark.parametrize("eta_bar", [1e-3, 0.05])
def test_the_poles_find_the_smallest_fault_there_is_to_be_found(noise, eta_bar):
    """phi (1 - exp(-lam T)) / lam > eta_bar / lam + 2 nbar, by trying every pole."""
    nothing = scenario({"name": "x"}).sensors
    assert bound_kernels.poles_for_delays(SensorErrors(nothing), eta_bar) == ()
    sensors = scenario({"name": "x", "sensors": {"r": {"noise_std_deg_s": float(np.degrees(noise))}}}).sensors
    nbar = 4.0 * noise
    poles = np.geomspace(1e-3, 1e4, 200_001)
    found = bound_kernels.poles_for_delays(SensorErrors(sensors), eta_bar)
    assert len(found) == len(bound_kernels.POLE_DELAYS_S)
    for T, pole in zip(bound_kernels.POLE_DELAYS_S, found, strict=True):
        smallest = (eta_bar + 2.0 * nbar * poles) / (1.0 - np.exp(-poles * T))
        at_it = (eta_bar + 2.0 * nbar * pole) / (1.0 - np.exp(-pole * T))
        assert at_it == pytest.approx(smallest.min(), rel=1e-6)


def bound_of(fault_class="all", bounds=None, **keys):
    """{path: value} of what is set up of the bounds of a flight."""
    given = {"name": "x", "fdi": {"fault_class": fault_class, "bounds": bounds or {}}, **keys}
    flight, record = scenario(given), np.zeros(1, bound_dtype(4))[0]
    bound_kernels.configure_bound(record, Declared.of(flight), design_record()[0])
    return dict(not_zero(record))


@pytest.mark.parametrize(
    ("sensors", "off"),
    [({"alpha": {"bias_deg": 1.0}}, False), ({"altitude": {"bias_m": 1.0}}, False),
     ({"V": {"bias_mps": 1.0}}, True), ({"qdyn": {"bias_pa": 1.0}}, True),
     ({"engine_rpm": {"bias_rpm": 1.0}}, True), ({"manifold_pressure": {"bias_inhg": 1.0}}, True)],
)  # fmt: skip
def test_dpt_is_off_where_something_is_that_it_is_worked_out_from(sensors, off):
    found = bound_of(bounds={"sensors": sensors})
    assert ("declared_errors.engine" in found) is off
    assert ("declared_errors.kw1" in found) is off
