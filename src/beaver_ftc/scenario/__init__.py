"""What a scenario says: the models of its sections, and the file that they are read from."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.scenario.airframe import checked_against, find_aircraft, initial_of
    from beaver_ftc.scenario.autopilot import channels_of
    from beaver_ftc.scenario.builtin import (
        builtin_names,
        builtin_sweeps,
        is_sweep,
        looks_like_a_path,
        read_file,
        resolve,
    )
    from beaver_ftc.scenario.contradictions import conflicts
    from beaver_ftc.scenario.declared import Declared
    from beaver_ftc.scenario.diagnosis import Bounds
    from beaver_ftc.scenario.dump import to_yaml
    from beaver_ftc.scenario.expect import Expect
    from beaver_ftc.scenario.instants import TIME_TOLERANCE_S
    from beaver_ftc.scenario.interventions import fault_of
    from beaver_ftc.scenario.measured_range import measured_spans, plural, span_in_words
    from beaver_ftc.scenario.schema import (
        NAME_PATTERN,
        Scenario,
        ScenarioLike,
        is_of_a_sweep,
        load,
        load_scenario,
        validate_scenario,
    )
    from beaver_ftc.scenario.sensors import sensor_words, sensors_there
    from beaver_ftc.scenario.sweeps import Sweep, SweepExpect, load_sweep, validate_sweep
else:
    __getattr__, __dir__ = lazily(__name__)
