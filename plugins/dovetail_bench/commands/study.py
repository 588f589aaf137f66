"""``dovetail study``: the settings of the training with the smallest error."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dovetail.commands import (
    AsJson,
    AssemblyFile,
    PluginFiles,
    Scheduler,
    heading,
    load_assembly,
    note,
    print_json,
    progress_bars,
    say,
    table,
    title,
)

if TYPE_CHECKING:
    from dovetail_bench.evaluation.study import Study

_FILES = ("study.json", "study.md", "trials.csv", "best.yaml")
_SWEEPS, _SEARCH = "sweeps.png", "search.png"
_WORK = "work"


def study(
    assembly: AssemblyFile,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FOLDER", help="Folder for tables, figures and the trials.")
    ],
    plugin: PluginFiles = None,
    scheduler: Scheduler = None,
    as_json: AsJson = False,
) -> None:
    """Try out training settings.

    The section 'study:' of the description lists them: options to vary one by one, a search over several options, or
    both. The settings that are best on a validation part are evaluated once on a test part, and written as a
    description that extends the original one. The same command continues an interrupted study; run it several times
    at once to share the trials.
    """
    import dovetail_bench
    from dovetail.commands import prepare_folder

    loaded = load_assembly(assembly, plugin)
    prepare_folder(output, (*_FILES, _SWEEPS, _SEARCH), _FILES[0])
    with progress_bars() as progress:
        work = output / _WORK
        done = dovetail_bench.study(loaded, work, plugins=plugin or (), scheduler=scheduler, progress=progress)
    names = _write(done, assembly, output)
    if as_json:
        print_json(done.to_dict())
    else:
        _print(done)
    note(f"Written to {output}: {', '.join(names)}")


def _print(done: Study) -> None:
    from dovetail_bench.pages.study import TRIAL_HEADERS, option_rows, test_sentence, trial_rows

    title(f"{done.assembly.name}: settings of the training")
    table(["option", "tried", "best of its sweep", "chosen"], option_rows(done))
    heading("Trials, errors on the validation part")
    table(list(TRIAL_HEADERS), trial_rows(done), numbers=list(TRIAL_HEADERS[3:7]))
    say()
    say(test_sentence(done))


def _write(done: Study, description: Path, folder: Path) -> list[str]:
    """Write tables, figures and the best description, each atomically; return their names."""
    from dovetail.commands import csv_text, json_text, write_whole
    from dovetail.pages import png_bytes
    from dovetail_bench.pages.study import search_figure, study_markdown, sweeps_figure

    texts = {
        _FILES[0]: json_text(done.to_dict()),
        _FILES[1]: study_markdown(done),
        _FILES[2]: csv_text(_COLUMNS, _rows(done)),
        _FILES[3]: _best(done, description, folder),
    }
    files = {name: text.encode("utf-8", "replace") for name, text in texts.items()}
    if done.sweeps:
        files[_SWEEPS] = png_bytes(sweeps_figure(done), "Error over each option")
    if any(trial.kind == "search" for trial in done.trials):
        files[_SEARCH] = png_bytes(search_figure(done), "Error of each trial")
    for name, content in files.items():
        write_whole(folder / name, content, overwrite=True)
    return list(files)


_COLUMNS = (
    "trial", "kind", "settings", "state", "mae", "r2", "reducer_s", "reduction_s", "regressor_s", "first_part_mae",
    "reason",
)  # fmt: skip


def _rows(done: Study) -> list[list[Any]]:
    rows = []
    for trial in done.trials:
        answer = trial.answer or {}
        seconds = answer.get("seconds", {})
        times = [seconds.get(stage) for stage in ("reducer", "reduction", "regressor")]
        head = [trial.number, trial.kind, json.dumps(trial.changes), trial.state]
        rows.append([*head, answer.get("mae"), answer.get("r2"), *times, trial.first, trial.reason])
    return rows


def _best(done: Study, description: Path, folder: Path) -> str:
    """Return a description with the best settings, which extends the old one."""
    import yaml

    base = os.path.relpath(description.resolve(), folder.resolve()).replace(os.sep, "/")
    answer = done.best.answer or {}
    body: dict[str, Any] = {"extends": base}
    if done.identification:
        body["identification"] = dict(done.identification)
    head = (
        f"# The best settings that 'dovetail study' found, trial {done.best.number}: a mean absolute error of\n"
        f"# {100 * answer['mae']:.2f} % of the ranges on the validation part, "
        f"{100 * (done.test.answer or {})['mae']:.2f} % on the test part.\n"
    )
    return head + str(yaml.safe_dump(body, sort_keys=False, allow_unicode=True, width=120))
