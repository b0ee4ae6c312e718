"""Compiled property access gives what Python gives, to the bit."""

import sys

import jsbsim
import numpy as np
import pytest

from beaver_ftc.documents import trials
from beaver_ftc.loop.loop import Loop
from beaver_ftc.plant import addresses, channels
from beaver_ftc.plant.channels import NodeBank
from beaver_ftc.scenario.schema import load

READ = [
    "velocities/vt-fps",
    "aero/alpha-rad",
    "accelerations/qdot-rad_sec2",
    "aero/coefficient/Cm",
    "aero/dpt",
    "fcs/flap-pos-rad",
    "simulation/sim-time-sec",
]
WRITTEN = ["fcs/aileron-cmd-rad", "fcs/elevator-cmd-rad", "fcs/rudder-cmd-rad", "failures/flap/effectiveness"]

KNOWN = (
    "1.3.3",
    "linux",
)  # a build whose layout must be found: without, flights take longer

needs_native = pytest.mark.skipif(not addresses.available(), reason="this build of JSBSim has another layout")


@pytest.mark.skipif((jsbsim.__version__, sys.platform) != KNOWN, reason="another build than the known one")
def test_the_layout_of_the_known_build_is_proved():
    assert addresses.is_proved(addresses.LAYOUT)


@needs_native
def test_reads_agree_to_the_bit_along_a_flight(beaver):
    bank, found = NodeBank([beaver.node(name) for name in READ], owner=beaver), np.empty(len(READ))
    for _ in range(50):
        beaver.run()
        channels.read_nodes(addresses.address(addresses.GETTER), bank.pointers, found)
        assert found.tolist() == [beaver.read(name) for name in READ]


@needs_native
def test_writes_agree_to_the_bit(beaver):
    bank, values = (
        NodeBank([beaver.node(name) for name in WRITTEN], owner=beaver),
        np.array([0.1, -0.2, 1 / 3, 0.7]),
    )
    channels.write_nodes(addresses.address(addresses.SETTER), bank.pointers, values)
    assert [beaver.read(name) for name in WRITTEN] == values.tolist()


def test_the_plain_path_gives_the_same(beaver, monkeypatch):
    native_bank, out = NodeBank([beaver.node(name) for name in READ], owner=beaver), np.empty(len(READ))
    native_bank.read(out)
    monkeypatch.setenv("BEAVER_FTC_NATIVE", "0")
    assert not addresses.available()
    plain_bank, plain = NodeBank([beaver.node(name) for name in READ], owner=beaver), np.empty(len(READ))
    plain_bank.read(plain)
    assert plain.tolist() == out.tolist()
    assert not plain_bank.pointers.any(), "without native access nobody may follow an address"
    NodeBank([beaver.node(name) for name in WRITTEN], owner=beaver).write(np.array([0.1, 0.2, 0.3, 0.4]))
    assert [beaver.read(name) for name in WRITTEN] == [0.1, 0.2, 0.3, 0.4]


WRONG = {
    "a node of another size": {"node_size": 40},
    "an executive of another size": {"executive_size": 48},
    "a node's method table": {"node_pointer": 16},
    "a word between two": {"node_pointer": 20},
    "beyond the object": {"node_pointer": 32},
    "a dictionary": {"executive_base": 32, "executive_pointer": 32},
    "a type": {"node_pointer": 8, "executive_base": 8, "executive_pointer": 8},
}


@needs_native
@pytest.mark.parametrize("wrong", WRONG.values(), ids=list(WRONG))
def test_another_layout_is_recognised_without_a_crash(monkeypatch, tmp_path, wrong):
    monkeypatch.setattr(trials, "cache_base", lambda: tmp_path)
    assert not addresses.is_proved.__wrapped__(addresses.LAYOUT._replace(**wrong))


ROUGH = {"environment": {"turbulence": "dryden", "severity": "moderate"}, "sensors": "consumer-grade"}


@pytest.mark.parametrize("air", [{}, ROUGH])
@pytest.mark.parametrize("substeps", [1, 3])
def test_jsbsim_run_by_compiled_code_is_the_same_flight(air, substeps):
    fault = {"actuator": "rudder", "type": "bias", "bias_deg": 3.0, "at_s": 1.0}
    case = load(
        {"name": "run", "duration_s": 4.0, "rate_hz": 50, "substeps": substeps, "faults": [fault]} | air
    )
    compiled, called = Loop(case), Loop(case, prepare=lambda plant: None)
    assert compiled.fly_frame is None
    assert called.fly_frame is not None
    logs = [np.concatenate([rows.copy() for rows in loop.chunks()]) for loop in (compiled, called)]
    np.testing.assert_array_equal(*logs)
