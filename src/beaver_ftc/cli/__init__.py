"""The command line: one module a command, and the options, answers and progress bars that they share."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.cli.inputs import (
        JunitOption,
        NoReportOption,
        ResultsOption,
        ScenarioArgument,
        WorkersOption,
        load_all,
    )
    from beaver_ftc.cli.output import (
        Document,
        Format,
        FormatOption,
        answer,
        complain,
        emit,
        emit_json,
        judged,
        write_junit,
    )
    from beaver_ftc.cli.progress import progress_bar
else:
    __getattr__, __dir__ = lazily(__name__)
