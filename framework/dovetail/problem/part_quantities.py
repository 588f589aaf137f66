"""The physical quantities of an assembly's known parts, and the assembly and its FRFs if one of them is different."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly, FrfModel
from dovetail.documents.option_fields import numbers_within
from dovetail.errors import DovetailError
from dovetail.interfaces import SubstructureModel
from dovetail.meanwhile import in_parts
from dovetail.problem.residuals import ModelFrfs

MOST_DOFS = 2000
"""Largest number of DOFs of a substructure that is changed; it takes too long to condense larger ones again."""

_OF_MATERIALS = ("Pa", "kg/m^3")
"""Units of moduli and densities, which are the same in all parts of one material."""

_STEP = 1e-6
"""Step of the finite differences, as the logarithm of the ratio of two values of a quantity."""

_FEWEST_APART = 4
"""Smallest number of quantities whose derivatives are worth another process."""

Apply: TypeAlias = Callable[[float], FrfModel]
"""From the amount of a change to the changed assembly."""


@dataclass(frozen=True)
class ConfigQuantity:
    """A physical quantity in a substructure's Config.

    Parameters
    ----------
    path : tuple of str or int
        Keys from the Config down, as in ``("sections", 2, "length")``.
    value : float
        SI.
    unit : str
    """

    path: tuple[str | int, ...]
    value: float
    unit: str

    @property
    def name(self) -> str:
        """As in the description: ``sections[2].length``."""
        first, *rest = self.path
        return str(first) + "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in rest)

    @property
    def place(self) -> str:
        """As for ``ComponentConfig.with_options``: ``sections.2.length``."""
        return ".".join(map(str, self.path))

    def replace(self, model: SubstructureModel, value: float) -> SubstructureModel:
        """Return the substructure with another value of the quantity."""
        return type(model)(model.config.with_options({self.place: value}))


def list_quantities(model: SubstructureModel) -> tuple[ConfigQuantity, ...]:
    """Return every physical quantity other than 0 that a substructure's Config holds."""
    numbers = (number for number in numbers_within(model.config) if number.is_single and number.unit and number.value)
    return tuple(ConfigQuantity(number.path, number.value, number.unit) for number in numbers)


def materials_in_common(assembly: Assembly) -> Iterator[tuple[tuple[str, ...], ConfigQuantity, Apply]]:
    """Yield quantities that are equal in parts of one material: the parts' names, else as `known_quantities`."""
    same: dict[ConfigQuantity, list[str]] = {}
    for name, quantity, _ in known_quantities(assembly):
        if quantity.unit in _OF_MATERIALS:
            same.setdefault(quantity, []).append(name)
    for quantity, names in same.items():
        if len(names) > 1:
            yield tuple(names), quantity, partial(_in_all, assembly, names, quantity)


def known_quantities(assembly: Assembly) -> Iterator[tuple[str, ConfigQuantity, Apply]]:
    """Yield the quantities of parts without unknown options: the part's name, the quantity, and how to change it.

    The last is a function from the logarithm of the ratio to the described value to the changed assembly.
    """
    for name, model in assembly.description.known_parts.items():
        if model.node_dofs.size <= MOST_DOFS:
            for quantity in list_quantities(model):
                yield name, quantity, partial(_with_quantity, assembly, name, quantity)


def quantity_derivatives(
    assembly: Assembly, theta: NDArray[np.float64], lines: NDArray[np.intp]
) -> NDArray[np.complex128]:
    """Return the derivatives of the FRFs by the logarithm of each of the `known_quantities`, by finite differences.

    Parameters
    ----------
    assembly : Assembly
    theta : (n_params,) array
        SI.
    lines : (m,) array
        Increasing numbers of lines, those of each response behind those of the one before.

    Returns
    -------
    (n_quantities, m) complex array
        Quantities whose part accepts no other value are left out.
    """
    values, quantities = ModelFrfs.of(assembly).at(lines).frf(theta[np.newaxis])[0], list(known_quantities(assembly))

    def derivatives(rows: NDArray[np.intp]) -> NDArray[np.complex128]:
        rates = []
        for _, _, apply in (quantities[row] for row in rows):
            try:
                changed = ModelFrfs.of(apply(_STEP)).at(lines)
            except DovetailError:
                continue
            rates.append((changed.frf(theta[np.newaxis])[0] - values) / _STEP)
        return np.array(rates, dtype=np.complex128).reshape(-1, len(lines))

    return np.concatenate(in_parts(derivatives, len(quantities), _FEWEST_APART))


def with_part(assembly: Assembly, name: str, model: SubstructureModel) -> Assembly:
    """Return the assembly on the same lines with another model of one of its parts."""
    description, alone = assembly.description, assembly.alone | {name}
    substructures = {**description.substructures, name: model}
    return assembly.with_description(replace(description, substructures=substructures), alone=alone)


def _with_quantity(assembly: Assembly, name: str, quantity: ConfigQuantity, amount: float) -> Assembly:
    model = assembly.description.substructures[name]
    return with_part(assembly, name, quantity.replace(model, quantity.value * float(np.exp(amount))))


def _in_all(assembly: Assembly, names: Iterable[str], quantity: ConfigQuantity, amount: float) -> Assembly:
    for name in names:
        assembly = _with_quantity(assembly, name, quantity, amount)
    return assembly
