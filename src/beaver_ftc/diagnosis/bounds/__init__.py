"""What a scenario declares in `fdi.bounds`, read once: as a worst case, as variances, as a test's limit."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.diagnosis.bounds.worst_case import ROUNDING_RAD_S2
else:
    __getattr__, __dir__ = lazily(__name__)
