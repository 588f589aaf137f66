"""A mass on a spring and a damper to the ground: the smallest assembly."""

from __future__ import annotations

from typing import Any

GAUSSIAN_NETWORK: dict[str, Any] = {
    "reducer": {"model": "pca", "n_components": 30},
    "regressor": {
        "model": "mlp",
        "uncertainty": "gaussian",
        "hidden": [64, 64],
        "dropout": 0.0,
        "max_epochs": 40,
        "learning_rate": 3e-3,
    },
}
"""A small network that shows intervals, and is trained in seconds."""


def mass_on_mount(frequency: dict[str, Any], parameters: dict[str, Any], **sections: Any) -> dict[str, Any]:
    """Return the description, with these frequencies and parameters, and with further sections."""
    return {
        "dovetail": 1,
        "name": "block",
        "frequency": frequency,
        "substructures": {"mass": {"model": "lumped", "masses": [{"mass": 1.0}]}, "base": {"model": "ground"}},
        "joints": {
            "mount": {
                "model": "spring_damper",
                "direction": "x",
                "connect": {"a": {"to": "mass", "at": 0}, "b": {"to": "base", "at": 0}},
                "parameters": parameters,
            }
        },
        "response": {"at": "mass", "position": 0, "quantity": "accelerance"},
        **sections,
    }
