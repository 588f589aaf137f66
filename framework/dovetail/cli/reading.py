"""Options for reading measured files: their contents, and the choice of an FRF."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

import typer

from dovetail.cli.bundles import Command, bundled
from dovetail.cli.options import PluginFiles, quantity_in
from dovetail.cli.terminal import note

if TYPE_CHECKING:
    from dovetail.frf import Frf

_Given = TypeVar("_Given")
_HEAVY = 0.1
"""Mass [kg] of an accelerometer above which a number without a unit was probably meant in grams."""

QuantityOfFile = Annotated[
    str | None,
    typer.Option(
        "--quantity", metavar="QUANTITY", help="receptance, mobility or accelerance, if the file does not say."
    ),
]
UnitOfFile = Annotated[
    str | None,
    typer.Option("--unit", metavar="UNIT", help="Unit of the values, such as um/N or g/N, if the file does not say."),
]
Index = Annotated[
    int | None, typer.Option("--index", metavar="N", min=1, help="Number of the FRF in a file with several, from 1.")
]
ResponseDof = Annotated[
    str | None, typer.Option("--response", metavar="DOF", help="Response DOF of the FRF to read, such as 5+x.")
]
ForceDof = Annotated[
    str | None, typer.Option("--force", metavar="DOF", help="Force DOF of the FRF to read, such as 1+x.")
]
Indices = Annotated[
    list[int] | None,
    typer.Option(
        "--index", metavar="N", min=1, help="Number of the FRF in a file with several, from 1; one per response."
    ),
]
ResponseDofs = Annotated[
    list[str] | None,
    typer.Option("--response", metavar="DOF", help="Response DOF of the FRF to read, such as 5+x; one per response."),
]
ForceDofs = Annotated[
    list[str] | None,
    typer.Option("--force", metavar="DOF", help="Force DOF of the FRF to read, such as 1+x; one per response."),
]
Names = Annotated[
    list[str] | None,
    typer.Option("--name", metavar="PART=NAME", help="Name of a field in the file, as in values=H1. May be repeated."),
]
Columns = Annotated[
    str | None,
    typer.Option(
        "--columns",
        metavar="NAMES",
        help="Contents of the columns of a table, such as frequency,real,imag,skip; replaces its header.",
    ),
]
IgnoreDofs = Annotated[
    bool, typer.Option("--ignore-dofs", help="Ignore the DOFs in the file; they are not compared with the description.")
]
Reader = Annotated[
    str | None, typer.Option("--reader", metavar="NAME", help="Reader for the file, where several readers accept it.")
]


def _accelerometer_mass(text: str) -> float:
    """Return a mass in kg; a number without a unit must be as small as the mass of an accelerometer in kg."""
    mass = quantity_in("kg")(text)
    if mass > _HEAVY and text.strip()[-1:] in "0123456789.":
        raise typer.BadParameter(f"'{text}' without a unit is {mass:g} kg. Write the unit, such as '1.2 g'.")
    return mass


AccelerometerMass = Annotated[
    float,
    typer.Option(
        "--accelerometer-mass",
        metavar="MASS",
        parser=_accelerometer_mass,
        show_default=False,
        help="Mass of the accelerometer, such as '1.2 g'; its effect is removed from the FRF.",
    ),
]


@dataclass(frozen=True)
class Reading:
    """What the options of a command say about measured files.

    Parameters
    ----------
    options : mapping
        Options of `read_frf` that are set, and hold for all files.
    index, response, force : tuple
        Which FRFs are wanted; one value holds for all, several for one FRF each.
    """

    options: Mapping[str, Any]
    index: tuple[int, ...] = ()
    response: tuple[str, ...] = ()
    force: tuple[str, ...] = ()

    @property
    def accelerometer_mass(self) -> float:
        """Mass [kg] whose effect is removed."""
        return float(self.options.get("accelerometer_mass", 0.0))

    @property
    def plugins(self) -> list[Path]:
        """The plugin files."""
        return list(self.options.get("plugins", ()))

    @property
    def says_more_than_plugins(self) -> bool:
        """Whether any option is set but those for plugin files."""
        return bool(self.options.keys() - {"plugins"} or self.selection)

    @property
    def selection(self) -> dict[str, Any]:
        """The options of `read_frf` that select the one FRF that is wanted."""
        chosen = {"index": self.index, "response": self.response, "force": self.force}
        return {name: value[0] for name, value in chosen.items() if value}

    def read(self, file: Path, **more: Any) -> Frf:
        """Read one FRF, with further options; print the meaning of columns and warnings as notes."""
        import dovetail

        with warnings_as_notes():
            frf = dovetail.read_frf(file, **{**self.options, **more})
            if frf.origin:
                note(f"Read {file.name}: {frf.origin}")
        return frf

    def read_selected(self, files: Sequence[Path]) -> list[Frf]:
        """Read the FRFs that files, indices and DOFs select according to `selections`."""
        selected = selections(files, self.index, self.response, self.force)
        return [self.read(file, index=number, response=to, force=from_) for file, number, to, from_ in selected]


NOTHING_SET = Reading({})
"""The reading of a command that is called as a function."""
_CONTENTS: dict[str, tuple[Any, Any]] = {
    "quantity": (QuantityOfFile, None),
    "unit": (UnitOfFile, None),
    "names": (Names, None),
    "columns": (Columns, None),
    "ignore_dofs": (IgnoreDofs, False),
    "reader": (Reader, None),
    "plugin": (PluginFiles, None),
}
_SELECTIONS: dict[str, dict[str, tuple[Any, Any]]] = {
    "one": {"index": (Index, None), "response": (ResponseDof, None), "force": (ForceDof, None)},
    "each": {"index": (Indices, None), "response": (ResponseDofs, None), "force": (ForceDofs, None)},
    "none": {},
}
_MASS: dict[str, tuple[Any, Any]] = {"accelerometer_mass": (AccelerometerMass, 0.0)}


def with_reading(
    selects: Literal["one", "each", "none"] = "each", *, mass: bool = True
) -> Callable[[Command], Command]:
    """Give a command the options for reading measured files as its one parameter ``reading``, a `Reading`.

    Parameters
    ----------
    selects : {"one", "each", "none"}
        Whether one FRF of a file can be chosen, one for each response, or none.
    mass : bool
        Whether the mass of an accelerometer can be removed.
    """
    return bundled("reading", _SELECTIONS[selects] | _CONTENTS | (_MASS if mass else {}), _reading)


def _reading(values: dict[str, Any]) -> Reading:
    """Return the options that are set; a selection of one FRF is a selection with one value."""
    chosen = {name: values.pop(name, None) for name in ("index", "response", "force")}
    several = {
        name: tuple(value) if isinstance(value, list) else (() if value is None else (value,))
        for name, value in chosen.items()
    }
    values["names"], values["columns"] = names_of(values["names"] or []), columns_of(values["columns"])
    values["plugins"] = values.pop("plugin")
    return Reading({name: value for name, value in values.items() if value}, **several)


@contextmanager
def warnings_as_notes() -> Iterator[None]:
    """Print warnings as notes at the end of the block, each once."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        yield
    for message in dict.fromkeys(str(warning.message) for warning in caught):
        note(f"Note: {message}")


