"""What every plugin component has: a name, a summary, references and a Config that is its YAML section."""

from __future__ import annotations

from abc import ABC
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Literal

from pydantic import BaseModel, ConfigDict

__all__ = ["KINDS", "Component", "ComponentConfig", "Kind"]

Kind = Literal["substructure", "joint", "reducer", "regressor"]
KINDS: tuple[Kind, ...] = ("substructure", "joint", "reducer", "regressor")


class ComponentConfig(BaseModel):
    """Base of every component's options: frozen, and a key it does not know is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Component(ABC):
    """A recipe that a description names: constructed with its Config, never changed afterwards.

    Attributes
    ----------
    kind : str
        Which of the four contracts it fulfils; set by the contract's base class.
    name : str
        The word after ``model:`` in a description.
    summary : str
        One line for ``dovetail plugins``.
    references : tuple of str
        Where the model is published.
    """

    kind: ClassVar[Kind]
    name: ClassVar[str]
    summary: ClassVar[str]
    references: ClassVar[tuple[str, ...]] = ()

    class Config(ComponentConfig):
        """A component without options."""

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return sets of options, as a description has them, with which ``dovetail check-plugin`` tries the component.

        One set without any option unless overridden, which a component with options that have no default must do.

        Parameters
        ----------
        folder : Path
            An empty folder, for files that options name.
        """
        return ({},)

    def __init__(self, config: Any = None) -> None:
        self.config: Any = self.Config() if config is None else config

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.config!r})"
