"""What measured FRFs are used as, compared with the DOFs that their files give.

The numbers of nodes in a file are those of the laboratory. They need not be those of a model, but they show whether an
FRF is that of a drive point, and which FRFs belong to the same point; and one node cannot be two points of a model.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Frf, conversion
from dovetail.frf.resonance_peaks import noise_deviation
from dovetail.measurement.recording import DOF

_MOST_DELIVERED = 0.95
"""Share of the power at a drive point that is delivered above which a sign or a phase is certainly wrong: of 300 random
structures with a reversed sign and 10 % noise it was 1, of genuine measurements with an unknown delay up to 0.8."""
SUSPICIOUS = 0.25
"""Share above which there is a warning: with the right sign it was 0 for the same 300, with 30 % noise up to 0.13."""
PHASE_ERROR = 30.0
"""Degrees by which a phase may be wrong before power counts as delivered. With 20 the same 300 reached 0.34."""
_CLEAR = 5.0
"""Standard deviations of random error that a power must exceed to be counted."""
_NAME_LENGTH = 10
"""Characters of a substructure's name that a universal file keeps."""
IGNORE = "If the file's DOFs are wrong, read it with `ignore_dofs=True`."
"""How to have wrong DOFs in a file ignored."""


@dataclass(frozen=True)
class ModelDof:
    """A DOF at which an FRF is used.

    Parameters
    ----------
    place : str
        Its point in words, such as ``"tool, 10 mm"``. The same point has the same words.
    rotation : bool
        Whether it is a rotation or a moment instead of a displacement or a force.
    part : str
        Its substructure; empty if the point is of the only one.
    label : str
        The node's label.
    labels : tuple of str
        Labels of all nodes of the part.
    """

    place: str
    rotation: bool = False
    part: str = ""
    label: str = ""
    labels: tuple[str, ...] = ()


@dataclass(frozen=True)
class Role:
    """A measured FRF and the DOFs at which it is used.

    Parameters
    ----------
    frf : Frf
    response, force : ModelDof
    where : str
        The file, and the set in it, for messages; by default the FRF's label.
    remedy : str
        How to have wrong DOFs in the file ignored.
    """

    frf: Frf
    response: ModelDof
    force: ModelDof
    where: str = ""
    remedy: str = IGNORE

    @property
    def is_drive_point(self) -> bool:
        """Whether the force acts where the motion is measured, in the same direction."""
        return (self.response.place, self.response.rotation) == (self.force.place, self.force.rotation)

    @property
    def name(self) -> str:
        """The file for messages."""
        return self.where or self.frf.label

    @property
    def dofs(self) -> str:
        """The DOFs in the file, in words."""
        return f"response {self.frf.response or 'unknown'}, force {self.frf.force or 'unknown'}"

    @property
    def use(self) -> str:
        """The DOFs at which it is used, in words."""
        if self.is_drive_point:
            return f"the drive point at {_words(self.response)}"
        return f"the response at {_words(self.response)} to a {_load(self.force)} at {_words(self.force)}"


def _words(dof: ModelDof) -> str:
    return f"{dof.place}{' (rotation)' if dof.rotation else ''}"


def _load(dof: ModelDof) -> str:
    return "moment" if dof.rotation else "force"


class _GivenDof(NamedTuple):
    """A DOF as a file gives it, in lower case; what it leaves open is empty."""

    text: str
    part: str
    node: str
    axis: str

    @property
    def is_rotation(self) -> bool:
        return self.axis.startswith("r")

    def same_node(self, other: _GivenDof) -> bool:
        return self.node == other.node and (not self.part or not other.part or self.part == other.part)


class _End(NamedTuple):
    """The response or the force of an FRF: as given, and as used."""

    role: Role
    noun: str
    dof: _GivenDof
    used: ModelDof


def check_roles(
    roles: Sequence[Role], *, substructures: Sequence[str] = (), passive: bool = True, distinct: bool = True
) -> None:
    """Compare the FRFs of one command with their use; every command that uses measured FRFs calls this.

    Parameters
    ----------
    roles : sequence of Role
    substructures : sequence of str
        Names of the model's substructures.
    passive : bool
        Whether FRFs of drive points are also checked for the power that they deliver; there is a warning where it is
        considerable.
    distinct : bool
        Whether different places are different nodes.

    Raises
    ------
    MeasurementError
        The DOFs given in a file contradict its use or those of another file, the same measurement is used at two
        places, or an FRF cannot be that of a drive point. The first contradiction is reported.
    """
    fault = next(contradictions(roles, substructures=substructures, distinct=distinct), None)
    if fault is not None:
        raise MeasurementError(fault)
    for role in roles if passive else ():
        if role.is_drive_point:
            _check_passive(role)


