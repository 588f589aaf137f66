"""``dovetail watch``: each new measurement in a folder is identified, and changes are reported."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dovetail.cli.options import PluginFiles, part
from dovetail.cli.terminal import note, progress_bars, say, say_on_stderr
from dovetail.errors import counted

if TYPE_CHECKING:
    from types import FrameType

    from dovetail.errors import DovetailError
    from dovetail.monitoring import Watch

SeriesFile = Annotated[Path, typer.Argument(metavar="SERIES", help="The description of a series of tests (YAML).")]
_NOT_AS_PREDICTED = 3
"""Exit code of a single look with an alarm."""


def watch(
    series: SeriesFile,
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder in which measured files arrive.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FOLDER", help="Folder for state, tables and page; FOLDER-watch by default."
        ),
    ] = None,
    once: Annotated[bool, typer.Option("--once", help="Process the files that are in the folder, and end.")] = False,
    false_alarms: Annotated[
        float, typer.Option("--false-alarms", metavar="RATE", parser=part, help="False alarms per file.")
    ] = 1e-3,
    reference: Annotated[
        int, typer.Option("--reference", metavar="N", min=1, help="Number of first files that define the normal state.")
    ] = 40,
    interval: Annotated[
        float, typer.Option("--interval", metavar="SECONDS", min=0.05, help="Time between two checks of the folder.")
    ] = 2.0,
    settle: Annotated[
        float,
        typer.Option(
            "--settle", metavar="SECONDS", min=0.0, help="A file is read once it has not changed for this time."
        ),
    ] = 2.0,
    plugin: PluginFiles = None,
) -> None:
    """Watch a folder: identify each new measurement, and report changes.

    The first test of the series says how files are read, and with which assembly they are compared. Parameters that
    are 'shared' are constant; those that are 'varying' or follow a law drift from file to file. After the first files
    an alarm is raised when a file contradicts the prediction from the earlier ones.

    The state is saved after each file: a watch that was stopped or killed goes on from there. The same content counts
    once. Files that are still being written wait; those that cannot be read are listed, and stay where they are.

    With --once the exit code is 3 if one of the new files raised an alarm.
    """
    from dovetail.monitoring import ALARM, Watch, WatchOptions

    output = output or Path(f"{folder.resolve().name or 'folder'}-watch")
    options = WatchOptions(false_alarms, reference)
    with progress_bars() as progress:
        watched = Watch(series, folder, output, options, settle=settle, plugins=plugin or (), progress=progress)
    new = list[dict[str, Any]]()

    def report(record: dict[str, Any]) -> None:
        new.append(record)
        _print(record)

    pages = _Pages(watched, output)
    with _stopped_by_signals() as stop:
        if not once:
            note(f"Watching {folder}. The page is {output / 'watch.html'}. Ctrl-C ends.")
        watched.run(stop, once=once, interval=interval, report=report, looked=pages.update, failed=_note_failure)
        pages.update()
    note(f"{counted(len(new), 'new file')}. The state, the tables and the page are in {output}.")
    if once and any(record["status"] == ALARM for record in new):
        raise typer.Exit(_NOT_AS_PREDICTED)


class _Pages:
    """The table and the page, which are written again when there are new records."""

    def __init__(self, watched: Watch, output: Path) -> None:
        self._watched, self._output, self._written = watched, output, -1

    def update(self) -> None:
        """Write them if there is something new."""
        from dovetail.report.monitoring import write_watch

        count = len(self._watched.records)
        if count != self._written:
            write_watch(self._watched, self._output, self._watched.reference.series.name)
            self._written = count


def _print(record: dict[str, Any]) -> None:
    """Print a line for a file; what asks for attention goes to stderr."""
    from dovetail.monitoring import ALARM, DUPLICATE, SET_ASIDE
    from dovetail.units import format_quantity

    name = record["file"]
    if record["status"] in (SET_ASIDE, DUPLICATE):
        word = "Set aside" if record["status"] == SET_ASIDE else "Not counted again"
        note(f"{word}: {name}: {record['reason']}")
        return
    values = (f"{key} {format_quantity(one['value'], one['unit'])}" for key, one in record["parameters"].items())
    equivalent = (
        f"equivalent {key} {format_quantity(one['value'], one['unit'], 3)}" for key, one in record["equivalent"].items()
    )
    say(f"{record['number']}  {name}  {record['status']}  {', '.join([*values, *equivalent])}")
    for remark in record["notes"]:
        note(f"  {name}: {remark}")
    if record["status"] == ALARM:
        say_on_stderr(f"ALARM at {name} ({record['date']}): {' '.join(record['reasons'])}")


def _note_failure(error: DovetailError) -> None:
    note(f"{error} The watch goes on.")


@contextmanager
def _stopped_by_signals() -> Iterator[threading.Event]:
    """Yield an event that Ctrl-C or a request to end sets; the second one ends at once."""
    stop = threading.Event()
    numbers = [signal.SIGINT, signal.SIGTERM]
    before = {number: signal.getsignal(number) for number in numbers}

    def ask(number: int, _frame: FrameType | None) -> None:
        stop.set()
        signal.signal(number, before[signal.Signals(number)])

    try:
        for number in numbers:
            signal.signal(number, ask)
        yield stop
    finally:
        for number in numbers:
            signal.signal(number, before[number])
