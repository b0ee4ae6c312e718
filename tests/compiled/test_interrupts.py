"""A signal that arrives while LLVM asks Python for kept code is handled once the code is there."""

import hashlib
import os
import pickle
import signal
import threading
from types import SimpleNamespace

import pytest

from beaver_ftc.compiled import cache


@pytest.fixture
def handled():
    """Signals as a handler gets them, in order."""
    numbers: list[int] = []
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number in before:
        signal.signal(number, lambda number, _: numbers.append(number))
    yield numbers
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_is_handled_once_and_afterwards(handled, number):
    with cache.held():
        for _ in range(2):
            os.kill(os.getpid(), number)
        assert handled == []
    assert handled == [number]
    os.kill(os.getpid(), number)
    assert handled == [number, number]


def test_a_signal_that_ends_the_process_stays_so_and_other_threads_hold_nothing(handled):
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    seen = []

    def look():
        with cache.held():
            seen.append(signal.getsignal(signal.SIGTERM))

    with cache.held():
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    other = threading.Thread(target=look)
    other.start()
    other.join()
    assert seen == [signal.SIG_DFL]


def test_code_that_is_being_loaded_is_loaded_whole(monkeypatch, tmp_path):
    content, loaded = pickle.dumps(("kept",)), []

    def rebuild(context, kept):
        signal.raise_signal(signal.SIGINT)
        loaded.append(kept)

    monkeypatch.setattr(cache, "CompileResult", SimpleNamespace(_rebuild=rebuild))
    monkeypatch.setattr(cache, "read_own", lambda _: (hashlib.sha256(content).digest() + content, None))
    context = SimpleNamespace(codegen=lambda: SimpleNamespace(magic_tuple=tuple))
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            cache.CodeCache(tmp_path, test_code_that_is_being_loaded_is_loaded_whole).load((), context)
    finally:
        signal.signal(signal.SIGINT, before)
    assert loaded == ["kept"]
