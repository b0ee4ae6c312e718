"""The Beaver as a Gymnasium environment, to learn control laws: one flight, or several at a time.

Needs Gymnasium: the extra `gym`.

    import beaver_ftc
    import gymnasium

    env = gymnasium.make("beaver_ftc/Beaver-v0", scenario="fault-free", frames_per_step=5)

The name is registered once both packages are imported, in either order (`environments`). Plant, faults,
reference model and metrics are those of any flight, so a learned law can be plugged in and compared.

Several flights: `gymnasium.make_vec` with the same name and `num_envs=16`. To copy the arrays of a step from
process to process takes longer than the step. So each process flies several episodes, receives an empty
message for a step, and reads actions and writes observations in shared memory. The process of the caller
flies a part of the episodes, too.
"""

import contextlib
import pickle
import signal
from collections.abc import Sequence
from copy import deepcopy
from ctypes import Array, c_double
from itertools import pairwise
from multiprocessing.connection import Connection
from operator import index
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium.spaces import flatdim
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from beaver_ftc.aircraft import load as aircraft
from beaver_ftc.compiled import direct
from beaver_ftc.documents import BadInput, SimulationFailed
from beaver_ftc.loop import LARGEST_OBSERVATION as LARGEST
from beaver_ftc.loop import OBSERVED_BESIDE_SURFACES as BESIDE_SURFACES
from beaver_ftc.loop import Asked
from beaver_ftc.loop import act_as_agent as act
from beaver_ftc.loop import cost_of_agent as cost
from beaver_ftc.loop import look_of_agent as look_of
from beaver_ftc.loop import note_first_readings_of_agent as note_first_readings
from beaver_ftc.loop import observe_as_agent as observe
from beaver_ftc.results import Simulation
from beaver_ftc.scenario import ScenarioLike, load
from beaver_ftc.studies.engine import cores, single_threaded
from beaver_ftc.studies.engine import process_context as context

DEPARTURE = -100.0  # reward of a departure
_NO_LAW = {"control.law": "nominal", "control.options": {}}  # changes of the scenario: the agent is the law
_STEP = b""  # message to a worker: fly a step
_NOTHING = b""  # message from a worker: it has no infos
_PATIENCE_S = 5.0  # time for a worker to end by itself

Vector = NDArray[np.float64]
Flags = NDArray[np.bool_]
Info = dict[str, Any]
Infos = dict[int, Info]  # number of an episode -> its info, if it has one


class Episode(Simulation):
    """A flight that an agent commands: actions, observations and costs. It begins with frame 0 flown."""

    def _make_ready(self) -> None:
        super()._make_ready()
        self._cost = 0.0
        frames = self._loop.frames
        log = self._loop.log
        self._look = look_of(self.columns)
        self._size = self.trim_rad.size
        seen = np.empty(0)
        self._acts = direct(act, frames, seen)
        self._costs = direct(cost, frames, log, self._look)
        self._observes = direct(observe, frames, log, self._look, seen)
        self._begin()
        note_first_readings(self._look, self.measured.y)

    def act(self, action: ArrayLike, frames: int) -> float:
        """Fly so many frames, or to the end of the flight, with an action (surfaces,) that is held; returns
        their cost. Raises BadInput for an action of another shape, or with a number that is not finite."""
        shares = _numbers("action", action, (self._size,))
        if not self._acts(self._loop.frames, shares):
            raise BadInput(f"action: {action!r:.80} is not usable, allowed: {self._size} finite numbers")
        self._asked.append(Asked("act", {"action": shares.copy()}, frames))
        self._cost = 0.0
        self._by_hand = True
        self._fly_to(min(self._next + frames, self._loop.n_frames))
        return self._cost

    def _note(self, rows: Vector) -> None:
        self._cost += self._costs(self._loop.frames, rows, self._look)

    def observation(self) -> Vector:
        """The observation after the last frame, (12 + surfaces,); a new array."""
        seen = np.empty(BESIDE_SURFACES + self._size)
        self._observes(self._loop.frames, self._loop.log, self._look, seen)
        return seen


