"""Many Beavers at a time, in processes: `gymnasium.make_vec` with the name of `gym.py`, and `num_envs=16`.

A step of the environment takes less than handing its arrays from process to process. So each process flies
several episodes, one byte sets it going, and what it flies by and sees is in memory that all share. The
process that asks flies a part itself instead of waiting.
"""

import contextlib
import pickle
import signal
from collections.abc import Mapping, Sequence
from ctypes import c_double
from itertools import pairwise
from multiprocessing.connection import Connection
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.integrations.gym import BeaverEnv
from beaver_ftc.studies.engine.workers import context, cores, single_threaded

_STEP, _NOTHING = b"", b""  # to a worker, and from one that has no more to say
_PATIENCE_S = 5.0  # for a worker to end by itself
Infos = dict[int, dict[str, Any]]  # of the episodes that have any
Flags = NDArray[np.bool_]


class _Shared:
    """A row an episode: its action, its observation, reward, whether it is terminated, whether truncated."""

    def __init__(self, block: Any, sizes: tuple[int, int], part: slice) -> None:
        actions, seen = sizes
        rows = np.frombuffer(block).reshape(-1, actions + seen + 3)[part]
        self.actions, self.seen = rows[:, :actions], rows[:, actions : actions + seen]
        self.rewards, self.terminated, self.truncated = rows[:, -3], rows[:, -2], rows[:, -1]


class BeaverVectorEnv(gymnasium.vector.VectorEnv[NDArray[np.float64], NDArray[np.float64], Any]):
    """`num_envs` environments as one, flown by `workers` processes, this one among them; as many as there are
    cores if left out.

    options: those of BeaverEnv. An episode that is over begins anew with the next step, whose action is not
    looked at (AutoresetMode.NEXT_STEP). `infos["metrics"][i]` is the document metrics.json of an episode that
    has ended with this step, `infos["_metrics"]` says which have.
    """

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012  (the form Gymnasium looks for)

    def __init__(self, num_envs: int = 1, *, workers: int | None = None, **options: Any) -> None:
        for name, count in (("num_envs", num_envs), ("workers", 1 if workers is None else workers)):
            if not isinstance(count, int) or count < 1:
                raise BadInput(f"{name}: {count!r} is out of range, allowed: a whole number of at least 1")
        self.num_envs = num_envs
        one = BeaverEnv(**options)
        assert one.action_space.shape is not None
        assert one.observation_space.shape is not None
        self.single_action_space, self.single_observation_space = one.action_space, one.observation_space
        self.action_space = batch_space(one.action_space, num_envs)
        self.observation_space = batch_space(one.observation_space, num_envs)
        sizes = one.action_space.shape[0], one.observation_space.shape[0]
        block = context().RawArray(c_double, num_envs * (sum(sizes) + 3))
        self._shared = _Shared(block, sizes, slice(None))
        parts = _parts(num_envs, min(num_envs, workers or cores()))
        options |= {"scenario": one.scenario}
        self._workers: list[_Worker | _Here] = [
            *(_Worker(block, sizes, part, options) for part in parts[:-1]),
            _Here(block, sizes, parts[-1], options),  # comes last, when all others fly
        ]

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Put every aircraft in trim. A seed is the first one's, the others have those after it."""
        seeds = [seed] * self.num_envs if seed is None else seed
        if isinstance(seeds, int):
            super().reset(seed=seeds)
            seeds = [seeds + i for i in range(self.num_envs)]
        if len(seeds) != self.num_envs:
            raise BadInput(f"seed: {len(seeds)} of them, allowed: {self.num_envs}, or one")
        for worker in self._workers:
            worker.tell(pickle.dumps(seeds[worker.part]))
        infos = self._answers()
        return self._shared.seen.copy(), infos

    def step(
        self, actions: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], Flags, Flags, dict[str, Any]]:
        """Command the surfaces, fly, look: all at the same time."""
        shared, given = self._shared, np.asarray(actions, np.float64)
        if given.shape != shared.actions.shape:
            raise BadInput(f"actions: shape {given.shape}, allowed: {shared.actions.shape}")
        shared.actions[:] = given
        for worker in self._workers:
            worker.tell(_STEP)
        infos = self._answers()
        ended = shared.terminated != 0.0, shared.truncated != 0.0
        return shared.seen.copy(), shared.rewards.copy(), *ended, infos

    def close_extras(self, **kwargs: Any) -> None:
        """End the processes."""
        for worker in getattr(self, "_workers", ()):
            worker.end()

    def _answers(self) -> dict[str, Any]:
        """Wait for all; what they have to say, by Gymnasium's rule, but a document stays one."""
        infos: dict[str, Any] = {}
        failed: Exception | None = None
        for worker in self._workers:
            answer = worker.answer()
            if isinstance(answer, Exception):
                failed = answer
            else:
                for i, info in answer.items():
                    self._put(infos, i, info)
        if failed is not None:
            self.close()
            raise failed
        return infos

    def _put(self, infos: dict[str, Any], i: int, info: Mapping[str, Any]) -> None:
        for key, value in info.items():
            infos.setdefault(key, np.full(self.num_envs, None, object))[i] = value
            infos.setdefault(f"_{key}", np.zeros(self.num_envs, np.bool_))[i] = True


