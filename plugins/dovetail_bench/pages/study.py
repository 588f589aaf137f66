"""Tables and figures of a study of settings: errors over each option, times, and the chosen values."""

from __future__ import annotations

from itertools import accumulate
from typing import TYPE_CHECKING, Any

from dovetail.pages import INK, MEASURED, RECONSTRUCTED, markdown_table, new_figure, panel_grid, style_axes
from dovetail_bench.evaluation.study import Study
from dovetail_bench.evaluation.study_plan import StudyTrial, Sweep

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TRIAL_HEADERS = ("trial", "kind", "settings", "MAE, % of range", "R2", "reducer, s", "regressor, s", "outcome")
_OPTION_HEADERS = ("option", "tried", "best of its sweep", "chosen")
_COLUMNS = 2


def trial_rows(study: Study) -> list[list[str]]:
    """Return a row for each trial: settings, validation error, R2, and the times of reducer and regressor."""
    return [_trial_row(trial) for trial in study.trials if trial.kind != "test"]


def _trial_row(trial: StudyTrial) -> list[str]:
    changes = ", ".join(f"{option} = {_text(value)}" for option, value in trial.changes.items())
    head = [str(trial.number), trial.kind, changes or "as described"]
    if trial.answer is None:
        part = "" if trial.first is None else f"{100 * trial.first:.2f} on the first part"
        return [*head, part, "", "", "", f"{trial.state}: {trial.reason}".rstrip(": ")]
    seconds = trial.answer["seconds"]
    times = [seconds.get("reducer", 0.0) + seconds.get("reduction", 0.0), seconds.get("regressor", 0.0)]
    r2 = "" if trial.answer["r2"] is None else f"{trial.answer['r2']:.3f}"
    return [*head, f"{100 * trial.answer['mae']:.2f}", r2, *(f"{time:.1f}" for time in times), trial.state]


def option_rows(study: Study) -> list[list[str]]:
    """Return a row for each option: the values that were tried, the one with the least error, and the chosen one."""
    rows = []
    for sweep in study.sweeps:
        done = [(error, value) for value, error in zip(sweep.values, _errors(study, sweep), strict=True) if error]
        best = _text(min(done, key=lambda pair: pair[0])[1]) if done else ""
        rows.append([sweep.option, ", ".join(map(_text, sweep.values)), best, chosen(study, sweep.option)])
    section = study.assembly.description.study
    search = None if section is None else section.search
    for option, tried in ({} if search is None else search.options).items():
        values = map(_text, tried) if isinstance(tried, tuple) else [" to ".join(map(_text, tried.range))]
        rows.append([option, f"{', '.join(values)} (together)", "", chosen(study, option)])
    return rows


def chosen(study: Study, option: str) -> str:
    """Return the value of an option in the best settings."""
    return _text(study.best.changes.get(option, study.described.get(option)))


def study_markdown(study: Study) -> str:
    """Return the tables of a study as Markdown: the options, all trials, and the errors on the test part."""
    answer = study.test.answer or {}
    tested = [
        [name, f"{100 * errors['mae']:.2f}", "" if errors["r2"] is None else f"{errors['r2']:.3f}"]
        for name, errors in answer.get("parameters", {}).items()
    ]
    tables = [
        markdown_table(_OPTION_HEADERS, option_rows(study)),
        markdown_table(TRIAL_HEADERS, trial_rows(study)),
        test_sentence(study) + "\n",
        markdown_table(("parameter", "MAE, % of range", "R2"), tested),
    ]
    return "\n".join(tables)


def test_sentence(study: Study) -> str:
    """Return a sentence on the errors of the best settings on the test part."""
    answer, best = study.test.answer or {}, study.best.answer or {}
    r2 = "" if answer["r2"] is None else f", R2 {answer['r2']:.3f}"
    return (
        f"Best: trial {study.best.number}, with a mean absolute error of {100 * best['mae']:.2f} % of the ranges on "
        f"the validation part. On the test part, {answer['samples']} FRFs which took no part in the choice: "
        f"{100 * answer['mae']:.2f} %{r2}."
    )


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, dict):
        return ", ".join(f"{key} {_text(entry)}" for key, entry in value.items())
    return " x ".join(map(_text, value)) if isinstance(value, (list, tuple)) else str(value)


