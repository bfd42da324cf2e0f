"""Contenders as processes of their own, so that no one's settings or contexts reach another's."""

import multiprocessing
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from common.clock import SystemClock, seconds


class Worker:
    """Does turns of work when it is told, one at a time, in a process of its own.

    Args:
        prepare: called there with `arguments`; returns the work of a turn. Must be importable.
        arguments: for it.

    Raises:
        RuntimeError: if it cannot be prepared; the text says why.
    """

    def __init__(self, prepare: Callable[..., Callable[[], None]], *arguments: Any) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, prepare, arguments))
        self._process.start()
        trouble = self._pipe.recv()
        if trouble:
            self._process.join()
            raise RuntimeError(trouble)

    def turn_s(self) -> float:
        """Do one turn; returns how long it took."""
        self._pipe.send(True)
        return float(self._pipe.recv())

    def close(self) -> None:
        """End the process."""
        self._pipe.send(False)
        self._process.join()


def _serve(
    pipe: Connection, prepare: Callable[..., Callable[[], None]], arguments: tuple[Any, ...]
) -> None:
    clock = SystemClock()
    try:
        work = prepare(*arguments)
        work()
    except Exception as error:
        pipe.send(f"{type(error).__name__}: {error}")
        return
    pipe.send("")
    while pipe.recv():
        begin_ns = clock.monotonic_ns()
        work()
        pipe.send(seconds(clock.monotonic_ns() - begin_ns))
