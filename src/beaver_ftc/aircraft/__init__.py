"""What is known of an aircraft beside its JSBSim model: one file of data, read here and nowhere else."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.aircraft.aircraft import (
        AXES,
        MOMENTS,
        THRUST_TERM,
        Aircraft,
        MassProperties,
        Term,
        Travel,
    )
    from beaver_ftc.aircraft.channels import MOST_CHANNELS, ChannelsSection, OutputSection
    from beaver_ftc.aircraft.loading import (
        DEFAULT,
        FROM_JSBSIM,
        UnknownAircraft,
        builtin_names,
        derived_folder,
        imported_folder,
        is_derived,
        load,
    )
    from beaver_ftc.aircraft.loading import DERIVED as DERIVED_FORMAT
    from beaver_ftc.aircraft.loading import FILE as AIRCRAFT_FILE
    from beaver_ftc.aircraft.loading import first_line as first_line_of
    from beaver_ftc.aircraft.loading import read as read_aircraft
    from beaver_ftc.aircraft.schema import (
        FLOW_SIGNALS,
        MAX_MONOMIALS,
        MAX_SIGNALS,
        MAX_SURFACES,
        MAX_TERMS_OF_ONE,
        AircraftFile,
        ErrorMapSection,
        Interval,
    )
    from beaver_ftc.aircraft.units import GRAVITY_MPS2, KG_PER_LB, KG_PER_SLUG, M_PER_FT, N_PER_LBF
else:
    __getattr__, __dir__ = lazily(__name__)
