"""A mass on a spring and a damper to the ground, both unknown."""

from __future__ import annotations

BLOCK = {
    "dovetail": 1,
    "name": "block",
    "frequency": {"start": 150, "stop": 600, "step": 2},
    "substructures": {
        "mass": {"model": "lumped", "masses": [{"mass": 1.0}]},
        "base": {"model": "ground"},
    },
    "joints": {
        "mount": {
            "model": "spring_damper",
            "direction": "x",
            "connect": {"a": {"to": "mass", "at": 0}, "b": {"to": "base", "at": 0}},
            "parameters": {"k": {"range": [1e6, 1e7]}, "c": {"range": [20, 200]}},
        }
    },
    "response": {"at": "mass", "position": 0, "quantity": "accelerance"},
}
