"""``dovetail check-plugin``: whether a model fulfils its contract."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from typing import TYPE_CHECKING

import typer

from dovetail.cli.components import registry_for
from dovetail.cli.options import AsJson, ModelName, PluginFiles
from dovetail.cli.terminal import print_json, progress_bars, say, title

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dovetail.testing import CheckResult


def check_plugin(model: ModelName, plugin: PluginFiles = None, as_json: AsJson = False) -> None:
    """Check a model against its contract (the conformance kit).

    All checks for its kind are run and printed. The exit code is 1 if one fails; warnings do not change it.
    """
    from dovetail.testing import check_component

    registry = registry_for(model, plugin or ())
    with progress_bars() as progress:
        results = check_component(model, registry=registry, progress=progress)
    if as_json:
        print_json([{**asdict(result), "passed": result.passed} for result in results])
    else:
        _print(results)
    if not all(result.ok for result in results):
        raise typer.Exit(1)


def _print(results: Sequence[CheckResult]) -> None:
    for component in dict.fromkeys(result.component for result in results):
        title(component)
        own_results = [result for result in results if result.component == component]
        for result in own_results:
            say(str(result))
        counts = Counter(result.outcome for result in own_results)
        run = counts["passed"] + counts["warning"] + counts["failed"]
        say(f"{run} checks run: " + ", ".join(f"{count} {outcome}" for outcome, count in counts.items()) + ".")
