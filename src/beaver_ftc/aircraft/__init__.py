"""What is known of an aircraft beside its JSBSim model: one file of data, read here and nowhere else."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.aircraft.aircraft import (
        AXES,
        DEFAULT,
        FROM_JSBSIM,
        GRAVITY_MPS2,
        KG_PER_LB,
        KG_PER_SLUG,
        M_PER_FT,
        MOMENTS,
        N_PER_LBF,
        PITCH,
        ROLL,
        THRUST_TERM,
        YAW,
        Aircraft,
        MassProperties,
        Term,
        Travel,
        UnknownAircraft,
        builtin_names,
        derived_folder,
        imported_folder,
        is_derived,
        load,
        main_surface_index_by_axis,
    )
    from beaver_ftc.aircraft.aircraft import DERIVED as DERIVED_FORMAT
    from beaver_ftc.aircraft.aircraft import FILE as AIRCRAFT_FILE
    from beaver_ftc.aircraft.aircraft import first_line as first_line_of
    from beaver_ftc.aircraft.aircraft import read as read_aircraft
    from beaver_ftc.aircraft.schema import (
        FLOW_SIGNALS,
        MAX_MONOMIALS,
        MAX_SIGNALS,
        MAX_SURFACES,
        MAX_TERMS_OF_ONE,
        MOST_CHANNELS,
        AircraftFile,
        ChannelsSection,
        ErrorMapSection,
        Interval,
        OutputSection,
        Property,
    )
else:
    __getattr__, __dir__ = lazily(__name__)
