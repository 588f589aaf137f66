"""``dovetail compare-models``: which of several models the measurements prefer."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dovetail.cli.options import AsJson, PluginFiles
from dovetail.cli.terminal import print_json, progress_bars, say, table, title
from dovetail.errors import Fault, ParameterError

if TYPE_CHECKING:
    from dovetail.comparison import ModelComparison


def compare_models(
    description: Annotated[
        Path, typer.Argument(metavar="DESCRIPTION", help="An assembly, or a series of tests (YAML).")
    ],
    measured: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[MEASURED]...", help="Of an assembly: one FRF for each response. A series names its own."
        ),
    ] = None,
    joints: Annotated[
        str, typer.Option("--joints", metavar="MODELS", help="Joint models to compare: collet,rigid,spring_damper.")
    ] = "",
    joint: Annotated[
        str | None, typer.Option("--joint", metavar="NAME", help="Which joint, if the assembly has several.")
    ] = None,
    roles: Annotated[
        list[str] | None,
        typer.Option(
            "--roles",
            metavar="PARAMETER=ROLES",
            help="Roles of a parameter of a series: c=shared,free or k=linear,exponential_approach. May be repeated.",
        ),
    ] = None,
    against: Annotated[
        list[Path] | None,
        typer.Option("--against", metavar="FILE", help="A further description to compare with. May be repeated."),
    ] = None,
    model_error: Annotated[
        float | None,
        typer.Option(
            metavar="FRACTION",
            min=0.0,
            help="Relative error of natural frequencies that all models are allowed; that of the best one by default.",
        ),
    ] = None,
    samples: Annotated[int, typer.Option(metavar="N", min=20, help="Number of posterior samples of each model.")] = 400,
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Seed of the searches.")] = 0,
    plugin: PluginFiles = None,
    as_json: AsJson = False,
) -> None:
    """Compare models of the same measurements by their marginal likelihoods.

    Models of a joint of an assembly, roles of the parameters of a series, or several descriptions. The table has log Z,
    the logarithm of the marginal likelihood, with its standard error, and the leave-one-out score: how well each
    measured value is predicted from all others. A sentence says which model the measurements prefer.
    """
    import dovetail

    with progress_bars() as progress:
        comparison = dovetail.compare_models(
            description,
            measured or None,
            joints=[one.strip() for one in joints.split(",") if one.strip()],
            joint=joint,
            roles=_roles(roles or []),
            against=against or (),
            model_error=model_error,
            samples=samples,
            seed=seed,
            plugins=plugin or (),
            progress=progress,
        )
    if as_json:
        print_json(comparison.to_dict())
    else:
        _print(comparison)


def _roles(given: list[str]) -> dict[str, list[str]]:
    """Return the roles by parameter, from texts with a parameter, an equals sign and words between commas."""
    roles = {}
    for text in given:
        name, equals, words = text.partition("=")
        chosen = [word.strip() for word in words.split(",") if word.strip()]
        if not equals or not name.strip() or not chosen:
            raise ParameterError(Fault("--roles", f"'{text}' gives no roles.", "PARAMETER=ROLE,ROLE"))
        roles[name.strip()] = chosen
    return roles


def _print(comparison: ModelComparison) -> None:
    title(f"{comparison.name}: {len(comparison.models)} models")
    rows = []
    for model in comparison.ranking:
        gap, gap_error = comparison.difference(model)
        score, score_error = comparison.score_difference(model)
        log_z = (
            f"{model.bounds[0]:.1f} to {model.bounds[1]:.1f}"
            if model.evidence is None
            else f"{model.evidence.log:.2f} ± {model.evidence.error:.2f}"
        )
        bounded = None in (model.evidence, comparison.ranking[0].evidence)
        below = f"> {gap:.1f}" if bounded else f"{gap:.2f} ± {gap_error:.2f}"
        first = model is comparison.ranking[0]
        worse = "" if first else f"{score:.1f} ± {score_error:.1f}"
        rows.append(
            (model.name, str(model.unknowns), model.fits, log_z, "" if first else below, f"{model.score:.1f}", worse)
        )
    headers = ["model", "unknowns", "fits", "log Z", "below the first", "leave-one-out", "below the first"]
    table(headers, rows, numbers=["unknowns", "log Z", "leave-one-out"])
    say()
    say(comparison.sentence)
    if any(one.evidence is None for one in comparison.models):
        say("Where log Z is a range, too few samples count for the marginal likelihood itself; it lies between these.")
