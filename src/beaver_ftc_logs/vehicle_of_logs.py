"""Load a vehicle file. If it leaves out the mixing (`mixing`), the parameters of the logs give it."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from beaver_ftc.documents import validate_model as validate
from beaver_ftc.results import Document
from beaver_ftc_logs.mixing import mixing_of_log
from beaver_ftc_logs.readers import SELECTIVE_READERS, check_exists, read_flight, reader_name_for_path
from beaver_ftc_logs.refusals import refusal
from beaver_ftc_logs.vehicle import Vehicle, read_vehicle_document


def load_vehicle_for_logs(
    vehicle: str | Path, logs: Sequence[Path], reader: str | None
) -> tuple[Vehicle, list[str]]:
    """The vehicle in a file, and lines of remarks. If the file leaves out `commands` or `surfaces`, they
    follow from the parameters of the logs, which must agree. Raises ScenarioError and BadInput with one line
    for each mistake.
    """
    document, path = read_vehicle_document(vehicle)
    missing = [key for key in ("commands", "surfaces") if key not in document.data]
    lines: list[str] = []
    if missing and logs:
        keys_of_first: Document = {}
        for log in logs:
            keys_of_log, lines_of_log = _missing_keys_of_log(log, reader, document.data, missing)
            if keys_of_first and keys_of_log != keys_of_first:
                raise refusal(
                    log,
                    f"its parameters give another mixing than those of {logs[0]}",
                    f"one for all, or {' and '.join(missing)} in {path}",
                )
            keys_of_first = keys_of_log
            lines = lines or [f"{log}: {line}" for line in lines_of_log]
        document.data.update(keys_of_first)
    return validate(Vehicle, document, path), lines


def _missing_keys_of_log(
    log: Path, reader: str | None, data: Mapping[str, Any], missing: Sequence[str]
) -> tuple[Document, list[str]]:
    """The missing keys of a vehicle file by the parameters of a log, and lines of remarks; none if the format
    of the log has no parameters. data: content of the file.
    """
    check_exists(log)
    used_reader = reader or data.get("reader") or reader_name_for_path(log)
    if used_reader not in SELECTIVE_READERS:
        return {}, []
    recording = read_flight(log, used_reader, columns=())
    columns_in_file = _columns_in_file(data)
    column_names = (
        set(recording.columns) if columns_in_file is None else columns_in_file & set(recording.columns)
    )
    mixing = mixing_of_log(used_reader, recording.parameters, column_names)
    if not mixing.surfaces:
        raise refusal(log, "; ".join(mixing.lines), f"{' and '.join(missing)} in the file")
    keys = {"commands": mixing.commands, "surfaces": mixing.surfaces}
    if columns_in_file is not None and "commands" in missing:
        keys["commands"] = [mixing.entry_by_column.get(column, column) for column in sorted(columns_in_file)]
    return {key: keys[key] for key in missing}, mixing.lines


def _columns_in_file(data: Mapping[str, Any]) -> set[str] | None:
    """The columns of the commands that a vehicle file names in `commands` or, without this key, in
    `surfaces`; None if it has neither. Entries that are no names are skipped: the check of the file reports
    them.
    """
    if isinstance(commands := data.get("commands"), list):
        columns = [entry.get("column") if isinstance(entry, dict) else entry for entry in commands]
        return {column for column in columns if isinstance(column, str)}
    if isinstance(surfaces := data.get("surfaces"), dict):
        tables = [weights for weights in surfaces.values() if isinstance(weights, dict)]
        return {column for weights in tables for column in weights if isinstance(column, str)}
    return None