def _errors(study: Study, sweep: Sweep) -> list[float | None]:
    answers = [study.trials[number].answer for number in sweep.trials]
    return [None if answer is None else float(answer["mae"]) for answer in answers]


def sweeps_figure(study: Study) -> Figure:
    """Draw the validation error over the values of each option, and the times of reducer and regressor.

    Parameters
    ----------
    study : Study
        With at least one sweep.

    Returns
    -------
    matplotlib.figure.Figure
        A panel for each option, with the error on the left axis and the times as bars on the right one.
    """
    figure, panels = panel_grid(len(study.sweeps), _COLUMNS, 0.8, 2.2)
    times = [_draw_sweep(axes, study, sweep) for axes, sweep in zip(panels, study.sweeps, strict=True)]
    handles: list[Any] = [handle for axes in (panels[0], times[0]) for handle in axes.get_legend_handles_labels()[0]]
    figure.legend(handles, [handle.get_label() for handle in handles], loc="outside upper right", ncols=3, fontsize=8.5)
    figure.supylabel("Mean absolute error [% of range]", fontsize=9.5, color=INK)
    return figure


def _draw_sweep(axes: Axes, study: Study, sweep: Sweep) -> Axes:
    """Draw the errors of a sweep, and the times on a second axis, which is returned."""
    positions = list(range(len(sweep.values)))
    answers = [study.trials[number].answer for number in sweep.trials]
    times = axes.twinx()
    bottom = [0.0] * len(positions)
    for stages, label, colour in (
        (("reducer", "reduction"), "reducer [s]", MEASURED),
        (("regressor",), "regressor [s]", "#c9b18a"),
    ):
        height = [0.0 if a is None else sum(a["seconds"].get(stage, 0.0) for stage in stages) for a in answers]
        times.bar(positions, height, 0.5, bottom, color=colour, alpha=0.6, label=label)
        bottom = [low + high for low, high in zip(bottom, height, strict=True)]
    times.tick_params(labelsize=7.5)
    axes.set_zorder(times.get_zorder() + 1)
    axes.patch.set_visible(False)
    errors = [float("nan") if error is None else 100 * error for error in _errors(study, sweep)]
    axes.plot(positions, errors, "o-", color=RECONSTRUCTED, linewidth=1.6, markersize=4, label="error, validation")
    axes.set_xticks(positions, [_text(value) for value in sweep.values], fontsize=7.5)
    axes.set_title(sweep.option, fontsize=9, color=INK, loc="left", parse_math=False)
    return times


def search_figure(study: Study) -> Figure:
    """Draw the validation error of each trial of a search, pruned ones with another marker, and the least so far."""
    figure = new_figure(3.4)
    axes = figure.subplots()
    style_axes(axes)
    searched = [trial for trial in study.trials if trial.kind == "search"]
    done = [(trial.number, 100 * trial.answer["mae"]) for trial in searched if trial.answer is not None]
    pruned = [(t.number, 100 * t.first) for t in searched if t.state == "pruned" and t.first is not None]
    if pruned:
        axes.plot(*zip(*pruned, strict=True), "x", color=MEASURED, label="given up on the first part of the samples")
    if done:
        numbers, errors = zip(*done, strict=True)
        axes.plot(numbers, errors, "o", color=RECONSTRUCTED, markersize=4, label="trial")
        axes.step(numbers, list(accumulate(errors, min)), where="post", color=INK, linewidth=1.0, label="least so far")
    axes.set_xlabel("Trial", fontsize=9.5, color=INK)
    axes.set_ylabel("Mean absolute error [% of range]", fontsize=9.5, color=INK)
    if done or pruned:
        axes.legend(fontsize=8.5)
    return figure
