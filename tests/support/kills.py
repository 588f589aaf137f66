"""Kill a process at each of its file operations, one after another."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path

_STEPS = {"open", "os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.link", "os.listdir", "os.scandir", "os.chmod"}


def kill_at_each_step(work: Callable[[int], object], folder: Path, check: Callable[[], object], stride: int = 1) -> int:
    """Run `work(number)` in a child that is killed before its step `number` below `folder`, then call `check`.

    Returns the number of kills; the last child, which has fewer steps than its number, must end well.
    """
    number = 1
    while True:
        child = os.fork()
        if child == 0:
            _run(work, folder, number)
        _, status = os.waitpid(child, 0)
        check()
        if os.WIFEXITED(status):
            assert os.WEXITSTATUS(status) == 0
            return (number - 1) // stride
        number += stride


def _run(work: Callable[[int], object], folder: Path, number: int) -> None:
    done = 0

    def count(event: str, arguments: tuple[object, ...]) -> None:
        nonlocal done
        if event in _STEPS and any(
            str(folder) in os.fsdecode(a) for a in arguments if isinstance(a, (str, bytes, Path))
        ):
            done += 1
            if done == number:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(count)
    code = 1
    try:
        work(number)
        code = 0
    finally:
        os._exit(code)
