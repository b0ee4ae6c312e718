"""Documents for people: numbers and tables in words, figures, pages, and the files that contain them."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.studies.present.figures import GRID, marker, panels
    from beaver_ftc.studies.present.page import (
        Files,
        Heading,
        Makers,
        Part,
        Table,
        as_html,
        as_markdown,
        replace_between,
        versions_line,
        write_files,
    )
    from beaver_ftc.studies.present.tables import aligned, finite, markdown_table, number, tabulated
else:
    __getattr__, __dir__ = lazily(__name__)
