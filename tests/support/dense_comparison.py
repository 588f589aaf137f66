"""Everything that an assembly computes against a dense solve that is written from the published formulas alone.

An entry is held to 1e-8, unless rounding in the elements themselves moves it further: a line next to a resonance
without damping, a drive point at an antiresonance, a free structure at 1 Hz, whose stiffness hides its mass. How far it
moves is computed for each entry (`System.receptance`), and the tolerance is the larger of the two. No case is left out.
"""

from __future__ import annotations

import tempfile
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from hypothesis import HealthCheck, Phase, settings

import dovetail
from support.dense_poles import damped_poles
from support.dense_solve import DenseAssembly, System
from support.random_assemblies import Drawn

EPS = float(np.finfo(float).eps)


UNUSUAL_JOINTS = str(Path(__file__).with_name("unusual_joints.py"))


QUICK = settings(
    max_examples=100,
    derandomize=True,
    database=None,
    deadline=None,
    suppress_health_check=list(HealthCheck),
    phases=[Phase.generate],  # to shrink a failing case takes more than five minutes
)


POWER = {"receptance": 0, "mobility": 1, "accelerance": 2}


@dataclass(frozen=True)
class Settings:
    """How far an answer may be from the dense one.

    Attributes
    ----------
    relative : float
        Of the entry. What the project promises.
    rounding : float
        Of the change by a relative change of eps in all elements' entries. For sums over a hundred DOFs and some growth
        in an elimination without pivoting, in both solves.
    difference : float
        Of an entry of a joint's matrices over its parameter: what the contract of joints says of differences.
    law_difference : float
        Of the derivative of a dynamic stiffness that a joint gives itself: what the contract says of it.
    useless : float
        A tolerance that holds nothing.
    ill_posed, loose, blind : float
        Largest share of assemblies without a receptance at the response, of entries with a tolerance beyond `relative`,
        and of those with a useless one.
    """

    relative: float = 1e-8
    rounding: float = 10.0
    difference: float = 1e-12
    law_difference: float = 1e-9
    useless: float = 1e-3
    ill_posed: float = 0.2
    loose: float = 0.2
    blind: float = 0.02


SETTINGS = Settings()


@dataclass
class Tally:
    """How many assemblies and entries were compared, and how many of them under which of the settings' exceptions."""

    assemblies: int = 0
    ill_posed: int = 0
    entries: int = 0
    loose: int = 0
    blind: int = 0
    poles: int = 0
    differences: list[str] = field(default_factory=list)

    def hold(self, what: str, computed: np.ndarray, dense: np.ndarray, moved: np.ndarray, size: Any = 0.0) -> None:
        """Note an array that is not the dense one; `moved` is how far rounding may move it.

        `size` is what an entry is small against: a derivative against the FRF over the parameter.
        """
        strict = SETTINGS.relative * abs(dense)
        allowed = np.maximum(strict, moved)
        self.entries += dense.size
        size = np.maximum(abs(dense), size)
        self.loose += int(np.count_nonzero(allowed > SETTINGS.relative * size))
        self.blind += int(np.count_nonzero(allowed > SETTINGS.useless * size))
        if computed.shape != dense.shape or not np.all(abs(computed - dense) <= allowed):
            self.differences.append(f"{what}: {computed} is not {dense} within {allowed}")

    def refused(self, what: str, objection: str, ask) -> bool:
        """Return whether there is an objection; note it if Dovetail does not refuse then."""
        if objection:
            with suppress(dovetail.DovetailError):
                self.differences.append(f"{what}: {objection}, but the answer is {ask()}")
        return bool(objection)


@contextmanager
def loaded(drawn: Drawn):
    """Yield the assembly, its dense counterpart and the positions of nodes, while the description's files are there."""
    dense = DenseAssembly(drawn.description, drawn.archives)
    with tempfile.TemporaryDirectory() as folder:
        position = {
            (part, label): dense.parts[part].positions[label] for part in drawn.nodes for label in drawn.nodes[part]
        }
        description = drawn.written(Path(folder), dense.frequency, position)
        with patch("dovetail.description.reader.check_facing"):  # nets of DOFs, whose nodes lie anywhere
            assembly = dovetail.load(description, plugins=UNUSUAL_JOINTS)
        yield assembly, dense, position


def compare(drawn: Drawn, tally: Tally, with_poles: bool = True) -> None:
    """Hold everything that an assembly computes against the dense solve."""
    tally.assemblies += 1
    with loaded(drawn) as answers:
        assembly, dense, position = answers
    if [parameter.name for parameter in assembly.parameters] != dense.parameters:
        tally.differences.append(f"parameters {assembly.parameters}, not {dense.parameters}")
        return
    objection = dense.objection([drawn.response], drawn.theta[0])
    if tally.refused("frf", objection, lambda: assembly.frf(drawn.theta)):
        tally.ill_posed += 1
    else:
        hold_frf_and_jacobian(drawn, assembly, dense, tally)
    hold_rigid(drawn, assembly, dense, tally)
    hold_receptance(drawn, assembly, dense, position, tally)
    if with_poles:
        hold_natural_frequencies(drawn, assembly, dense, tally)