def contradictions(
    roles: Sequence[Role], *, substructures: Sequence[str] = (), distinct: bool = True
) -> Iterator[Fault]:
    """Yield the first contradiction of each FRF with its use, or else with another FRF, as `check_roles` finds them."""
    alone = [next(_faults_alone(role, substructures, distinct), None) for role in roles]
    yield from (fault for fault in alone if fault is not None)
    sound = [role for role, fault in zip(roles, alone, strict=True) if fault is None]
    refused = set[int]()
    for (first, one), (second, other) in combinations(enumerate(sound), 2):
        if first in refused or second in refused:
            continue
        fault = next(_faults_between(one, other, distinct), None)
        if fault is not None:
            refused.add(second)
            yield fault


def _faults_alone(role: Role, substructures: Sequence[str], distinct: bool) -> Iterator[Fault]:
    """Yield what the file of one FRF says that contradicts its use."""
    ends = tuple(_ends(role))
    for end in ends:
        dof, used = end.dof, end.used
        if dof.axis and dof.is_rotation != used.rotation:
            kinds = ("rotation or moment", "displacement or force")
            found, wanted = kinds if dof.is_rotation else kinds[::-1]
            problem = f"its {end.noun}, {dof.text}, is a {found}, and it is used as a {wanted} at {used.place}."
            yield _fault(role, problem, "Correct the 'direction' in the description, or give another FRF.")
        if (named := _part_named(dof, substructures)) and used.part and used.part not in named:
            problem = f"its {end.noun}, {dof.text}, is on '{named[0]}', and it is used at {used.place}."
            yield _fault(role, problem, "Correct the point in the description, or give another FRF.")
        if _is_other_label(end, named):
            problem = f"its {end.noun} is at node {dof.node}, and it is used at node {used.label}, {used.place}."
            yield _fault(role, problem, "Correct the node in the description, or give another FRF.")
    if len(ends) == 2:
        yield from _faults_of_pair(role, ends[0].dof, ends[1].dof, distinct)


def _faults_of_pair(role: Role, response: _GivenDof, force: _GivenDof, distinct: bool) -> Iterator[Fault]:
    """Yield what the file says of response and force that contradicts its use."""
    is_same_node, is_same_place = response.same_node(force), role.response.place == role.force.place
    if (is_same_place and not is_same_node) or (distinct and is_same_node and not is_same_place):
        what = "a drive-point FRF" if is_same_node else "a transfer FRF between two points"
        problem = f"its file says {role.dofs}, {what}, and it is used as {role.use}."
        described = "'response' without 'force'" if is_same_node else "'response' and its 'force'"
        yield _fault(role, problem, f"Give the FRF of this use, or describe {described} as measured.")
    same_kind = role.response.rotation == role.force.rotation
    if same_kind and response.axis and force.axis and response.axis != force.axis:
        problem = f"its file says {role.dofs}, two directions, and it is used as {role.use} along one."
        yield _fault(role, problem, "Give the FRF of one direction.")


def _faults_between(earlier: Role, later: Role, distinct: bool) -> Iterator[Fault]:
    """Yield what the files of two FRFs say that contradicts their use."""
    for first in _ends(earlier):
        for second in _ends(later):
            yield from _faults_of_ends(first, second, distinct)
    uses = [{(role.response.place, role.response.rotation), (role.force.place, role.force.rotation)}
            for role in (earlier, later)]  # fmt: skip
    are_given = all(len(list(_ends(role))) == 2 for role in (earlier, later))
    if distinct and uses[0] != uses[1] and not are_given and _equal(earlier.frf, later.frf):
        problem = (
            f"it holds the same values as {earlier.name}, which is used as {earlier.use}, and is used as {later.use}."
        )
        yield Fault(later.name, problem, remedy="Give a measurement of its own for each.")


def _faults_of_ends(earlier: _End, later: _End, distinct: bool) -> Iterator[Fault]:
    """Yield what the files of two FRFs say of a DOF that contradicts their use."""
    first, second = earlier.dof, later.dof
    pair = f"{earlier.role.name} ({earlier.role.dofs})"
    if distinct and first.same_node(second) and earlier.used.place != later.used.place:
        problem = (
            f"its file says {later.role.dofs}: node {second.node} is used as {later.used.place}, and in {pair} "
            f"as {earlier.used.place}."
        )
        yield _fault(later.role, problem, _EXCHANGED)
    if not first.same_node(second) and earlier.used.place == later.used.place:
        problem = (
            f"its file says {later.role.dofs}: node {second.node} is used as {later.used.place}, and so is node "
            f"{first.node} in {pair}."
        )
        yield _fault(later.role, problem, _EXCHANGED)
    if earlier.used.rotation == later.used.rotation and first.axis and second.axis and first.axis != second.axis:
        problem = f"its file says {later.role.dofs}, another direction than {pair}; the model has one."
        yield _fault(later.role, problem, "Give FRFs of one direction.")


