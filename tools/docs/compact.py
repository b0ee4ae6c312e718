"""Tables of pages without the blanks beside their bars, which a reader of the page does not see."""

import re
from collections.abc import Sequence

from beaver_ftc.studies.present.tables import Rows, markdown_table


def compact_table(head: Sequence[str], rows: Rows) -> str:
    """A table in Markdown."""
    return re.sub(r" ?(?<!\\)\| ?", "|", markdown_table(head, rows))
