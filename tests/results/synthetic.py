"""A flight made by hand: what the loop would have yielded of the published case, to test what shows it."""

from dataclasses import replace
from typing import Any

from beaver_ftc.loop.outcome import Landing
from beaver_ftc.scenario.expect import Expect
from beaver_ftc.scenario.schema import Scenario

SURFACES = ("aileron", "elevator", "rudder", "flap")
LOSS = {"type": "loss_of_effectiveness", "actuator": "elevator", "magnitude": 0.4, "at_s": 12.0}


def scenario(*faults: dict[str, Any], expect: dict[str, Any] | None = None) -> Scenario:
    """With these faults. expect: not held against the rest of the scenario."""
    given = Scenario.model_validate({
        "name": "synthetic", "description": "A flight made by hand.", "seed": 7, "duration_s": 30,
        "environment": {"wind_mps": [0.0, 1.0, 0.0]}, "faults": list(faults),
    })  # fmt: skip
    return given.model_copy(update={"expect": Expect.model_validate(expect or {})})


def landed(given: Scenario | None = None, **changes: Any) -> Landing:
    """What a flight of 30 s has yielded; changes: of its fields."""
    flown = Landing(
        scenario=given or scenario(LOSS), frames=3000, columns=(), detection_time_s=12.07, detection_axis="q",
        guaranteed_delay_s=0.31, isolation_time_s=12.12, isolated="elevator",
        isolation_type="loss_of_effectiveness", candidates=("elevator",), estimate=-0.39,
        pre_fault_rms_rad_s=(0.001, 0.002, 0.003), post_fault_rms_rad_s=(0.002, 0.01, 0.003),
        supervisor=((0.0, "nominal"), (12.07, "adaptive"), (12.12, "reallocated")), mode_changes=3,
        envelope_exits=(), departure=None, saturation_s=dict.fromkeys(SURFACES, 0.0),
        surface_travel_rad=dict.fromkeys(SURFACES, 0.5), surface_energy_rad2_s=dict.fromkeys(SURFACES, 0.01),
        worst_residual_ratio=0.11, closest_approach=(0.11,),
    )  # fmt: skip
    flown = replace(flown, **changes)
    return replace(flown, so_far=None if flown.isolated is None else flown.isolated in SURFACES)
