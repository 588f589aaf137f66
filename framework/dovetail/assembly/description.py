"""A validated description: everything an assembly is made of, as components and numbers."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly.sections import AugmentationSection
from dovetail.frf import Quantity
from dovetail.interfaces import Parameter, Reducer, Regressor, SubstructureModel
from dovetail.synthesis import Connection
from dovetail.units import format_quantity

__all__ = ["Description", "IdentificationSettings", "JointEntry", "Response"]


@dataclass(frozen=True)
class JointEntry:
    """A joint of a description.

    Parameters
    ----------
    connection : Connection
    parameters : tuple of Parameter
        All parameters of the model in its order, with the description's ranges and scales.
    fixed : mapping of str to float
        SI values of the parameters that are known.
    """

    connection: Connection
    parameters: tuple[Parameter, ...]
    fixed: Mapping[str, float]


@dataclass(frozen=True)
class Response:
    """The drive point: a node of a substructure, a direction and the quantity reported."""

    substructure: str
    node: int
    direction: Literal["x", "rz"]
    quantity: Quantity

    @property
    def rotation(self) -> bool:
        """Whether the drive point is turned by a moment, not moved by a force."""
        return self.direction == "rz"


@dataclass(frozen=True)
class IdentificationSettings:
    """How the network is trained; without `augmentation`, on the dataset's FRFs as they are."""

    samples: int
    seed: int
    test_fraction: float
    features: Literal["log10p1"]
    reducer: Reducer
    regressor: Regressor
    augmentation: AugmentationSection | None = None


@dataclass(frozen=True)
class Description:
    """A description whose every fault has been ruled out.

    Parameters
    ----------
    name : str
    source : str
        The file it was read from, or ``<dict>``.
    text : str
        The whole description with `extends` resolved, as JSON (which is YAML): reading it again gives the same.
    frequency : (n_freq,) array
        Hz.
    substructures : mapping of str to SubstructureModel
    joints : mapping of str to JointEntry
    responses : tuple of Response
        Where force and response are measured; one of them or several.
    identification : IdentificationSettings
    """

    name: str
    source: str
    text: str
    frequency: NDArray[np.float64]
    substructures: Mapping[str, SubstructureModel]
    joints: Mapping[str, JointEntry]
    responses: tuple[Response, ...]
    identification: IdentificationSettings

    @property
    def response(self) -> Response:
        """The first of the responses: what shows a single FRF shows this one."""
        return self.responses[0]

    @property
    def response_labels(self) -> tuple[str, ...]:
        """Where each response is, for a reader: ``"tool, 10 mm"``."""
        return tuple(self._label(response) for response in self.responses)

    def _label(self, response: Response) -> str:
        nodes = self.substructures[response.substructure].nodes
        node = nodes[response.node]
        unique = sum(other.position == node.position for other in nodes) == 1
        place = format_quantity(node.position, "m") if unique else f"node {node.label}"
        return f"{response.substructure}, {place}{', rz' if response.rotation else ''}"

    def at(self, index: int) -> Description:
        """Return the description with one of its responses alone, in its text too."""
        whole = json.loads(self.text)
        if "responses" in whole:
            section = whole["responses"][index]
            whole = {"response" if key == "responses" else key: value for key, value in whole.items()}
            whole["response"] = section
        return replace(self, text=_written(whole), responses=(self.responses[index],))

    @property
    def fingerprint(self) -> str:
        """SHA-256 of everything that the FRFs depend on: frequency, substructures, joints and responses."""
        whole = json.loads(self.text)
        physics = {key: whole.get(key) for key in ("frequency", "substructures", "joints", "response")}
        if "responses" in whole:
            physics["responses"] = whole["responses"]
        return hashlib.sha256(json.dumps(physics, sort_keys=True).encode()).hexdigest()

    def with_identification(self, section: Mapping[str, object], **settings: Any) -> Description:
        """Return the description with other training, in its text and in its settings.

        Parameters
        ----------
        section : mapping
            Keys of the text's `identification` section, as they are written.
        **settings
            The same keys' values in `IdentificationSettings`.
        """
        whole = json.loads(self.text)
        whole["identification"] = {**(whole.get("identification") or {}), **section}
        return replace(self, text=_written(whole), identification=replace(self.identification, **settings))


def _written(whole: Mapping[str, Any]) -> str:
    return json.dumps(whole, indent=2, ensure_ascii=False, allow_nan=False)
