"""A study as a command: its options, a progress bar, its answer and its exit status, the same for all."""

import sys
from collections.abc import Callable
from inspect import Parameter, Signature, signature
from typing import Any

import typer

from beaver_ftc.cli.output import Format, FormatOption, answer, complain
from beaver_ftc.cli.progress import progress_bar
from beaver_ftc.studies.engine.command import Reporter, StudyCommand


def command_of(study: type[StudyCommand]) -> Callable[..., None]:
    """The command that runs a study; its parameters are the study's fields and `format`."""

    def command(format: Format, **options: Any) -> None:
        asked = study(**options)
        with progress_bar(asked.label) as progress:
            document = asked.run(Reporter(progress, complain))
        answer(format, document, lambda: asked.as_text(document, sys.stdout.isatty()))
        if not asked.passed(document):
            raise typer.Exit(1)

    own = signature(study).parameters.values()
    last = Parameter("format", Parameter.KEYWORD_ONLY, default=Format.text, annotation=FormatOption)
    command.__signature__ = Signature([*own, last])  # type: ignore[attr-defined]
    command.__doc__ = study.__doc__
    return command
