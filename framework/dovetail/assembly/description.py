"""A validated description: the components and numbers of which an assembly is made."""

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
        SI values of the known parameters, which are not identified.
    """

    connection: Connection
    parameters: tuple[Parameter, ...]
    fixed: Mapping[str, float]


@dataclass(frozen=True)
class Response:
    """A drive point: a node of a substructure, a direction and the quantity of its FRF."""

    substructure: str
    node: int
    direction: Literal["x", "rz"]
    quantity: Quantity

    @property
    def rotation(self) -> bool:
        """Whether a moment turns the drive point, in place of a force that moves it."""
        return self.direction == "rz"


@dataclass(frozen=True)
class IdentificationSettings:
    """Training of the network; without `augmentation` it sees the dataset's FRFs unchanged."""

    samples: int
    seed: int
    test_fraction: float
    features: Literal["log10p1"]
    reducer: Reducer
    regressor: Regressor
    augmentation: AugmentationSection | None = None


@dataclass(frozen=True)
class Description:
    """A description without faults.

    Parameters
    ----------
    name : str
    source : str
        Its file, or ``<dict>``.
    text : str
        The whole description as JSON, which is YAML too, with `extends` resolved. To read it gives this description.
    frequency : (n_freq,) array
        Hz.
    substructures : mapping of str to SubstructureModel
    joints : mapping of str to JointEntry
    responses : tuple of Response
        At least one.
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
        """The first response, whose FRF `Assembly.frf` gives."""
        return self.responses[0]

    @property
    def response_labels(self) -> tuple[str, ...]:
        """The position of each response in words: ``"tool, 10 mm"``."""
        return tuple(self._label(response) for response in self.responses)

    @property
    def identified_parameters(self) -> tuple[tuple[str, str], ...]:
        """Joint and name within the joint of each parameter to identify, in the order of ``Assembly.parameters``."""
        return tuple(
            (name, parameter.name)
            for name, joint in self.joints.items()
            for parameter in joint.parameters
            if parameter.name not in joint.fixed
        )

    def _label(self, response: Response) -> str:
        nodes = self.substructures[response.substructure].nodes
        node = nodes[response.node]
        unique = sum(other.position == node.position for other in nodes) == 1
        position = format_quantity(node.position, "m") if unique else f"node {node.label}"
        return f"{response.substructure}, {position}{', rz' if response.rotation else ''}"

    def at(self, index: int) -> Description:
        """Return the description with one of its responses only, also in its text."""
        whole = json.loads(self.text)
        if "responses" in whole:
            section = whole["responses"][index]
            whole = {"response" if key == "responses" else key: value for key, value in whole.items()}
            whole["response"] = section
        return replace(self, text=_as_json(whole), responses=(self.responses[index],))

    @property
    def fingerprint(self) -> str:
        """SHA-256 of all that determines the FRFs: frequency, substructures, joints and responses."""
        whole = json.loads(self.text)
        physics = {key: whole.get(key) for key in ("frequency", "substructures", "joints", "response")}
        if "responses" in whole:
            physics["responses"] = whole["responses"]
        return hashlib.sha256(json.dumps(physics, sort_keys=True).encode()).hexdigest()

    def with_identification(self, section: Mapping[str, object], **settings: Any) -> Description:
        """Return the description with other settings of the training.

        Parameters
        ----------
        section : mapping
            Keys of the `identification` section as they stand in the text.
        **settings
            The values of the same keys in `IdentificationSettings`.
        """
        whole = json.loads(self.text)
        whole["identification"] = {**(whole.get("identification") or {}), **section}
        return replace(self, text=_as_json(whole), identification=replace(self.identification, **settings))


def _as_json(whole: Mapping[str, Any]) -> str:
    return json.dumps(whole, indent=2, ensure_ascii=False, allow_nan=False)
