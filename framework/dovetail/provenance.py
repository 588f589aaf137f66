"""What a result was made with: versions of packages, hashes of files, sources of components."""

from __future__ import annotations

import hashlib
import inspect
import platform
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from dovetail.assembly import Assembly
from dovetail.description.changed_joint import ChangedJoint
from dovetail.interfaces import Component, JointModel
from dovetail.registry import installed_components

_PACKAGES = ("dovetail-frf", "numpy", "scipy", "scikit-learn", "umap-learn", "torch")


def package_versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that numbers depend on."""
    return {"python": platform.python_version(), **{name: text for name in _PACKAGES if (text := _version(name))}}


@cache
def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def description_hash(text: str) -> str:
    """Return the SHA-256 of a description's text, in hexadecimal."""
    return hashlib.sha256(text.encode()).hexdigest()


def file_hash(file: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal."""
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def component_sources(assembly: Assembly) -> dict[str, str]:
    """Return the source of each component: ``"joint collet": "dovetail-frf 0.1.0"``, or a file's name."""
    description = assembly.description
    components: list[Component] = [
        *description.substructures.values(),
        *(_described(joint.connection.model) for joint in description.joints.values()),
        description.identification.reducer,
        description.identification.regressor,
    ]
    return {f"{component.kind} {component.name}": source_of(component) for component in components}


def _described(model: JointModel) -> JointModel:
    """Return the model that the description names, of a joint whose matrices are derived from it."""
    return _described(model.model) if isinstance(model, ChangedJoint) else model


def provenance(
    assembly: Assembly, measurement: Mapping[str, Any], seed: int, evaluation: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return what is needed to reproduce a result, as plain values.

    Parameters
    ----------
    assembly : Assembly
    measurement : mapping
        What is recorded of the measurement.
    seed : int
    evaluation : mapping, optional
        Of a network that took part.
    """
    description = assembly.description
    return {
        "assembly": description.name,
        "description_sha256": description_hash(description.text),
        **measurement,
        "seed": seed,
        "components": component_sources(assembly),
        "packages": package_versions(),
        "evaluation": dict(evaluation or {}),
        "description": description.text,
    }


def source_of(component: Component) -> str:
    """Return who offers a component: a distribution with its version, or the name of its file."""
    return installed_components().source_of(type(component)) or Path(inspect.getfile(type(component))).name