def _parts(count: int, workers: int) -> list[slice]:
    """Which episodes each worker flies, as even as can be."""
    ends = [count * w // workers for w in range(workers + 1)]
    return [slice(start, end) for start, end in pairwise(ends)]


class _Episodes:
    """Some of the episodes, flown in this process."""

    def __init__(self, block: Any, sizes: tuple[int, int], part: slice, options: dict[str, Any]) -> None:
        self._first, self._shared = part.start, _Shared(block, sizes, part)
        self._envs = [BeaverEnv(**options) for _ in range(part.stop - part.start)]

    def do(self, what: bytes) -> Infos | Exception:
        """A step, or a reset by the seeds given; why not, if not."""
        try:
            return self._step() if what == _STEP else self._reset(pickle.loads(what))
        except Exception as error:
            return error

    def _reset(self, seeds: Sequence[int | None]) -> Infos:
        for i, seed in enumerate(seeds):
            self._begin(i, seed)
        return {}

    def _begin(self, i: int, seed: int | None = None) -> None:
        shared = self._shared
        shared.seen[i], _ = self._envs[i].reset(seed=seed)
        shared.rewards[i] = shared.terminated[i] = shared.truncated[i] = 0.0

    def _step(self) -> Infos:
        shared, infos = self._shared, {}
        for i, env in enumerate(self._envs):
            if shared.terminated[i] or shared.truncated[i]:
                self._begin(i)
                continue
            seen, reward, terminated, truncated, info = env.step(shared.actions[i])
            shared.seen[i], shared.rewards[i] = seen, reward
            if terminated or truncated:
                shared.terminated[i], shared.truncated[i] = terminated, truncated
                infos[self._first + i] = info
        return infos


class _Here:
    """This process, told and asked like any other: it flies when it is told to."""

    def __init__(self, block: Any, sizes: tuple[int, int], part: slice, options: dict[str, Any]) -> None:
        self.part = part
        self._episodes = _Episodes(block, sizes, part, options)
        self._answer: Infos | Exception = {}

    def tell(self, what: bytes) -> None:
        self._answer = self._episodes.do(what)

    def answer(self) -> Infos | Exception:
        return self._answer

    def end(self) -> None:
        """It goes on."""


class _Worker:
    """A process that flies some of the episodes. Told anything, it has to be asked for its answer."""

    def __init__(self, block: Any, sizes: tuple[int, int], part: slice, options: dict[str, Any]) -> None:
        self.part = part
        start = context()
        self._line, far_end = start.Pipe()
        self.process = start.Process(target=_serve, args=(far_end, block, sizes, part, options), daemon=True)
        with single_threaded():
            self.process.start()
        far_end.close()

    def tell(self, what: bytes) -> None:
        with contextlib.suppress(OSError):  # it has ended: its answer will say so
            self._line.send_bytes(what)

    def answer(self) -> Infos | Exception:
        """What it has to say, or why it could not go on."""
        try:
            said = self._line.recv_bytes()
        except (EOFError, OSError):
            return SimulationFailed("a process of the vector environment has ended; make a new one")
        return pickle.loads(said) if said != _NOTHING else {}

    def end(self) -> None:
        self._line.close()
        self.process.join(_PATIENCE_S)
        if self.process.is_alive():
            self.process.terminate()


def _serve(
    line: Connection, block: Any, sizes: tuple[int, int], part: slice, options: dict[str, Any]
) -> None:
    """What a worker does: fly when told to, until nobody is there to tell it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # it is for the process that gives the orders
    episodes = _Episodes(block, sizes, part, options)
    with contextlib.suppress(EOFError, OSError):
        while True:
            said = episodes.do(line.recv_bytes())
            line.send_bytes(pickle.dumps(said) if said else _NOTHING)
