"""The truth: the Beaver in JSBSim. The only package that imports jsbsim."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.plant.adapter import PA_PER_PSF, FlightState, Plant, bare, body_axes, translated
    from beaver_ftc.plant.admission import digest_of_aircraft
    from beaver_ftc.plant.ground import lay as lay_ground
    from beaver_ftc.plant.ground import stand as stand_on_ground
    from beaver_ftc.plant.instrumented import (
        AT_IDLE,
        ENGINE_SIGNALS,
        GEAR,
        SURFACES,
        View,
        Views,
        actuator_system,
        others_of,
        seen_by_aerodynamics,
        surfaces_of,
        unit_of,
        usual_view,
        view_property,
    )
    from beaver_ftc.plant.instrumented import DIFFERENCE as LEVER_DIFFERENCE
    from beaver_ftc.plant.instrumented import LEVER as POWER_LEVER
    from beaver_ftc.plant.instrumented import PREFIX as ACTUATED
    from beaver_ftc.plant.instrumented import SIGNALS as SIGNAL_PROPERTIES
    from beaver_ftc.plant.instrumented import instrument as instrument_model
    from beaver_ftc.plant.instrumented import is_told as is_known_to_jsbsim
    from beaver_ftc.plant.instrumented import source_of as source_of_jsbsim
    from beaver_ftc.plant.instruments import AX, SENSORS
    from beaver_ftc.plant.model_file import (
        check_model_has_no_side_effects,
        copy_of,
        left_out_of_copy,
        where_files_lie,
    )
    from beaver_ftc.plant.trial import lacking as lacking_in_trial
    from beaver_ftc.plant.trial import probe as probe_model
    from beaver_ftc.plant.trim import TrimPoint
    from beaver_ftc.plant.trim import trim as trim_plant
    from beaver_ftc.plant.true_aircraft import DELAY as ACTUATOR_DELAY
else:
    __getattr__, __dir__ = lazily(__name__)
