"""A Ray cluster as workers. Each task is a Ray task. Unless a number of workers is requested, QUEUED_A_CPU
tasks for each CPU are in the queue, so that no CPU waits.

Ray does not retry a lost task: flying.py decides whether it is flown again, as for local processes.
"""

import contextlib
import os
import sys
from collections.abc import Sequence
from typing import Any

from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.plugins import VARIABLE
from beaver_ftc.results.metrics import versions
from beaver_ftc.studies.engine.processes import ONE_THREAD_EACH, silence
from beaver_ftc.studies.engine.workers import Batch, Outcome, Row, Work

QUEUED_A_CPU = 2


class RayWorkers:
    """The CPUs of a Ray cluster: of one that this process has joined already, of one at an address, or of a
    new one on this machine.

    _ours: whether this object joined the cluster, and so leaves it. _most: largest number of tasks, or None.
    _diverted: the redirection of standard output, once a task has been submitted.
    """

    def __init__(self, work: Work, address: str | None, workers: int | None) -> None:
        try:
            import ray
        except ImportError:
            allowed = "pip install 'beaver-ftc[ray]'"
            raise BadInput(f"--backend ray: Ray is not installed, allowed: {allowed}") from None
        self._ray = ray
        self._ours = _join(ray, address)
        self._most = workers
        self._work = self._ray.put(work)
        self._versions = dict(versions())
        self._fly = self._ray.remote(num_cpus=1, max_retries=0)(fly_task)
        self._tasks: dict[Any, Batch] = {}
        self._diverted: contextlib.redirect_stdout[Any] | None = None

    @property
    def slots(self) -> int:
        """The number of tasks to submit; without a requested number, it changes with the nodes of the
        cluster."""
        cpus = max(1, int(self._ray.cluster_resources().get("CPU", 1)))
        return self._most or QUEUED_A_CPU * cpus

    def submit(self, task: Batch) -> None:
        """Submit a task to the cluster."""
        if self._diverted is None:  # Ray prints lost workers on standard output, which may be a document
            self._diverted = contextlib.redirect_stdout(sys.stderr)
            self._diverted.__enter__()
        self._tasks[self._fly.remote(self._work, self._versions, task.cases)] = task

    def outcomes(self, timeout_s: float) -> list[Outcome]:
        ready, _ = self._ray.wait(list(self._tasks), num_returns=1, timeout=timeout_s)
        return [Outcome(self._tasks.pop(reference), self._rows(reference)) for reference in ready]

    def close(self) -> None:
        """Cancel all tasks, leave the cluster if this object joined it, and restore standard output."""
        for reference in self._tasks:
            self._ray.cancel(reference, force=True)
        if self._ours:
            self._ray.shutdown()
        if self._diverted is not None:
            self._diverted.__exit__(None, None, None)
            self._diverted = None

    def _rows(self, reference: Any) -> list[Row] | None:
        """The rows of a task; None if its worker or node was lost. Raises SimulationFailed if the code
        failed."""
        try:
            return self._ray.get(reference)
        except self._ray.exceptions.RayTaskError as error:
            raise SimulationFailed(f"a worker cannot go on: {error.cause or error}") from None
        except self._ray.exceptions.RayError:
            return None


def fly_task(work: Work, driver_versions: dict[str, str], cases: Sequence[Any]) -> list[Row]:
    """Fly a task on a node. Raises SimulationFailed if its versions differ from those of the driver."""
    our_versions = versions()
    changed = [
        f"{name} {our_versions.get(name)} instead of {theirs}"
        for name, theirs in driver_versions.items()
        if our_versions.get(name) != theirs
    ]
    if changed:
        raise SimulationFailed(
            f"a node of the cluster has {', '.join(changed)}: the table would mix versions"
        )
    with silence():
        return work.all(cases)


def _join(ray: Any, address: str | None) -> bool:
    """Join the cluster at an address, or start one. False if this process has joined one before. Raises
    BadInput if there is none at this address."""
    if ray.is_initialized():
        return False
    options: dict[str, Any] = {} if address else {"include_dashboard": False}
    environment = ONE_THREAD_EACH | {VARIABLE: os.environ.get(VARIABLE, "")}
    try:
        with silence():
            ray.init(address, log_to_driver=False, runtime_env={"env_vars": environment}, **options)
    except (ConnectionError, ValueError, RuntimeError) as error:
        raise BadInput(f"--ray-address: cannot join a Ray cluster ({str(error).splitlines()[0]})") from None
    return True