def columns_of(text: str | None) -> tuple[str, ...]:
    """Return the columns that an option names, separated by commas."""
    return tuple(name.strip() for name in text.split(",")) if text else ()


def selections(
    files: Sequence[Path], index: Sequence[int], response: Sequence[str], force: Sequence[str]
) -> list[tuple[Path, int | None, str | None, str | None]]:
    """Return file, index, response DOF and force DOF of each measured FRF.

    Parameters
    ----------
    files : sequence of Path
    index, response, force : sequences
        A single value applies to all FRFs; several values, like the files, apply to one FRF each.

    Raises
    ------
    typer.BadParameter
        Two of them differ in number.
    """
    count = max(len(files), len(index), len(response), len(force))
    for name, values in (("MEASURED", files), ("--index", index), ("--response", response), ("--force", force)):
        if len(values) not in (0, 1, count):
            raise typer.BadParameter(f"{name} is given {len(values)} times for {count} FRFs.", param_hint=name)
    options = (_each(index, count), _each(response, count), _each(force, count))
    return list(zip(list(files) * (count if len(files) == 1 else 1), *options, strict=True))


def _each(values: Sequence[_Given], count: int) -> Sequence[_Given | None]:
    if len(values) == count:
        return values
    return [values[0] if values else None] * count


def names_of(texts: Sequence[str]) -> dict[str, str]:
    """Return ``PART=NAME`` options as a mapping.

    Raises
    ------
    typer.BadParameter
        Not PART=NAME, or a repeated part.
    """
    names: dict[str, str] = {}
    for text in texts:
        part, equals, name = (word.strip() for word in text.partition("="))
        if not (part and equals and name) or part in names:
            raise typer.BadParameter(f"'{text}' is not PART=NAME, each part once.", param_hint="--name")
        names[part] = name
    return names