class BeaverEnv(gymnasium.Env[Vector, Vector]):
    """An episode is a flight, a step some frames of it. The diagnosis of the scenario runs, too.

    Action (surfaces,) in [-1, 1]: each surface from its trim (0) to its lower or upper stop, held over the
    step. Observation (12 + surfaces,), after the step: p, q, r over 0.1 rad/s; alpha and beta less trim over
    0.1 rad; airspeed less trim over 10 m/s; the reference model's rates and the tracking error over
    0.1 rad/s; the deflections less trim over 0.1 rad. Reward: minus the squared tracking error in units of
    0.1 rad/s, times the frame's length in s, summed over the frames; a departure costs 100 and ends the
    episode.
    `info["metrics"]` of the last step is the document metrics.json.

    scenario: a name, a path, a mapping or a Scenario. frames_per_step: number of frames of a step.
    render_mode: only None, as there is nothing to render.

    A pickled environment, or a copy (`copy.deepcopy`), has the same state and is independent: its episode is
    flown again up to now, as in `Simulation.clone`.
    """

    metadata = {"render_modes": []}  # noqa: RUF012  (the name and form Gymnasium looks for)

    def __init__(
        self, scenario: ScenarioLike = "fault-free", frames_per_step: int = 1, render_mode: None = None
    ) -> None:
        self.scenario = load(scenario).with_(_NO_LAW)
        _check_count("frames_per_step", frames_per_step)
        if render_mode is not None:
            raise BadInput(f"render_mode: {render_mode!r:.60} is not known, allowed: None")
        self.frames_per_step = frames_per_step
        surfaces = len(aircraft(self.scenario.aircraft).surfaces)
        seen = (BESIDE_SURFACES + surfaces,)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (surfaces,), np.float64)
        self.observation_space = gymnasium.spaces.Box(-LARGEST, LARGEST, seen, np.float64)
        self._episode: Episode | None = None
        self._seeded = False

    def reset(self, *, seed: int | None = None, options: Info | None = None) -> tuple[Vector, Info]:
        """Put the aircraft in trim. A seed replaces that of the scenario, and the seeds of later episodes are
        drawn from it. If no seed was ever given, each episode has that of the scenario."""
        seed = None if seed is None else _seed(seed)
        super().reset(seed=seed)
        self._seeded |= seed is not None
        if seed is None and self._seeded:
            seed = int(self.np_random.integers(2**31))
        if self._episode is None:
            flown = self.scenario if seed is None else self.scenario.with_({"seed": seed})
            self._episode = Episode(flown, log=False)
        else:
            self._episode.reset(seed=seed)  # the aircraft is not loaded again
        return self._episode.observation(), {}

    def step(self, action: Vector) -> tuple[Vector, float, bool, bool, Info]:
        """Command the surfaces, fly the frames of a step, and observe."""
        episode = self._episode
        if episode is None:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        if episode.done:
            raise gymnasium.error.ResetNeeded("the episode is over, call reset() before step()")
        reward = -episode.act(action, self.frames_per_step)
        if not episode.done:
            return episode.observation(), reward, False, False, {}
        departed = episode.departed
        info = {"metrics": episode.land().metrics}
        return episode.observation(), reward + DEPARTURE * departed, departed, not departed, info

    def clone(self) -> "BeaverEnv":
        """An independent environment in the same state."""
        return deepcopy(self)

    def __getstate__(self) -> Info:
        return self.__dict__ | {"_episode": self._episode and self._episode.snapshot()}

    def __setstate__(self, state: Info) -> None:
        snapshot = state["_episode"]
        self.__dict__.update(state, _episode=snapshot and snapshot.resume())


class _Part(NamedTuple):
    """Some of the episodes. block: memory that all processes share. sizes: numbers in an action and in an
    observation. rows: rows of these episodes in the memory. options: of their environments."""

    block: "Array[c_double]"
    sizes: tuple[int, int]
    rows: slice
    options: Info


