"""What is declared of the design model: corners, random inertias, and the poles by brute force."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.aircraft import load
from beaver_ftc.design.model import design_record, inertia_coefficients
from beaver_ftc.diagnosis import bounds as bound_kernels
from beaver_ftc.diagnosis import state
from beaver_ftc.diagnosis.bounds import bound_dtype, errors_dtype
from beaver_ftc.diagnosis.state import LOSS, POSITION_HYPOTHESIS
from beaver_ftc.documents.errors import BadInput
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


def test_every_declared_bound_stands_in_the_record():
    record = admit(inertia=0.05, deflection_deg=0.5, coefficients={"Cm_alpha": 0.2}, sensors="ideal")
    assert record["dI"] == pytest.approx(bound_kernels.inertia_bounds(0.05, AIRCRAFT.mass))
    assert record["du"] == pytest.approx(np.radians(0.5))
    (index,) = [i for i, term in enumerate(AIRCRAFT.moments) if term.name == "Cm_alpha"]
    assert record["dC"][index] == pytest.approx(0.2 * abs(AIRCRAFT.moments[index].value))
    assert np.count_nonzero(record["dC"]) == 1
    assert record["given"]
    assert not record["e0"].any()
    everything = admit(coefficients=0.1)
    values = np.array([term.value for term in AIRCRAFT.moments])
    assert everything["dC"][: values.size] == pytest.approx(0.1 * np.abs(values))


@pytest.mark.parametrize(
    "bounds",
    [
        {"inertia": 0.1},
        {"deflection_deg": 1.0},
        {"coefficients": 0.1},
        {"turbulence": "light"},
        {"sensors": "consumer-grade"},
    ],
)
def test_any_bound_at_all_is_noted(bounds):
    assert admit(**bounds)["given"]
    assert not admit()["given"]


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


def test_a_gyros_error_varies_by_noise_steps_or_scale():
    def varies(**errors):
        return scenario({"name": "x", "sensors": {"q": errors}}).sensors.gyros_vary

    assert not varies(bias_deg_s=1.0)
    assert varies(noise_std_deg_s=0.1)
    assert varies(quantum_deg_s=0.1)
    assert varies(scale_error=0.01)


OF_ALL = {
    "p": {"noise_std_deg_s": 0.02, "bias_deg_s": 0.3}, "q": {"quantum_deg_s": 0.04, "scale_error": 0.01},
    "r": {"bias_deg_s": -0.2, "scale_error": -0.03}, "alpha": {"noise_std_deg": 0.1, "scale_error": 0.015},
    "beta": {"bias_deg": 0.25}, "V": {"quantum_mps": 0.4, "scale_error": -0.02},
    "qdyn": {"noise_std_pa": 3.0, "bias_pa": 7.0}, "altitude": {"bias_m": -6.0, "scale_error": 0.004},
}  # fmt: skip
OF_THE_ENGINE = {"engine_rpm": {"bias_rpm": 9.0, "scale_error": -0.01}, "manifold_pressure":
                 {"noise_std_inhg": 0.05, "scale_error": 0.02}}  # fmt: skip
OTHERS = {
    "inertia": 0.05, "deflection_deg": 0.5, "coefficients": {"Cm_alpha": 0.2, "Cn_dr": 0.1},
    "turbulence": "severe", "inertia_coupling": {"p": 0.1, "q": 0.2, "r": 0.3},
    "constant_rad_s2": {"p": 0.01, "q": 0.02, "r": 0.04},
}  # fmt: skip


def bound_of(fault_class="all", bounds=None, **keys):
    """{path: value} of what is set up of the bounds of a flight."""
    given = {"name": "x", "fdi": {"fault_class": fault_class, "bounds": bounds or {}}, **keys}
    flight, record = scenario(given), np.zeros(1, bound_dtype(4))[0]
    bound_kernels.configure_bound(record, Declared.of(flight), design_record()[0])
    return dict(not_zero(record))


@pytest.mark.parametrize(("fault_class", "engine"), [("all", True), ("published", True), ("all", False)])
def test_all_that_is_declared_is_in_the_record_of_the_bounds_and_no_more(fault_class, engine):
    """4 sigma, bias and half a step of each reading; 6 sigma of the air's rotation; and of the engine's power
    what both of its readings are off at the highest pressure there is."""
    deg, sigma = np.pi / 180.0, 23.6 * 0.3048
    span = AIRCRAFT.geometry.span_m
    found = bound_of(
        fault_class, OTHERS | {"sensors": OF_ALL | (OF_THE_ENGINE if engine else {})},
        initial={"engine_rpm": 2050.0, "manifold_pressure_inhg": 21.0},
    )  # fmt: skip
    terms = [term.name for term in AIRCRAFT.moments]
    tolerance = np.zeros_like(found["declared_errors.dC"])
    for name, share in OTHERS["coefficients"].items():
        tolerance[terms.index(name)] = share * abs(AIRCRAFT.terms[name].value)
    aloft = 6.0 * 1.9 * sigma / np.sqrt(1750.0 * 0.3048 * span)
    most = AIRCRAFT.engine.settings["manifold_pressure_inhg"].range[1]
    # V and qdyn have errors: dpt is off for them, even with an engine whose instruments are exact
    rpm, inhg = ((9.0 + 0.01 * 2050.0) / 0.99, (0.2 + 0.02 * most) / 0.98) if engine else (0.0, 0.0)
    # 0.7355 (0.00412 (pz + 7.4) (n + 2010) + 0.0965 n ...) [FDC], its slopes at the largest readings
    by_chart = 0.00412 * ((most + 7.4 + inhg) * rpm + (2050.0 + rpm + 2010.0) * inhg)
    by_instruments = 0.7355 * (by_chart + 0.0965 * rpm)
    expected = {
        "inertia_coupling_error_share": [0.1, 0.2, 0.3], "const": [0.01, 0.02, 0.04],
        "earth_rate_rad_s": 7.292115e-5, "declared_errors.given": 1,
        "declared_errors.dC": tolerance,
        "declared_errors.dI": bound_kernels.inertia_bounds(
            0.05, AIRCRAFT.mass
        ),
        "declared_errors.du": 0.5 * deg,
        "declared_errors.e0": [
            0.38 * deg, 0.02 * deg, 0.2 * deg, 0.4 * deg, 0.25 * deg, 0.2, 19.0,
        ],
        "declared_errors.e1": [0.0, 0.01, 0.03, 0.015, 0.0, 0.02, 0.0],
        "declared_errors.steady": [0.3 * deg, 0.0, 0.2 * deg],
        "declared_errors.h0": 6.0,
        "declared_errors.h1": 0.004,
        "declared_errors.wg_aloft": aloft, "declared_errors.wg": [aloft] * 3,
        "declared_errors.wg_1m": 6.0 * 1.9 * 7.6 * 0.3048 / np.sqrt(span),
        "declared_errors.engine": 1,
        "declared_errors.kw0": by_instruments,
        "declared_errors.kw1": 0.7355 * (408.0 - 0.0965 * (2050.0 - rpm)),
        "has_eG": 1,
    }  # fmt: skip
    if fault_class == "published":
        del expected["has_eG"]
    if not engine:
        del expected["declared_errors.kw0"]
    assert set(found) == set(expected)
    for path, value in expected.items():
        assert found[path] == pytest.approx(np.array(value), rel=1e-6, abs=1e-12), path


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


def test_without_any_error_nothing_is_set_up_but_the_published_bound_and_the_earth():
    found = bound_of(bounds={"inertia_coupling": {"p": 0.0, "q": 0.2, "r": 0.0}})
    assert set(found) == {"inertia_coupling_error_share", "const", "earth_rate_rad_s"}
    assert found["inertia_coupling_error_share"].tolist() == [0.0, 0.2, 0.0]


def test_surfaces_are_laid_out_by_axis_partner_and_estimator():
    """Of five surfaces in no order: a group of two are partners, of three none is; -1 where there is none."""
    aircraft = SimpleNamespace(
        name="odd", surfaces=("a", "b", "c", "d", "e"), dominant_axis=(2, 1, 0, 1, 1),
        primary=("c", "a", "d"), groups={"lateral": ("c", "a"), "pitch": ("b", "d", "e")},
    )  # fmt: skip
    layout = np.zeros(1, state.layout_dtype(5))[0]
    entries = [("c", LOSS, 2), ("d", LOSS, 3), ("e_position", POSITION_HYPOTHESIS, 4)]
    state.configure_layout(layout, entries, aircraft)
    found = {name: layout[name].tolist() for name in layout.dtype.names}
    assert found == {
        "main": [2, 3, 0], "dominant_axis": [2, 1, 0, 1, 1], "group": [
            state.LATERAL_GROUP, state.PITCH_GROUP, state.LATERAL_GROUP,
            state.PITCH_GROUP, state.PITCH_GROUP,
        ],
        "partner": [2, -1, 0, -1, -1], "loss": [-1, -1, 0, 1, -1],
        "position": [-1, -1, -1, -1, 2],
    }  # fmt: skip
    for primary, missing in ((("a", "d"), "roll"), (("c", "a"), "pitch"), (("c", "d"), "yaw")):
        without = SimpleNamespace(**{**vars(aircraft), "primary": primary})
        with pytest.raises(BadInput) as refused:
            state.configure_layout(layout, entries, without)
        allowed = "in `moments`, a term of some surface about each axis"
        says = f"odd: no surface turns it in {missing}, allowed: {allowed}"
        assert str(refused.value) == says
