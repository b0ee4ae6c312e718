"""`beaver-ftc check`: whether a run's certificate follows from its log and scenario."""

from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.cli import Format, FormatOption, answer
from beaver_ftc.commands import declare
from beaver_ftc.documents import BadInput


@declare("certificate.json", plugins=False)
def command(
    run: Annotated[Path, typer.Argument(metavar="RUN")],
    log: Annotated[Path | None, typer.Option(metavar="FILE")] = None,
    scenario: Annotated[Path | None, typer.Option(metavar="FILE")] = None,
    format: FormatOption = Format.text,
) -> None:
    """Check a run's certificate.

    The command computes every statement of certificate.json again, from the log and from the bounds that the
    scenario declares. It prints each statement as a sentence. If a statement does not hold, it prints the
    reason. The exit status is 0 if all statements hold, otherwise 1.

    Examples:
      beaver-ftc run elevator-partial-loss --certificate
      beaver-ftc check runs/elevator-partial-loss

    run: Result folder of `run --certificate`, or path of a certificate.json.
    log: Path of the log. Default: log.parquet beside the certificate.
    scenario: Path of the scenario with all defaults filled in. Default: scenario.yaml beside the log.
    """
    from pyarrow import ArrowException

    from beaver_ftc_assurance.certificates import check_certificate

    file = run / "certificate.json" if run.is_dir() else run
    if not file.is_file():
        raise BadInput(f"{file}: no such file, allowed: the folder of a run with --certificate")
    try:
        sentences, reasons = check_certificate.check(run, log, scenario)
    except (ArrowException, OSError, ValueError, RecursionError, check_certificate.Refused) as error:
        sentences = []
        reasons = [" ".join(f"{file}: cannot be checked: {error}".split())]
    document = {"holds": not reasons, "statements": sentences, "refused": reasons}
    lines = [*reasons, "the certificate does not hold"]
    if not reasons:
        count = sum(not sentence.startswith("not certified") for sentence in sentences)
        lines = [*sentences, f"{count} statements hold"]
    answer(format, document, lambda: "\n".join(lines))
    raise typer.Exit(int(bool(reasons)))