class _Shared:
    """The shared memory as arrays with a row for each episode: its action, observation, reward, and whether
    it is terminated or truncated (1 or 0)."""

    def __init__(self, block: "Array[c_double]", sizes: tuple[int, int], rows: slice) -> None:
        actions, seen = sizes
        values = np.frombuffer(memoryview(block)).reshape(-1, actions + seen + 3)[rows]
        self.actions = values[:, :actions]
        self.seen = values[:, actions : actions + seen]
        self.rewards = values[:, -3]
        self.terminated = values[:, -2]
        self.truncated = values[:, -1]


class BeaverVectorEnv(gymnasium.vector.VectorEnv[Vector, Vector, Any]):
    """`num_envs` environments as one, flown by `workers` processes, of which the caller's is one; by default
    as many as there are cores.

    options: those of BeaverEnv. An episode that is over restarts with the next step, which ignores its action
    (AutoresetMode.NEXT_STEP). `infos["metrics"][i]` is the document metrics.json of an episode that ended
    with this step; `infos["_metrics"]` shows which episodes did.
    """

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012  (the form Gymnasium looks for)

    def __init__(self, num_envs: int = 1, *, workers: int | None = None, **options: Any) -> None:
        _check_count("num_envs", num_envs)
        _check_count("workers", 1 if workers is None else workers)
        self.num_envs = num_envs
        one = BeaverEnv(**options)
        self.single_action_space = one.action_space
        self.single_observation_space = one.observation_space
        self.action_space = batch_space(one.action_space, num_envs)
        self.observation_space = batch_space(one.observation_space, num_envs)
        sizes = flatdim(one.action_space), flatdim(one.observation_space)
        block = context().RawArray(c_double, num_envs * (sum(sizes) + 3))
        self._shared = _Shared(block, sizes, slice(None))
        options |= {"scenario": one.scenario}
        workers = min(num_envs, workers or cores())
        ends = [num_envs * w // workers for w in range(workers + 1)]  # shares as equal as possible
        *others, own = (_Part(block, sizes, slice(*rows), options) for rows in pairwise(ends))
        # The episodes of this process come last: it flies them while the others fly.
        self._workers: list[_Worker | _Episodes] = [*map(_Worker, others), _Episodes(own)]

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: Info | None = None
    ) -> tuple[Vector, Info]:
        """Put every aircraft in trim. seed: that of the first episode, from which the others count on; or one
        for each episode."""
        if seed is None or isinstance(seed, Sequence | np.ndarray):
            given = [None] * self.num_envs if seed is None else list(seed)
            seeds = [None if one is None else _seed(one) for one in given]
        else:
            super().reset(seed=_seed(seed))
            seeds = [_seed(seed) + i for i in range(self.num_envs)]
        if len(seeds) != self.num_envs:
            raise BadInput(f"seed: {len(seeds)} of them, allowed: {self.num_envs}, or one")
        for worker in self._workers:
            worker.tell(pickle.dumps(seeds[worker.part.rows]))
        infos = self._answers()
        return self._shared.seen.copy(), infos

    def step(self, actions: ArrayLike) -> tuple[Vector, Vector, Flags, Flags, Info]:
        """Command the surfaces of all aircraft, fly a step of each, and observe."""
        shared = self._shared
        shared.actions[:] = _numbers("actions", actions, shared.actions.shape)
        for worker in self._workers:
            worker.tell(_STEP)
        infos = self._answers()
        ended = shared.terminated != 0.0, shared.truncated != 0.0
        return shared.seen.copy(), shared.rewards.copy(), *ended, infos

    def close_extras(self, **kwargs: Any) -> None:
        """End the processes."""
        for worker in getattr(self, "_workers", ()):
            worker.end()

    def _answers(self) -> Info:
        """Wait for all workers; their infos in the form of Gymnasium, except that a document stays one
        object. Raises the error of a worker."""
        said: Infos = {}
        failed: Exception | None = None
        for worker in self._workers:
            answer = worker.answer()
            if isinstance(answer, Exception):
                failed = answer
            else:
                said |= answer
        if failed is not None:
            self.close()
            raise failed
        infos: Info = {}
        for i, info in said.items():
            for key, value in info.items():
                infos.setdefault(key, np.full(self.num_envs, None, object))[i] = value
                infos.setdefault(f"_{key}", np.zeros(self.num_envs, np.bool_))[i] = True
        return infos


