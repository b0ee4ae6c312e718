"""The kernels of the rejecting law, and of what it makes of a verdict, against the same in matrices."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beaver_ftc.control import allocation
from beaver_ftc.control.laws import gain_schedule, rejecting
from beaver_ftc.control.laws.loop_design import lead_of
from beaver_ftc.control.laws.reference import discretise
from beaver_ftc.loop.assembly import configure_design
from flying import scenario
from law_records import fields, new_control, put

FLAP = 3
DT = 0.01
TRAVEL = np.array([[-0.52, -0.49, -0.44, -0.1], [0.52, 0.49, 0.44, 1.03]])


def record(seed=0):
    """A control record with something in every place that the kernels look at."""
    rng = np.random.default_rng(seed)
    control = new_control(main=(0, 1, 2), stand_in=FLAP, dt=DT, least_effectiveness=0.1)
    control["layout"]["low"], control["layout"]["high"] = TRAVEL
    put(control, effectiveness=rng.uniform(0.2, 1.0, 4), offset=rng.normal(0, 0.02, 4))
    model = fields(control["reference"])
    model["A"], model["B"] = discretise(10.0, 1.0, DT)
    for name in ("governed_rate", "governed_acceleration", "commanded_rate", "scale"):
        model[name] = rng.normal(0, 0.1, 3)
    config, law = control["rejecting"]["config"], control["rejecting"]
    config["qdyn"] = [500.0, 700.0, 1000.0, 1400.0, 2000.0]
    for name in ("Kp_at", "L_rate_at", "L_disturbance_at"):
        config[name] = rng.uniform(0.1, 5.0, (4, 5))
    for name in ("rate", "disturbance"):
        law["observer"][name] = rng.normal(0, 0.3, 3)
    for name in ("Kp", "L_rate", "L_disturbance"):
        law["memory"][name] = rng.normal(0, 0.3, 3)
    config["share"] = 0.4
    return control, rng


@pytest.mark.parametrize("lost", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("qdyn", [300.0, 500.0, 640.0, 700.0, 810.0, 1000.0, 1390.0, 1400.0, 1999.0, 2400.0])
def test_the_schedule_is_interpolated_and_held_beyond_its_ends(qdyn, lost):
    control, _ = record()
    config, memory = control["rejecting"]["config"], control["rejecting"]["memory"]
    gain_schedule.schedule(config, memory, qdyn, lost)
    for name in ("Kp", "L_rate", "L_disturbance"):
        of = [np.interp(qdyn, config["qdyn"], row) for row in config[f"{name}_at"]]
        expected = [of[0], (1 - lost) * of[1] + lost * of[3], of[2]]
        assert memory[name] == pytest.approx(expected, rel=1e-12)


@given(st.integers(0, 50))
def test_the_observer_is_that_of_its_equations(seed):
    control, rng = record(seed)
    x, design = rng.normal(0, 0.1, 3), rng.normal(0, 1, 3)
    Gu, G = rng.normal(0, 1, (3, 4)), rng.normal(0, 5, (3, 4))
    law, surfaces, main = control["rejecting"], control["surfaces"]["output"], control["layout"]["main"]
    observer, memory = law["observer"], law["memory"]
    rejecting.observe(law, surfaces, main, x, design, Gu, G)
    assert list(observer["rate"]) == list(x), "it begins with what is measured"
    z, d = observer["rate"].copy(), observer["disturbance"].copy()
    x = x + 0.01
    rejecting.observe(law, surfaces, main, x, design, Gu, G)
    z = z + DT * (design + Gu @ (surfaces["effectiveness"] - 1.0) + G @ surfaces["offset"] + d)
    assert observer["disturbance"] == pytest.approx(d + memory["L_disturbance"] * (x - z), abs=1e-12)
    assert observer["rate"] == pytest.approx(z + memory["L_rate"] * (x - z), abs=1e-12)


@given(st.integers(0, 50))
def test_the_demand_is_that_of_its_equation(seed):
    """demand = xm' + Kp (xm - x+) - f - d, xm and x+ when the command acts."""
    control, rng = record(seed)
    frames = configure_design(scenario(), TRAVEL).view(np.recarray)
    prediction, measured, law = frames[0]["prediction"], frames[0]["measured"], control["rejecting"]
    f, G, u = rng.normal(0, 1, 3), rng.normal(0, 5, (3, 4)), rng.normal(0, 0.1, 4)
    prediction["f"], prediction["G"], prediction["u"] = f, G, u
    measured["x"], measured["y"][3] = rng.normal(0, 0.1, 3), 900.0
    axes, model, surfaces = control["axes"], fields(control["reference"]), control["surfaces"]["output"]
    rejecting.demand(control, prediction, measured)  # begins with x
    share, d, x = law["config"]["share"], law["observer"]["disturbance"], measured["x"]
    assert axes["disturbance"].tolist() == d.tolist()
    ahead = x + share * DT * (f + d + G @ (surfaces["effectiveness"] * u + surfaces["offset"]))
    A, B = model["A"], model["B"]
    wanted = model["scale"] * model["commanded_rate"]
    state = np.array([model["governed_rate"], model["governed_acceleration"]])
    first = A @ state + np.outer(B, wanted)
    second = A @ first + np.outer(B, wanted)
    target = (1 - share) * state[0] + share * first[0]
    after = (1 - share) * first[0] + share * second[0]
    hold = -f - d
    assert axes["hold"] == pytest.approx(hold, abs=1e-12)
    expected = (after - target) / DT + law["memory"]["Kp"] * (target - ahead) + hold
    assert axes["demand"] == pytest.approx(expected, abs=1e-9)


def led(lead, command, u):
    """What becomes of a command (4,) rad to actuators that are at u."""
    control, _ = record()
    out = control["allocation"]["output"]
    out["command"] = command
    allocation.lead_compensate(out, control["layout"], np.broadcast_to(lead, 4), np.array(u))
    return out["command"]


@given(st.floats(0.25, 1.0), st.floats(-0.01, 0.05))  # no command beyond the travel
def test_an_actuator_that_is_led_is_in_a_frame_where_it_is_wanted(share, wanted):
    """It goes this share of the way to its command; a slower one than 1 / MOST_LEAD does not arrive."""
    u = np.array([0.05, -0.05, 0.0, 0.02])
    command = led(lead_of(share), np.full(4, wanted), u)
    assert u + share * (command - u) == pytest.approx(np.full(4, wanted), abs=1e-12)


def test_a_command_leads_a_lagging_actuator_within_the_travel():
    command = led([3.0, 1.0, 4.0, 0.0], [0.1, -0.1, 0.4, 0.5], [0.05, -0.2, 0.3, 0.4])
    assert command == pytest.approx([0.05 + 3 * 0.05, -0.1, 0.44, 0.5])