def hold_frf_and_jacobian(drawn: Drawn, assembly: dovetail.Assembly, dense: DenseAssembly, tally: Tally) -> None:
    """All vectors at once, as a batch."""
    factor = (2j * np.pi * dense.frequency) ** POWER[drawn.description["response"]["quantity"]]
    point = int(dense.numbering()[dense.dof(drawn.response)])
    frfs, (with_jacobian, jacobians) = assembly.frf(drawn.theta), assembly.frf_jacobian(drawn.theta)
    for theta, frf, again, jacobian in zip(drawn.theta, frfs, with_jacobian, jacobians, strict=True):
        system = dense.system(theta, [drawn.response])
        for computed in (frf, again):
            hold_entry("frf", computed, system, point, point, factor, tally)
        slopes = dense.slopes(theta, system)
        for column, (slope, moved, by_difference) in enumerate(system.derivatives(point, point, slopes)):
            parameter = assembly.parameters[column]
            step = max(abs(theta[column]), 1e-3 * (parameter.upper - parameter.lower))
            moved = SETTINGS.rounding * EPS * moved + SETTINGS.difference * by_difference[1] / step
            if dense.gives_its_own_law(column):
                moved += SETTINGS.law_difference * by_difference[0]
            computed, dense_slope = jacobian[:, column], slope * factor
            tally.hold(f"jacobian by {parameter.name}", computed, dense_slope, moved * abs(factor), abs(frf) / step)


def hold_entry(what: str, computed, system: System, row: int, column: int, factor, tally: Tally) -> None:
    """One receptance between two reduced DOFs, times a factor."""
    H, moved = system.receptance(row, column)
    tally.hold(what, computed, H * factor, SETTINGS.rounding * EPS * moved * abs(factor))


def hold_rigid(drawn: Drawn, assembly: dovetail.Assembly, dense: DenseAssembly, tally: Tally) -> None:
    """The same with all contacts of joints with unknowns rigid; their stiffness then is between DOFs that are one."""
    theta, rigid = drawn.theta[0], assembly.rigid()
    if not tally.refused("rigid frf", dense.objection([drawn.response], theta, rigid=True), lambda: rigid.frf(theta)):
        factor = (2j * np.pi * dense.frequency) ** POWER[drawn.description["response"]["quantity"]]
        point = int(dense.numbering(rigid=True)[dense.dof(drawn.response)])
        system = dense.system(theta, [drawn.response], rigid=True)
        hold_entry("rigid frf", rigid.frf(theta), system, point, point, factor, tally)


def hold_receptance(drawn: Drawn, assembly: dovetail.Assembly, dense: DenseAssembly, position, tally: Tally) -> None:
    """Between any points."""
    theta, numbers = drawn.theta[0], dense.numbering()
    outputs, inputs = (
        [(part, position[part, label], direction) for part, label, direction in points]
        for points in (drawn.outputs, drawn.inputs)
    )
    objection = dense.objection([*drawn.outputs, *drawn.inputs], theta)
    try:
        computed = assembly.receptance(theta, outputs, inputs)
    except dovetail.DovetailError as error:
        if not objection:
            tally.differences.append(f"receptance: {error}")
        return
    for row, output in enumerate(drawn.outputs):
        for column, force in enumerate(drawn.inputs):
            what, between = f"receptance {output} {force}", [int(numbers[dense.dof(end)]) for end in (output, force)]
            if not dense.coupled(output, force, theta):
                tally.hold(what, computed[:, row, column], np.zeros(len(dense.frequency)), 0.0)
            elif objection := dense.objection([output, force], theta):
                tally.differences.append(f"{what}: {objection}, but the answer is {computed[:, row, column]}")
            else:
                system = dense.system(theta, [output, force])
                hold_entry(what, computed[:, row, column], system, *between, 1.0, tally)


def hold_natural_frequencies(drawn: Drawn, assembly: dovetail.Assembly, dense: DenseAssembly, tally: Tally) -> None:
    """The lowest six elastic poles, with the contacts as they are and rigid."""
    theta = drawn.theta[0]
    no_matrices = "a part has no matrices" if drawn.tested else ""
    if tally.refused("natural frequencies", no_matrices, lambda: assembly.natural_frequencies(theta)):
        return
    for model, rigid in ((assembly, False), (assembly.rigid(), True)):
        poles, moved = damped_poles(dense, theta, rigid=rigid)
        moved = SETTINGS.rounding * EPS * moved
        known = moved <= SETTINGS.useless * abs(poles)  # others may be of rigid-body modes as well as elastic ones
        modes = model.modes(theta, count=6)
        computed = np.array([pole_of(mode) for mode in modes], dtype=complex)
        computed = computed[abs(computed) > 2 * abs(poles[~known]).max(initial=0.0)]
        poles, moved = (values[known][: max(len(computed), 6 - np.sum(~known))] for values in (poles, moved))
        tally.hold("poles", computed, poles, moved)
        tally.poles += len(poles)
        frequencies = model.natural_frequencies(theta, count=6)
        same = np.array([mode.natural_frequency for mode in modes])
        tally.hold("natural frequencies", frequencies[: len(modes)], same, 0.0)


def pole_of(mode) -> complex:
    zeta = mode.damping_ratio
    return 2 * np.pi * mode.natural_frequency * (-zeta + 1j * np.sqrt(1 - zeta**2))


def elastic_by_poles(dense: DenseAssembly, theta: list[float]) -> np.ndarray:
    """Natural frequencies [Hz] with rigid contacts, without those of which rounding leaves nothing."""
    poles, moved = damped_poles(dense, theta, rigid=True)
    return abs(poles[EPS * moved < SETTINGS.useless * abs(poles)]) / (2 * np.pi)


def check_shares(tally: Tally) -> None:
    assert tally.ill_posed <= SETTINGS.ill_posed * tally.assemblies
    assert tally.loose <= SETTINGS.loose * tally.entries
    assert tally.blind <= SETTINGS.blind * tally.entries