class _Episodes:
    """Some of the episodes, flown in this process."""

    def __init__(self, part: _Part) -> None:
        self.part = part
        self._shared = _Shared(part.block, part.sizes, part.rows)
        self._envs = [BeaverEnv(**part.options) for _ in range(part.rows.stop - part.rows.start)]
        self._answer: Infos | Exception = {}

    def tell(self, what: bytes) -> None:
        """Fly a step if `what` is _STEP; otherwise reset, by the pickled seeds in it."""
        try:
            self._answer = self._step() if what == _STEP else {}
            if what != _STEP:
                for i, seed in enumerate(pickle.loads(what)):
                    self._begin(i, seed)
        except Exception as error:
            self._answer = error

    def answer(self) -> Infos | Exception:
        """The infos after the last `tell`, or its error."""
        return self._answer

    def end(self) -> None:
        """Do nothing: this is the process of the caller."""

    def _begin(self, i: int, seed: int | None = None) -> None:
        shared = self._shared
        shared.seen[i], _ = self._envs[i].reset(seed=seed)
        shared.rewards[i] = shared.terminated[i] = shared.truncated[i] = 0.0

    def _step(self) -> Infos:
        shared = self._shared
        infos = {}
        for i, env in enumerate(self._envs):
            if shared.terminated[i] or shared.truncated[i]:
                self._begin(i)
                continue
            seen, reward, terminated, truncated, info = env.step(shared.actions[i])
            shared.seen[i] = seen
            shared.rewards[i] = reward
            if terminated or truncated:
                shared.terminated[i] = terminated
                shared.truncated[i] = truncated
                infos[self.part.rows.start + i] = info
        return infos


class _Worker:
    """A process that flies some of the episodes. After each `tell`, call `answer`."""

    def __init__(self, part: _Part) -> None:
        self.part = part
        start = context()
        self._line, far_end = start.Pipe()
        self.process = start.Process(target=_serve, args=(far_end, part), daemon=True)
        with single_threaded():
            self.process.start()
        far_end.close()

    def tell(self, what: bytes) -> None:
        with contextlib.suppress(OSError):  # the process has ended: `answer` returns the error
            self._line.send_bytes(what)

    def answer(self) -> Infos | Exception:
        """The infos after the last `tell`, or the error that ended it."""
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


def _serve(line: Connection, part: _Part) -> None:
    """The loop of a worker: fly after each message, until the process of the caller has gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process of the caller
    episodes = _Episodes(part)
    with contextlib.suppress(EOFError, OSError):
        while True:
            episodes.tell(line.recv_bytes())
            said = episodes.answer()
            line.send_bytes(pickle.dumps(said) if said else _NOTHING)


def _numbers(name: str, given: ArrayLike, shape: tuple[int, ...]) -> Vector:
    """The given numbers, real and of this shape. Raises BadInput for anything else."""
    try:
        array = np.asarray(given)
        numbers = None if array.dtype.kind not in "fiub" else np.ascontiguousarray(array, np.float64)
    except (TypeError, ValueError):
        numbers = None
    if numbers is None or numbers.shape != shape:
        had = (
            f"shape {numbers.shape}"
            if numbers is not None
            else f"{' '.join(repr(given).split()):.80} is not usable"
        )
        raise BadInput(f"{name}: {had}, allowed: finite numbers of shape {shape}")
    return numbers


def _seed(given: object) -> int:
    """A whole number of at least 0, also one of NumPy."""
    try:
        seed = index(given)  # type: ignore[arg-type]
    except TypeError:
        seed = -1
    if seed < 0:
        raise gymnasium.error.Error(f"seed: {given!r:.60} is out of range, allowed: a whole number from 0 on")
    return seed


def _check_count(name: str, count: object) -> None:
    if not isinstance(count, int) or count < 1:
        raise BadInput(f"{name}: {count!r} is out of range, allowed: a whole number of at least 1")
