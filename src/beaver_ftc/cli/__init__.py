"""The command line: one module a command, and the options, answers and progress bars that they share."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.cli.shared import (
        Document,
        Format,
        FormatOption,
        JunitOption,
        NoReportOption,
        ResultsOption,
        ScenarioArgument,
        WorkersOption,
        answer,
        complain,
        emit,
        emit_json,
        judged,
        load_all,
        progress_bar,
        write_junit,
    )
else:
    __getattr__, __dir__ = lazily(__name__)
