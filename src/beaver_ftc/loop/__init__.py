"""The closed loop: one frame, its assembly from a scenario, and the same with plug-ins."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.loop.agent import BESIDE_SURFACES as OBSERVED_BESIDE_SURFACES
    from beaver_ftc.loop.agent import LARGEST as LARGEST_OBSERVATION
    from beaver_ftc.loop.agent import act as act_as_agent
    from beaver_ftc.loop.agent import cost as cost_of_agent
    from beaver_ftc.loop.agent import look_of as look_of_agent
    from beaver_ftc.loop.agent import note_first_readings as note_first_readings_of_agent
    from beaver_ftc.loop.agent import observe as observe_as_agent
    from beaver_ftc.loop.changing import take_diagnosis
    from beaver_ftc.loop.loop import LogSink, Loop, fly
    from beaver_ftc.loop.memory import copied as copy_memory
    from beaver_ftc.loop.memory import give_back as give_back_memory
    from beaver_ftc.loop.memory import taken as take_memory
    from beaver_ftc.loop.readout import (
        FrameReadout,
        Instruments,
        alarm_flags,
        command_power,
        end_outer_loops,
        hold_from_start,
        recorded_arrays,
        set_ground,
        stop_diagnosis,
    )
    from beaver_ftc.loop.simulation import Asked, Stepping
    from beaver_ftc.loop.stream import FLOW, Diagnosis
else:
    __getattr__, __dir__ = lazily(__name__)
