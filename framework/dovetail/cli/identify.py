"""``dovetail identify``: joint parameters from the measured FRF of each response."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dovetail.cli.batch import check_batch, identify_batch, is_batch
from dovetail.cli.bundles import bundled
from dovetail.cli.commands import exit_unless_trustworthy, measurement_names, typed
from dovetail.cli.completion import complete_files, complete_methods
from dovetail.cli.interrupts import stopped_by_interrupt
from dovetail.cli.options import AsJson, Scheduler, assembly_or_model, chosen_method, part
from dovetail.cli.reading import NOTHING_SET, Reading, with_reading
from dovetail.cli.terminal import heading, print_json, progress_bars, say, table, title

if TYPE_CHECKING:
    from dovetail.assembly import Assembly
    from dovetail.frf import Frf
    from dovetail.identification import Identification, Identifier
    from dovetail.identification.truth import TrueValues
    from dovetail.interfaces import IdentificationMethod
    from dovetail.measurement import ModalParameters
    from dovetail.report.content import ParameterRow

_WORDS = ("unit", "precision", "verdict", "best fit position", "range")
"""Columns of the table of parameters, in addition to the first, that are not numbers."""

ModelOrAssembly = Annotated[
    Path,
    typer.Argument(
        metavar="MODEL_OR_ASSEMBLY",
        help="A folder that 'train' wrote, or a description (YAML).",
        autocompletion=complete_files,
    ),
]
Measurements = Annotated[
    list[Path],
    typer.Argument(
        metavar="MEASURED...",
        help="The measured FRF, one for each response; several of one response, or a folder, are a batch. "
        "Or a table of natural frequencies and damping ratios.",
        autocompletion=complete_files,
    ),
]
Method = Annotated[
    str | None,
    typer.Option(
        "--method",
        metavar="METHOD",
        help="posterior (the default, with intervals), refined (least squares), multistart, network, or a plugin's.",
        autocompletion=complete_methods,
        show_default=False,
    ),
]
WithNetwork = Annotated[
    bool | None,
    typer.Option(
        "--network/--no-network",
        show_default=False,
        help="Also train a network and list its estimates; --no-network ignores one that was trained before.",
    ),
]
Starts = Annotated[
    int | None, typer.Option(metavar="N", min=1, help="Number of searches of multistart.", show_default=False)
]
Seconds = Annotated[
    float | None,
    typer.Option(
        metavar="S",
        min=1e-3,
        show_default=False,
        help="Time limit for each measurement; the result lists the steps that were left out.",
    ),
]
PosteriorForm = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="Form of the posterior: samples, or laplace (faster).", show_default=False),
]
Samples = Annotated[
    int | None, typer.Option(metavar="N", min=1, help="Number of posterior samples.", show_default=False)
]
AllowedError = Annotated[
    float | None,
    typer.Option(
        metavar="FRACTION",
        parser=part,
        show_default=False,
        help="Relative error of natural frequencies allowed to the model; by default estimated from the measurement.",
    ),
]
CauseSeconds = Annotated[
    float | None,
    typer.Option(
        metavar="S",
        min=0.0,
        show_default=False,
        help="Time limit of the search for causes of a misfit; 20 s by default, 0 for no search.",
    ),
]
ObjectiveName = Annotated[
    str | None, typer.Option(metavar="NAME", help="Residuals in multistart: frf or weighted.", show_default=False)
]
LineWeights = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        show_default=False,
        help="Weights of the lines: coherence, or amplitude (relative errors); their random error by default.",
    ),
]
AmplitudeOnly = Annotated[bool, typer.Option("--amplitude-only", help="Ignore the phase.")]
TruthFile = Annotated[Path | None, typer.Option(metavar="FILE", help="True values of a synthetic measurement (JSON).")]
OutputFolder = Annotated[
    Path | None, typer.Option("--output", "-o", metavar="FOLDER", help="Folder for the report and other files.")
]
Retrain = Annotated[bool, typer.Option("--retrain", help="Train a new network even if one is cached.")]


_FIT: dict[str, tuple[Any, Any]] = {
    "starts": (Starts, None),
    "form": (PosteriorForm, None),
    "samples": (Samples, None),
    "model_error": (AllowedError, None),
    "cause_seconds": (CauseSeconds, None),
    "objective": (ObjectiveName, None),
}
_LINES: dict[str, tuple[Any, Any]] = {"weights": (LineWeights, None), "amplitude_only": (AmplitudeOnly, False)}
"""Options that take FRFs."""


@dataclass(frozen=True)
class _Job:
    """What is to be identified, how, and where the result goes."""

    assembly: Assembly
    measured: list[Path]
    reading: Reading
    method: IdentificationMethod
    options: Mapping[str, Any]
    seconds: float | None
    truth: Path | None
    output: Path | None
    as_json: bool
    model: Callable[[], Identifier | None]
    """Returns the network to use, which may be trained now."""

    def known(self) -> TrueValues | None:
        """Read the true values of parameters that are identified, and of those that are tied to them."""
        from dovetail.identification.reconstruction import identified_parameters
        from dovetail.identification.truth import read_truth

        if self.truth is None:
            return None
        return read_truth(self.truth, identified_parameters(self.assembly, self.assembly.vector(None)).values())


@bundled("fit", _FIT, lambda values: {name: value for name, value in values.items() if value is not None})
@bundled("lines", _LINES, dict)
@with_reading()
def identify(
    context: typer.Context,
    source: ModelOrAssembly,
    measured: Measurements,
    method: Method = None,
    network: WithNetwork = None,
    fit: Mapping[str, Any] = MappingProxyType({}),
    lines: Mapping[str, Any] = MappingProxyType({}),
    seconds: Seconds = None,
    reading: Reading = NOTHING_SET,
    truth: TruthFile = None,
    output: OutputFolder = None,
    retrain: Retrain = False,
    scheduler: Scheduler = None,
    as_json: AsJson = False,
) -> None:
    """Identify a joint from a measured FRF.

    A description with several responses takes one FRF for each, in the same order: several files, or one file with
    --index, or --response and --force, given once per response. For an assembly with one response, several files or a
    folder are a batch: they are identified independently and in parallel, and summarised in one table; failures are
    reported at the end.

    A table of natural frequencies and damping ratios (CSV) can be used instead of FRFs, by any method but the network.

    By default the parameters are fitted, with intervals and verdicts, and nothing is trained. If there is a trained
    network (a model instead of the description, or one that is cached from an earlier run), the fit starts from its
    estimate, which is listed next to the result. --network trains one if there is none. --method network returns the
    network's estimate alone, as in the publication. Networks are cached in the user's cache folder, or in
    DOVETAIL_CACHE_DIR. Files of an earlier run in the output folder are replaced.

    With --seconds the answer comes within this time, as far as the steps that have begun allow: causes of a misfit are
    left out first, then samples. Ctrl-C has the same effect at once; a second one ends the command.

    The exit code is 3 if the model does not fit the measurement; the result is still printed and written, marked so.
    """
    from dovetail.identification.one_measurement import method_for_modes
    from dovetail.measurement import is_modal_table, read_modal_parameters

    assembly, model = assembly_or_model(source, reading.plugins)
    chosen = chosen_method(method, reading.plugins, assembly, fit)
    trains = True if not chosen.fits_lines or (retrain and network is None) else network
    network_to_use = partial(_model, assembly, model, chosen, trains, reading.plugins, retrain=retrain)
    job = _Job(assembly, measured, reading, chosen, fit, seconds, truth, output, as_json, network_to_use)
    if len(measured) == 1 and is_modal_table(measured[0]):
        frf_options = network, retrain, scheduler, "cause_seconds" in fit, reading.says_more_than_plugins
        if any((*lines.values(), *frf_options)):
            raise typer.BadParameter("a table of modal parameters takes no option of an FRF.", param_hint="MEASURED")
        job = replace(job, method=method_for_modes(chosen if method else None, assembly), model=lambda: None)
        _identify_one(job, read_modal_parameters(measured[0]), typed(context))
        return
    job = replace(job, options={**fit, "weights": lines["weights"], "phase": not lines["amplitude_only"]})
    if is_batch(measured, len(assembly.description.responses)):
        _identify_each(job, scheduler)
        return
    if scheduler is not None:
        raise typer.BadParameter("it divides several measurements, and this is one.", param_hint="--scheduler")
    _identify_one(job, _checked_frfs(job, with_network=bool(trains)), typed(context))


def _identify_each(job: _Job, scheduler: str | None) -> None:
    """Identify the joint from each of several measurements."""
    from dovetail.identification.one_measurement import check_mass

    reading = job.reading
    check_mass(job.assembly, reading.accelerometer_mass)
    check_batch(job.truth, job.output, reading.index, reading.response, reading.force)
    options = {**job.options, "scheduler": scheduler, "seconds": job.seconds}
    identify_batch(
        job.assembly, job.measured, reading, job.method, job.model(), job.output, as_json=job.as_json, **options
    )


def _identify_one(job: _Job, measured: ModalParameters | list[Frf], command: str) -> None:
    """Identify the joint from one measurement, print the result and write its files."""
    import dovetail
    from dovetail.cli.output_files import writing
    from dovetail.report.result_files import FRF_FILES, MODAL_FILES, prepare_folder, write_results

    known = job.known()
    prepare_folder(job.output, FRF_FILES if isinstance(measured, list) else MODAL_FILES)
    model = job.model()
    options = {**job.options, "seconds": dovetail.TimeLimit(job.seconds), "model": model}
    with progress_bars() as progress, stopped_by_interrupt(options["seconds"]):
        result = dovetail.identify(job.assembly, measured, job.method, progress=progress, **options)
    with writing(job.output, lambda folder: write_results(result, folder, known, job.assembly, command)):
        if job.as_json:
            print_json(result.to_dict())
        else:
            _print(result, known)
    exit_unless_trustworthy(result)


def _checked_frfs(job: _Job, *, with_network: bool) -> list[Frf]:
    """Read the measured FRFs, and report faults before any work."""
    from dovetail.identification.measured_lines import MeasuredLines
    from dovetail.identification.one_measurement import check_mass

    frfs = job.reading.read_selected(job.measured)
    check_mass(job.assembly, job.reading.accelerometer_mass)
    lines = MeasuredLines.of(job.assembly, frfs)
    if with_network:
        lines.resampled(job.assembly)
    return frfs


def _model(
    assembly: Assembly,
    model: Identifier | None,
    method: IdentificationMethod,
    wanted: bool | None,
    plugins: list[Path],
    *,
    retrain: bool,
) -> Identifier | None:
    """Return the network to use: a given one, one trained on request, or a cached one."""
    from dovetail.cli.model_cache import kept_model, trained_model

    if wanted is False:
        return None
    if model is not None:
        return model
    if wanted:
        return trained_model(assembly, plugins, retrain=retrain)
    return kept_model(assembly, plugins) if method.uses_starts else None


def _print(result: Identification, truth: TrueValues | None) -> None:
    from dovetail.inference.posterior import NOT_TRUSTWORTHY
    from dovetail.report.content import fit_sentence, mode_rows

    title(f"{result.provenance['assembly']}: joint identified from {measurement_names(result)} ({result.method})")
    _print_notes(result, truth, decisive=True)
    _print_parameters(result, truth)
    heading("Natural frequencies [Hz]" if result.is_trustworthy else f"Natural frequencies [Hz], {NOT_TRUSTWORTHY}")
    modes = [
        (
            row.natural,
            row.damping,
            *((row.true_natural, row.error) if truth is not None else ("", "")),
            row.reconstructed_peak,
            row.measured_peak,
            row.measured_natural,
            row.measured_damping,
            row.difference,
        )
        for row in mode_rows(result, truth)
    ]
    known, peaks = ["identified", "damping [%]", "truth", "error [%]"], ["FRF peak", "measured peak"]
    headers = [*known, *peaks, "measured", "measured damping [%]", "difference [%]"]
    if modes:
        table(headers, modes, numbers=headers, split=True)
    else:
        say("none, as a note below says")
    say()
    if result.fit is not None:
        say(fit_sentence(result.fit, has_lines=bool(result.responses)))
    for response in result.responses:
        where = f" at {response.point}" if result.further else ""
        say(f"Mean coherence of measured and reconstructed FRF{where}: {response.mean_coherence:.3f}")
    _print_notes(result, truth, decisive=False)


def _print_notes(result: Identification, truth: TrueValues | None, *, decisive: bool) -> None:
    """Print the notes that decide what the numbers are worth, which come first, or the others, which come last."""
    from dovetail.errors import is_decisive
    from dovetail.report.content import warnings_of

    for warning in warnings_of(result, truth):
        if is_decisive(warning) == decisive:
            say(f"Note: {warning}")


def _print_parameters(result: Identification, truth: TrueValues | None) -> None:
    """Print how well the model fits, the table of parameters, its meaning, and why parameters are not identified."""
    from dovetail.inference.posterior import NOT_TRUSTWORTHY
    from dovetail.report import content

    for sentence in content.adequacy_sentences(result):
        say(sentence if result.is_trustworthy else f"Warning: {sentence}")
    rows, with_truth = content.parameter_rows(result, truth), truth is not None
    name = (
        "parameter" if result.is_trustworthy else f"parameter, {NOT_TRUSTWORTHY}"
    )  # stands before each part of the table
    shown: dict[str, Callable[[ParameterRow], str]] = {
        name: lambda row: row.identified.name,
        "estimate": lambda row: row.estimate,
        "90 % interval": lambda row: row.interval,
        "unit": lambda row: row.unit,
        "precision": lambda row: row.identified.precision,
        "verdict": _verdict,
        "truth": lambda row: row.true_value if with_truth else "",
        "error [%]": lambda row: row.error if with_truth else "",
        "network": lambda row: row.network,
        "its error [%]": lambda row: row.network_error if with_truth else "",
        "best fit": lambda row: row.best_fit,
        "best fit position": lambda row: row.best_fit_place,
        "range": lambda row: f"{row.lower} to {row.upper}",
    }
    texts = []
    for row in rows:
        texts.append([text(row) for text in shown.values()])
        for group in row.groups:
            cells = {"estimate": group.estimate, "90 % interval": group.interval, "precision": group.precision}
            texts.append([f"  {group.share}", *(cells.get(column, "") for column in [*shown][1:])])
    table(list(shown), texts, numbers=[column for column in shown if column not in (name, *_WORDS)], split=True)
    sentences = [content.columns_sentence(result), content.truth_sentence(rows)]
    if result.posterior is not None:
        sentences.append(content.posterior_sentence(result.posterior))
    if result.is_trustworthy:
        sentences += [
            f"{row.identified.name}: {row.identified.verdict}. {row.reason}"
            for row in rows
            if row.reason and not row.identified.tied_to
        ]
    if any(sentences):
        say()
    for sentence in filter(None, sentences):
        say(sentence)


def _verdict(row: ParameterRow) -> str:
    known = row.identified
    tied = f"tied to {known.tied_to}" if known.tied_to else ""
    return ", ".join(filter(None, [known.verdict, tied, "" if known.in_range else "outside its range"]))
