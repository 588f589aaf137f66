"""A registry of small components, and a sound description that the tests break."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import pytest
from pydantic import Field

from dovetail import (
    ComponentConfig,
    InUnit,
    JointModel,
    JointPort,
    Parameter,
    PartNode,
    Reducer,
    Regressor,
    StructuralMatrices,
    SubstructureModel,
    hookimpl,
)
from dovetail.description import read_description
from dovetail.errors import DescriptionError
from dovetail.registry import Registry

SOUND = """\
dovetail: 1
name: test
frequency: {start: 100 Hz, stop: 200 Hz, step: 2 Hz}
substructures:
  tool:
    model: rod
    material: {young: 580 GPa, density: 14450 kg/m^3}
    sections: [{length: 100 mm, outer: 10 mm, elements: 10}]
  holder:
    model: rod
    material: {young: 200 GPa, density: 7800 kg/m^3}
    sections:
      - {length: 40 mm, outer: 50 mm, elements: 4}
joints:
  collet:
    model: clamp
    connect:
      tool: {to: tool, at: [90 mm, 100 mm]}
      holder: {to: holder, at: [0 mm, 10 mm]}
    parameters:
      Dc: {range: [26 mm, 40 mm]}
      kr_tc: {range: [2e3 N m/rad, 6e4 N m/rad], scale: log}
response: {at: tool, position: 10 mm}
identification:
  samples: 100
  reducer: {model: squeeze, n_components: 5}
  regressor: {model: mlp}
"""
"""Every line of it is broken by some test; the positions in the messages are counted in it."""


class Material(ComponentConfig):
    young: Annotated[float, Field(gt=0), InUnit("Pa")]
    density: Annotated[float, Field(gt=0), InUnit("kg/m^3")]


class Section(ComponentConfig):
    length: Annotated[float, Field(gt=0), InUnit("m")]
    outer: Annotated[float, Field(gt=0), InUnit("m")]
    elements: Annotated[int, Field(ge=1, le=100)] = 1
    mesh: int | list[int] | None = None
    hollow: bool = False


class Rod(SubstructureModel):
    name = "rod"
    summary = "a rod"

    class Config(ComponentConfig):
        material: Material
        sections: Annotated[tuple[Section, ...], Field(min_length=1)]

    @property
    def nodes(self) -> tuple[PartNode, ...]:
        lengths = [s.length / s.elements for s in self.config.sections for _ in range(s.elements)]
        return tuple(PartNode(f"n{i}", float(x)) for i, x in enumerate(np.cumsum([0.0, *lengths])))

    def matrices(self) -> StructuralMatrices:
        return StructuralMatrices.zeros(2 * len(self.nodes))


class Wall(SubstructureModel):
    name = "wall"
    summary = "does not move"
    grounded = True
    nodes = (PartNode("g", 0.0),)

    def matrices(self) -> StructuralMatrices:
        return StructuralMatrices.zeros(2)


class Pair(SubstructureModel):
    name = "pair"
    summary = "two nodes at one place"
    nodes = (PartNode("left", 0.0), PartNode("right", 0.0))

    def matrices(self) -> StructuralMatrices:
        return StructuralMatrices.zeros(4)


class Clamp(JointModel):
    name = "clamp"
    summary = "a joint"
    parameters = (
        Parameter("Dc", "m", 0.02, 0.05),
        Parameter("mn1", "kg", 0.0, 0.2),
        Parameter("kr_tc", "N m/rad", 1e3, 1e5, "log"),
    )
    ports = (JointPort("tool", 2), JointPort("holder", 2))

    def matrices(self, theta: np.ndarray) -> StructuralMatrices:
        return StructuralMatrices.zeros(len(theta), self.size)


class Weld(JointModel):
    name = "weld"
    summary = "a joint without parameters"
    parameters = ()
    ports = (JointPort("a", 1), JointPort("b", 1))

    def matrices(self, theta: np.ndarray) -> StructuralMatrices:
        return StructuralMatrices.zeros(len(theta), self.size)


class Squeeze(Reducer):
    name = "squeeze"
    summary = "a reducer"

    class Config(ComponentConfig):
        n_components: Annotated[int, Field(ge=1)] = 10
        metric: Literal["correlation", "euclidean"] = "correlation"

    def fit(self, features, *, seed):
        raise NotImplementedError

    def restore(self, state):
        raise NotImplementedError


class UMAP(Squeeze):
    name = "umap"


class MLP(Regressor):
    name = "mlp"
    summary = "a regressor"

    def fit(self, features, targets, *, seed, progress=None):
        raise NotImplementedError

    def restore(self, state):
        raise NotImplementedError


class Refusing(Rod):
    name = "refusing"

    def __init__(self, _config):
        raise ValueError("the rod is too thin")


class Crashing(Rod):
    name = "crashing"

    def __init__(self, _config):
        raise KeyError("stiffness")


class Nodeless(Rod):
    name = "nodeless"

    @property
    def nodes(self):
        raise RuntimeError("no mesh")


class Empty(Rod):
    name = "empty"
    nodes = ()


class Portless(Clamp):
    name = "portless"

    @property
    def ports(self):
        return self.config.missing


class Twin(Rod):
    name = "twin"


class OtherTwin(Rod):
    name = "twin"


class _Plugin:
    def __init__(self, *components):
        self._components = components

    @hookimpl
    def dovetail_components(self):
        return list(self._components)


class _Defaults(_Plugin):
    @hookimpl
    def dovetail_defaults(self):
        return {"identification": {"reducer": {"model": "umap"}, "regressor": {"model": "mlp"}, "augmentation": {}}}


@pytest.fixture(scope="session")
def registry() -> Registry:
    registry = Registry()
    sound = [Rod, Wall, Pair, Clamp, Weld, Squeeze, UMAP, MLP]
    broken = [Refusing, Crashing, Nodeless, Empty, Portless, Twin]
    registry.add(_Defaults(*sound, *broken), "fake 1.0")
    registry.add(_Plugin(OtherTwin), "other 2.0")
    return registry


@pytest.fixture
def sound() -> str:
    return SOUND


@pytest.fixture
def read(registry, tmp_path, monkeypatch):
    """Write files (by name, the first is read) and read the description."""
    monkeypatch.chdir(tmp_path)

    def read_files(text: str | bytes, **others: str):
        for name, content in {"test": text, **others}.items():
            data = content if isinstance(content, bytes) else content.encode()
            Path(f"{name}.yaml").write_bytes(data)
        return read_description("test.yaml", registry)

    return read_files


@pytest.fixture
def message(read) -> Callable[..., str]:
    """Return the whole message of a description that cannot be used."""

    def message_of(text: str | bytes, **others: str) -> str:
        with pytest.raises(DescriptionError) as caught:
            read(text, **others)
        return str(caught.value)

    return message_of


@pytest.fixture
def broken() -> Callable[[dict[str, str]], str]:
    """Return the sound description with pieces of it replaced."""

    def broken_text(edits: dict[str, str]) -> str:
        text = SOUND
        for old, new in edits.items():
            assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in the description"
            text = text.replace(old, new)
        return text

    return broken_text


@pytest.fixture
def warnings_without_frfs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Find no warnings that take FRFs or natural frequencies, and most of the time: they have tests of their own."""
    from dovetail.assembly import description_warnings

    for name in ("_rounding_warnings", "_band_warnings"):
        monkeypatch.setattr(description_warnings, name, lambda assembly: ())
