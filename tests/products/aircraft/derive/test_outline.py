"""What is known of a stranger's aircraft before it is flown: units, and the speed it is sampled about."""

from beaver_ftc.plant import instrumented
from beaver_ftc_aircraft.derive import outline


def test_engines_whose_moment_does_not_last_are_run_up(tmp_path):
    """JSBSim's steady state of the C-130's propellers rolls it, and is gone after a frame."""
    travel = dict.fromkeys(("aileron", "elevator", "rudder"), (-0.3, 0.3))
    model = instrumented.instrument(instrumented.source_of("C130"), tmp_path / "copy", travel)
    data = outline.outline("C130", model, travel, 0.45)
    (note,) = outline.choose_start(data, model.parent)
    assert "its engines do not carry it" in note
    assert data["engine"]["start"] == "run_up"
