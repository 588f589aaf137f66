"""Dovetail identifies the parameters of a mechanical joint from one measured frequency response function.

The names in ``__all__`` are the public API. Each is loaded when it is first used, so that ``import dovetail`` stays
light.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.1.0"

if TYPE_CHECKING:
    from dovetail.assembly import Assembly, load
    from dovetail.coupling import ReceptanceMatrix, read_receptance, spindle_flange, write_receptance
    from dovetail.dataset import Dataset, generate
    from dovetail.errors import DovetailError, Fault
    from dovetail.frf import Frf, coherence_spectrum
    from dovetail.identification import (
        AtPoint,
        Band,
        Fit,
        Foreign,
        Identification,
        Identifier,
        Posterior,
        Verdict,
        identify,
        load_model,
        predict,
        predict_band,
        train,
    )
    from dovetail.interfaces import (
        Component,
        ComponentConfig,
        Epoch,
        FileName,
        FittedReducer,
        FittedRegressor,
        JointModel,
        Node,
        Parameter,
        Port,
        Progress,
        Reducer,
        Regressor,
        SparseMatrices,
        State,
        StructuralMatrices,
        SubstructureModel,
        silent,
    )
    from dovetail.measurement import (
        EstimatedFrf,
        add_accelerometer_mass,
        frf_from_signals,
        read_frf,
        remove_accelerometer_mass,
        without_window_damping,
        write_frf,
    )
    from dovetail.registry import hookimpl
    from dovetail.report import write_report
    from dovetail.units import InUnit

_HOMES = {
    "dovetail.assembly": ("Assembly", "load"),
    "dovetail.coupling": ("ReceptanceMatrix", "read_receptance", "spindle_flange", "write_receptance"),
    "dovetail.dataset": ("Dataset", "generate"),
    "dovetail.errors": ("DovetailError", "Fault"),
    "dovetail.frf": ("Frf", "coherence_spectrum"),
    "dovetail.identification": (
        "AtPoint",
        "Band",
        "Fit",
        "Foreign",
        "Foreign",
        "Identification",
        "Identifier",
        "Posterior",
        "Verdict",
        "identify",
        "load_model",
        "predict",
        "predict_band",
        "predict_band",
        "train",
    ),
    "dovetail.interfaces": (
        "Component",
        "ComponentConfig",
        "Epoch",
        "FileName",
        "FittedReducer",
        "FittedRegressor",
        "JointModel",
        "Node",
        "Parameter",
        "Port",
        "Progress",
        "Reducer",
        "Regressor",
        "SparseMatrices",
        "State",
        "StructuralMatrices",
        "SubstructureModel",
        "silent",
    ),
    "dovetail.measurement": (
        "EstimatedFrf",
        "add_accelerometer_mass",
        "frf_from_signals",
        "read_frf",
        "remove_accelerometer_mass",
        "without_window_damping",
        "write_frf",
    ),
    "dovetail.registry": ("hookimpl",),
    "dovetail.report": ("write_report",),
    "dovetail.units": ("InUnit",),
}
_HOME_OF = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "Assembly",
    "AtPoint",
    "Band",
    "Component",
    "ComponentConfig",
    "Dataset",
    "DovetailError",
    "Epoch",
    "EstimatedFrf",
    "Fault",
    "FileName",
    "Fit",
    "FittedReducer",
    "FittedRegressor",
    "Foreign",
    "Frf",
    "Identification",
    "Identifier",
    "InUnit",
    "JointModel",
    "Node",
    "Parameter",
    "Port",
    "Posterior",
    "Progress",
    "ReceptanceMatrix",
    "Reducer",
    "Regressor",
    "SparseMatrices",
    "State",
    "StructuralMatrices",
    "SubstructureModel",
    "Verdict",
    "add_accelerometer_mass",
    "coherence_spectrum",
    "frf_from_signals",
    "generate",
    "hookimpl",
    "identify",
    "load",
    "load_model",
    "predict",
    "predict_band",
    "read_frf",
    "read_receptance",
    "remove_accelerometer_mass",
    "silent",
    "spindle_flange",
    "train",
    "without_window_damping",
    "write_frf",
    "write_receptance",
    "write_report",
]


def __getattr__(name: str) -> object:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'dovetail' has no attribute '{name}'")
    value = getattr(import_module(_HOME_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
