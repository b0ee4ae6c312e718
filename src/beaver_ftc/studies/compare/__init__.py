"""The same flights for every scheme and law: false alarms, detections, delays, tracking errors and costs."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.studies.compare.sets import of_sweep
    from beaver_ftc.studies.compare.trial import LAW as OUR_LAW
    from beaver_ftc.studies.compare.trial import ORACLE as ORACLE_LAW
    from beaver_ftc.studies.compare.trial import SCHEME as OUR_SCHEME
    from beaver_ftc.studies.compare.trial import Entry, Result, result_of, with_entry
else:
    __getattr__, __dir__ = lazily(__name__)
