"""What a flight leaves: its log, metrics and verdict, figures, report and files."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.results.expectations import evaluate as evaluate_expectations
    from beaver_ftc.results.expectations import margin as margin_of_expectation
    from beaver_ftc.results.flight import Flight, Proof
    from beaver_ftc.results.folder import clear_disk_errors, result_folder
    from beaver_ftc.results.judgement import Onset
    from beaver_ftc.results.log import Columns, Log, MemoryLog, ParquetLog, SpooledLog, StoredLog
    from beaver_ftc.results.metrics import as_json, faults_of, measure, versions
    from beaver_ftc.results.model import DeclaredFault, Document, Expectation, Judged, Metrics, read_metrics
    from beaver_ftc.results.model import Link as LinkMetrics
    from beaver_ftc.results.result_files import add_report
    from beaver_ftc.results.simulation import Simulation
    from beaver_ftc.results.style import SERIES as SERIES_COLOURS
    from beaver_ftc.results.temporal import Formula, FormulaError
    from beaver_ftc.results.temporal import parse as parse_formula
    from beaver_ftc.results.verdict import verdict_text
    from beaver_ftc.results.writer import run as run_scenario
else:
    __getattr__, __dir__ = lazily(__name__)