_EXCHANGED = (
    "Correct their order or their points. If an FRF is used by reciprocity, exchange its response and its force."
)


def _fault(role: Role, problem: str, remedy: str) -> Fault:
    return Fault(role.name, problem, remedy=f"{remedy} {role.remedy}")


def _ends(role: Role) -> Iterator[_End]:
    """Yield response and force as far as the file gives them."""
    for noun, text, used in (("response", role.frf.response, role.response), ("force", role.frf.force, role.force)):
        match = DOF.fullmatch("".join(text.split()))
        if match and int(match[2]):
            part, axis = (match[1] or "").lower(), (match[4] or "").lower()
            yield _End(role, noun, _GivenDof(text, part, str(int(match[2])), axis), used)


def _part_named(dof: _GivenDof, substructures: Sequence[str]) -> list[str]:
    """Return the substructures that the name in a file may mean, which it may have cut off."""
    return [name for name in substructures if dof.part and name.lower()[:_NAME_LENGTH] == dof.part]


def _is_other_label(end: _End, named: Sequence[str]) -> bool:
    """Return whether a file gives another node of the model than the one it is used at.

    Numbers are compared with the model's labels only if the substructure is named too, or where the description gives
    the labels to measured points.
    """
    labels, node = end.used.labels, end.dof.node
    is_comparable = end.used.part in named if end.used.part else True
    return is_comparable and node in labels and end.used.label in labels and node != end.used.label


def _equal(first: Frf, second: Frf) -> bool:
    return np.array_equal(first.frequency, second.frequency) and np.array_equal(first.values, second.values)


def _check_passive(role: Role) -> None:
    """Refuse an FRF that cannot be that of a drive point, and warn if much power is delivered."""
    share = power_delivered(role.frf, turn=PHASE_ERROR)
    statement = f"as {role.use}, it delivers {100.0 * share:.0f} % of the power, which no passive structure does"
    if share > _MOST_DELIVERED:
        remedy = (
            "Check the sign, the phase and the points. A sensor that points the other way is given by the DOFs when "
            "the file is read or converted, as in `dofs=('1-x', '1+x')`."
        )
        raise MeasurementError(Fault(role.name, f"{statement}: a sign, a phase or a point is wrong.", remedy=remedy))
    if share > SUSPICIOUS:
        warnings.warn(f"{role.name}: {statement}: perhaps a phase or a point is wrong.", stacklevel=4)


def power_delivered(frf: Frf, variance: NDArray[np.float64] | None = None, *, turn: float = 0.0) -> float:
    """Return the share of the power at a drive point that the structure delivers; a passive one only takes power up.

    Parameters
    ----------
    frf, variance, turn
        As in `power_balance`.

    Returns
    -------
    float
        From 0 to 1; 0 if no power is counted.
    """
    delivered, total = power_balance(frf, variance, turn=turn)
    return delivered / total if total else 0.0


def power_balance(frf: Frf, variance: NDArray[np.float64] | None = None, *, turn: float = 0.0) -> tuple[float, float]:
    """Return the power at a drive point that the structure delivers, and the sum of that and what it takes up.

    The power is proportional to the real part of the mobility, which a reversed sign makes negative, as does a
    conjugated phase of a receptance or an accelerance. Over a resonance its integral is the square of the mode shape,
    whatever the damping; in a transfer FRF it is the product of the shapes at two points, of either sign.

    Parameters
    ----------
    frf : Frf
        Of a drive point.
    variance : (n_freq,) array, optional
        E|error|^2 of each value; by default that of the measurement, or else what the scatter from line to line shows.
    turn : float
        Degrees by which the phase may be wrong. Away from resonances force and velocity are 90 degrees apart, where the
        least error makes a power negative; lines within this distance of 90 degrees are not counted.

    Returns
    -------
    (float, float)
        Sums over the lines whose power clearly exceeds the random error. 0 if none does, of an amplitude alone, and of
        fewer than three lines whose error is unknown.
    """
    if variance is None:
        variance = frf.random_variance
    if not frf.has_phase or (variance is None and frf.frequency.size < 3):
        return 0.0, 0.0
    if variance is None:
        variance = 2.0 * noise_deviation(frf) ** 2
    to_mobility = np.abs(conversion(frf.frequency, frf.quantity, "mobility"))
    mobility = frf.to("mobility").values
    least = np.maximum(_CLEAR * to_mobility * np.sqrt(0.5 * variance), np.sin(np.radians(turn)) * np.abs(mobility))
    power = mobility.real[np.abs(mobility.real) > least]
    return -float(power[power < 0.0].sum()), float(np.abs(power).sum())
