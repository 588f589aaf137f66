"""The base class of every component: name, summary, references, interface versions, and options as `Config`."""

from __future__ import annotations

from abc import ABC
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Literal

from pydantic import BaseModel, ConfigDict

__all__ = ["INTERFACE_VERSION", "KINDS", "Component", "ComponentConfig", "Kind"]

Kind = Literal["substructure", "joint", "reducer", "regressor"]
KINDS: tuple[Kind, ...] = ("substructure", "joint", "reducer", "regressor")
INTERFACE_VERSION = 1
"""Version of the plugin interface; it rises with each change that can break a component."""


class ComponentConfig(BaseModel):
    """Base of every component's options: frozen, and an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Component(ABC):
    """A model that a description names; made from its options and never changed afterwards.

    Attributes
    ----------
    kind : str
        The contract that it fulfils; set by the base class of the contract.
    name : str
        The word after ``model:`` in a description.
    summary : str
        One line for ``dovetail plugins``.
    references : tuple of str
        Publications of the model.
    interface_versions : tuple of int
        Lowest and highest version of the plugin interface for which the component was written, as in ``(1, 2)``.
        Dovetail refuses the component if its `INTERFACE_VERSION` is outside this range.
    """

    kind: ClassVar[Kind]
    name: ClassVar[str]
    summary: ClassVar[str]
    references: ClassVar[tuple[str, ...]] = ()
    interface_versions: ClassVar[tuple[int, int]] = (1, 1)

    class Config(ComponentConfig):
        """A component without options."""

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return sets of options, as in a description, with which ``dovetail check-plugin`` tests the component.

        By default one set without options. A component with a required option must override this method.

        Parameters
        ----------
        folder : Path
            An empty folder for files that options name.
        """
        return ({},)

    def __init__(self, config: Any = None) -> None:
        self.config: Any = self.Config() if config is None else config

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.config!r})"
