"""Questions asked of many flights: one folder a study."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.studies.detectability.isolability import DOUBLET_COLUMNS
    from beaver_ftc.studies.handling import LIMITS as HANDLING_LIMITS
    from beaver_ftc.studies.handling import where_ended, where_trimmed
    from beaver_ftc.studies.margins import at as margins_at
    from beaver_ftc.studies.margins import refuse_other_laws as refuse_laws_without_margins
else:
    __getattr__, __dir__ = lazily(__name__)
