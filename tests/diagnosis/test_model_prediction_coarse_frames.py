"""Several JSBSim frames in a frame of the loop: exact means, and room for a fault that changed inside it."""

from design_plant import TRAVEL_RAD
from hypothesis import given
from hypothesis import strategies as st

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.detection.directions import project, project_size
from beaver_ftc.diagnosis.detection.intervals import fault_range
from beaver_ftc.diagnosis.model_prediction import (
    fill_means,
)
from beaver_ftc.loop.assembly import configure_design
from beaver_ftc.scenario.schema import Scenario


@kernel
def over(frames):
    fill_means(frames[0].prediction, frames[0].fdi.bound)


@kernel
def limits(frames, surface):
    fie = frames[0].fdi.isolation.estimator[surface]
    fault, m = fie.effect, fie.parity_direction
    along = project(m, fault.h), project(m, fault.Z), project_size(m, fault.r)
    return fault_range(fie, fault.h[0], fault.Z[0], fault.r[0]), fault_range(fie, *along)


def record(substeps):
    return configure_design(Scenario(name="x", substeps=substeps), TRAVEL_RAD)


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
    fie["effect"]["Z"][0], fie["effect"]["r"][0] = (
        prediction["means"]["Gu"][0, 0],
        prediction["means"]["e_Gu"][0, 0],
    )
    fie["parity_direction"][0] = 1.0
    effect = (theta0 * moment0 + (n - 1) * theta * moment) / n
    for low, high in limits(frames, 0):
        assert low - 1e-12 <= effect <= high + 1e-12
