"""The parts that all studies share: workers fly cases, rows are kept as they land, resumed, and counted."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.studies.engine.files import write_whole
    from beaver_ftc.studies.engine.forks import Forks
    from beaver_ftc.studies.engine.identity import fingerprint, plug_ins
    from beaver_ftc.studies.engine.processes import ONE_THREAD_EACH, cores, single_threaded
    from beaver_ftc.studies.engine.processes import context as process_context
    from beaver_ftc.studies.engine.statistics import poisson
    from beaver_ftc.studies.engine.study import Progress, Study, run_study
else:
    __getattr__, __dir__ = lazily(__name__)
