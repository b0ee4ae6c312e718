"""Many flights: drawn, flown on all cores or a cluster, kept as they land, and what they show."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.studies.sweep.expectations import evaluate as evaluate_summary
    from beaver_ftc.studies.sweep.one_flight import (
        BAD_INPUT,
        CRASHED,
        DEPARTED,
        FAILED,
        FLOWN,
        RESULTS,
        flight_name,
        row_of,
        row_of_failure,
        scenario_of,
        schema_of,
        table_of,
    )
    from beaver_ftc.studies.sweep.outcomes import Flights
    from beaver_ftc.studies.sweep.sampling import Assignment, Plan
    from beaver_ftc.studies.sweep.store import write_tables
else:
    __getattr__, __dir__ = lazily(__name__)
