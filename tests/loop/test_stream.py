"""The diagnosis without the loop around it: the same verdicts to the bit, sample for sample."""

import subprocess
import sys
import tracemalloc

import numpy as np
import pytest

import beaver_ftc as bf
from flying import loss
from given import given
from streamed import Flown

GIVEN = given(__file__)

PAIR = [loss(at_s=1.0), {"type": "stuck", "actuator": "rudder", "position_deg": 3.0, "at_s": 2.0}]
NOISY = {"p": {"noise_std_deg_s": 0.06}, "q": {"noise_std_deg_s": 0.05}, "r": {"noise_std_deg_s": 0.04}}
CASES = GIVEN["cases"]


@pytest.fixture(scope="module", params=CASES)
def flown(request):
    return Flown(**CASES[request.param])


@pytest.fixture(scope="module")
def published():
    return Flown(**CASES["published"])


def test_the_verdicts_are_those_of_the_loop_to_the_bit(flown):
    diagnosis = flown.diagnosis()
    said = [diagnosis.step(*sample) for sample in flown.samples]
    assert said == flown.verdicts
    assert flown.verdicts[-1].detected


def test_nothing_grows(published):
    diagnosis = published.diagnosis()
    for sample in published.samples:
        diagnosis.step(*sample)
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        for _ in range(1500):
            diagnosis.step(*published.samples[-1])
        assert (
            tracemalloc.get_traced_memory()[0] - before < 5_000
        )  # what the words of the verdict follow from
    finally:
        tracemalloc.stop()


def test_jsbsim_is_not_even_imported():
    script = (
        "import sys, beaver_ftc as bf\n"
        "d = bf.Diagnosis(bf.aircraft('beaver'))\n"
        "d.step([0, 0, 0], [0.1, 0, 45, 1000, 1], [0, 0, 0, 0])\n"
        "sys.exit('jsbsim' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", script], check=True)


def test_what_is_no_sample_is_refused_and_not_taken(published):
    refused = {
        "rates_rad_s: .* allowed: 3 numbers": ([0, 0], [0.1, 0, 45, 1000, 1], [0] * 4),
        "signals: .* allowed: 5 numbers": ([0, 0, 0], [0.1, 0, 45, 1000], [0] * 4),
        "command_rad: .* allowed: 4 numbers": ([0, 0, 0], [0.1, 0, 45, 1000, 1], 0.0),
        "rates_rad_s: ": ([0, "q", 0], [0.1, 0, 45, 1000, 1], [0] * 4),
        "is not finite": ([0, np.nan, 0], [0.1, 0, 45, 1000, 1], [0] * 4),
    }
    diagnosis = published.diagnosis()
    for k, good in enumerate(published.samples):
        for says, sample in refused.items() if k in (0, 150) else ():
            with pytest.raises(bf.BadInput, match=says):
                diagnosis.step(*sample)
        assert diagnosis.step(*good) == published.verdicts[k]


def test_a_refused_sample_leaves_attitude_and_altitude(published):
    """Those of the sample before count again."""
    diagnosis, (first, second) = published.diagnosis(), published.samples[:2]
    diagnosis.step(*first, 1000.0)
    for attitude, altitude in (([np.nan] * 3, None), (None, np.nan)):
        with pytest.raises(bf.BadInput):
            diagnosis.step(*second[:3], attitude, altitude)
    diagnosis.step(*second[:3])
    measured = diagnosis.inside()[0]["measured"][0]
    assert measured["altitude"] == 1000.0
    assert np.array_equal(measured["attitude"], first[3])


def test_a_start_that_is_not_finite_or_lacks_an_array_is_refused():
    sample = [0, 0, 0], [0.1, 0, 45, 1000, 1], [0] * 4
    for start in (sample[:2], (*sample[:2], [np.nan] * 4)):
        with pytest.raises(bf.BadInput, match="start: "):
            bf.Diagnosis(bf.aircraft("beaver"), start=start).step(*sample)


def test_the_model_is_what_the_surfaces_are_expected_to_give():
    flown = Flown(**CASES["published"])
    diagnosis = flown.diagnosis()
    for sample in flown.samples[:50]:
        diagnosis.step(*sample)
    f, G = diagnosis.model()
    assert (f.shape, G.shape) == ((3,), (3, 4))
    kept = f.tolist(), G.tolist()
    diagnosis.step(*flown.samples[50])
    assert (f.tolist(), G.tolist()) == kept  # what was given stays as it was
    assert all((now != then).any() for now, then in zip(diagnosis.model(), (f, G), strict=True))
    model = bf.linearise(flown.scenario)
    assert G[1, 1] == pytest.approx(model.B[model.states.index("q"), 1], rel=0.05)
