"""Several JSBSim frames in a frame of the loop: exact means, and room for a fault that changed inside it."""

import numpy as np
import pytest
from design_plant import TRAVEL_RAD
from hypothesis import given
from hypothesis import strategies as st

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.detection.filters import (
    fault_range,
)
from beaver_ftc.diagnosis.model_prediction import (
    add_to_sums,
    begin_sums,
    fill_means,
)
from beaver_ftc.loop.assembly import configure_design
from beaver_ftc.scenario.schema import Scenario


@kernel
def first(frames):
    fdi = frames[0].fdi
    begin_sums(
        frames[0].prediction, fdi.bound, fdi.layout, fdi.config.diagnoses_all_types, frames[0].measured
    )


@kernel
def another(frames):
    fdi = frames[0].fdi
    add_to_sums(frames[0].prediction, fdi.bound, fdi.layout, fdi.config.diagnoses_all_types)


@kernel
def over(frames):
    fill_means(frames[0].prediction, frames[0].fdi.bound)


@kernel
def limits(frames, surface):
    fie = frames[0].fdi.isolation.estimator[surface]
    return fault_range(fie, 0), fault_range(fie, 3)


def record(substeps):
    return configure_design(Scenario(name="x", substeps=substeps), TRAVEL_RAD)


def fill(frame, rng):
    prediction = frame["prediction"]
    for name in ("f", "G", "u"):
        prediction[name] = rng.uniform(-1, 1, prediction[name].shape)
    frame["fdi"]["bound"]["eta_now"] = rng.uniform(0, 1, 3)
    return (
        prediction["f"].copy(),
        prediction["G"].copy(),
        prediction["u"].copy(),
        frame["fdi"]["bound"]["eta_now"].copy(),
    )


@pytest.mark.parametrize("substeps", [1, 2, 7])
def test_what_is_believed_is_the_mean_over_the_instants(substeps):
    rng, frames = np.random.default_rng(substeps), record(substeps)
    seen = [fill(frames[0], rng)]
    first(frames)
    for _ in range(substeps - 1):
        seen.append(fill(frames[0], rng))
        another(frames)
    over(frames)
    believed = np.mean([f + G @ u for f, G, u, _ in seen], axis=0)
    assert frames[0]["prediction"]["means"]["F"] == pytest.approx(believed)
    assert frames[0]["fdi"]["bound"]["eta_bar"] == pytest.approx(
        np.mean([bound for *_, bound in seen], axis=0)
    )


numbers = st.floats(-2, 2)
shares = st.floats(-1, 0)


@given(st.integers(2, 50), numbers, numbers, shares, shares)
def test_a_loss_that_changed_inside_the_frame_stays_within_the_extremes(n, moment0, moment, theta0, theta):
    """The first instant under the old command and the old fault, the others under the new ones."""
    frames = record(n)
    prediction, fie = frames[0]["prediction"], frames[0]["fdi"]["isolation"]["estimator"][0]
    prediction["sums"]["Gu_first"][0, 0], prediction["sums"]["Gu"][0, 0] = (
        moment0 / n,
        (moment0 + (n - 1) * moment) / n,
    )
    over(frames)
    fie["effect"]["regressor"][0], fie["effect"]["e"][0] = (
        prediction["means"]["Gu"][0, 0],
        prediction["means"]["e_Gu"][0, 0],
    )
    fie["parity_direction"][0] = 1.0
    effect = (theta0 * moment0 + (n - 1) * theta * moment) / n
    for low, high in limits(frames, 0):
        assert low - 1e-12 <= effect <= high + 1e-12


def test_one_instant_leaves_no_room():
    frames = record(1)
    fill(frames[0], np.random.default_rng(0))
    first(frames)
    over(frames)
    assert (frames[0]["prediction"]["means"]["e_Gu"] == 0.0).all()
