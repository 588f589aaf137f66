"""Progress bars in a terminal or a notebook; this module loads rich, so it is imported when a bar is drawn."""

from __future__ import annotations

import sys
import warnings
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TaskID, TextColumn, TimeRemainingColumn
from rich.text import Text

from dovetail.errors import DovetailError, require_package


class _Clock(ProgressColumn):
    """The time left; the elapsed time if a stage does not report its progress."""

    def __init__(self) -> None:
        super().__init__()
        self._left = TimeRemainingColumn(compact=True, elapsed_when_finished=True)

    def render(self, task: Task) -> Text:
        """Return minutes and seconds."""
        if task.total is not None:
            return self._left.render(task)
        minutes, seconds = divmod(int(task.elapsed or 0), 60)
        return Text(f"{minutes:02d}:{seconds:02d}", style="progress.elapsed")


def _can_be_drawn(console: Console) -> bool:
    """Return whether bars can be shown: on a terminal, or in a notebook that has ipywidgets."""
    if not console.is_jupyter:
        return sys.stderr.isatty()
    try:
        require_package("ipywidgets", "notebook", "progress bars")
    except DovetailError as error:
        warnings.warn(" ".join(str(error).split()), stacklevel=4)
        return False
    return True


class StageBars:
    """One bar a stage; a stage is over when the next begins. Fulfils `dovetail.Progress`.

    Nothing is shown where standard error is neither a terminal nor a notebook's.

    Parameters
    ----------
    transient : bool
        Whether nothing of them stays when they end. Nothing else may be printed meanwhile.
    """

    def __init__(self, *, transient: bool = False) -> None:
        console = Console(stderr=True)
        self._bars = Progress(
            TextColumn("{task.description:<13}"),
            BarColumn(bar_width=20),
            TextColumn("{task.fields[count]}"),
            _Clock(),
            TextColumn("{task.fields[note]}"),
            console=console,
            transient=transient,
            redirect_stdout=not transient,
            redirect_stderr=not transient,
            disable=not _can_be_drawn(console),
        )
        self._stage = ""
        self._task: TaskID | None = None

    def __enter__(self) -> StageBars:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self._finish()
        self._bars.stop()

    def __call__(self, stage: str, done: int, total: int, note: str = "") -> None:
        """Show `done` of `total` steps of `stage`."""
        if self._task is None or stage != self._stage:
            self._bars.start()
            self._finish()
            self._stage = stage
            self._task = self._bars.add_task(stage, total=None, count="", note="")
        # a single step has no progress to show: until it is done, the bar only moves
        known = None if total <= 1 and done < total else total
        count = "" if total <= 1 else f"{done:>{len(str(total))}}/{total}"
        self._bars.update(self._task, completed=done, total=known, count=count)
        if note:
            self._bars.update(self._task, note=note)

    def _finish(self) -> None:
        """Fill the bar of the stage at hand, which may have ended early."""
        for task in self._bars.tasks:
            if task.id == self._task:
                self._bars.update(task.id, total=max(task.completed, 1), completed=max(task.completed, 1))
