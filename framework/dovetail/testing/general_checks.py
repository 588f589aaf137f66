"""Checks of any component constructed from its examples."""

from __future__ import annotations

import json

from dovetail.testing.outcomes import Nonconformity
from dovetail.testing.specimen import Specimen


def check_config_survives_json(specimen: Specimen) -> None:
    """Options that are written to a model's folder as JSON and read again are the same."""
    config = specimen.component.config
    written = json.dumps(config.model_dump(mode="json", by_alias=True), allow_nan=False)
    again = type(config).model_validate(json.loads(written))
    if again != config:
        raise Nonconformity(
            f"{config!r:.100} becomes, after JSON, {again!r:.100}.", "Use plain JSON values for options."
        )


def check_a_component_keeps_its_config(specimen: Specimen) -> None:
    """`config` of a component is the Config with which it was constructed."""
    config = specimen.model.Config.model_validate(dict(specimen.options))
    if specimen.model(config).config != config or specimen.component.config != config:
        raise Nonconformity(
            f"constructed from {config!r:.100} it has the config {specimen.component.config!r:.100}.",
            "Call super().__init__(config), and do not change the config.",
        )
