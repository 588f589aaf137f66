"""What measured FRFs are used as, compared with the DOFs that their files give.

The numbers of nodes in a file are those of the laboratory. They need not be those of a model, but they show whether an
FRF is that of a drive point, and which FRFs belong to the same point; and one node cannot be two points of a model.
"""

from __future__ import annotations

import warnings
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Frf, conversion, kind_of
from dovetail.frf.resonance_peaks import noise_deviation
from dovetail.measurement.named_points import GivenDof, ModelDof, axes_disagree, read_dof
from dovetail.measurement.point_statements import GENERAL_NOUNS, points_of_note

MOST_DELIVERED = 0.95
"""Share of the power at a drive point that is delivered above which a sign or a phase is certainly wrong: of 300 random
structures with a reversed sign and 10 % noise it was 1, of genuine measurements with an unknown delay up to 0.8."""
SUSPICIOUS = 0.25
"""Share above which there is a warning: with the right sign it was 0 for the same 300, with 30 % noise up to 0.13."""
PHASE_ERROR = 30.0
"""Degrees by which a phase may be wrong before power counts as delivered. With 20 the same 300 reached 0.34."""
_CLEAR = 5.0
"""Standard deviations of random error that a power must exceed to be counted."""
IGNORE = "If the file's DOFs are wrong, read it with `ignore_dofs=True`."
"""How to have wrong DOFs in a file ignored."""


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
        return _point_of(self.response) == _point_of(self.force)

    @property
    def name(self) -> str:
        """The file for messages."""
        return self.where or self.frf.label

    @property
    def dofs(self) -> str:
        """The DOFs in the file, in words."""
        return f"response {self.frf.response or 'unknown'}, force {self.frf.force or 'unknown'}"

    @property
    def kind(self) -> str:
        """The kind of FRF as which it is used, such as ``"displacement per force"``."""
        return kind_of(self.response.rotation, self.force.rotation)

    @property
    def use(self) -> str:
        """The DOFs at which it is used, in words."""
        if self.is_drive_point:
            return f"the drive point at {_words(self.response)}"
        return f"the response at {_words(self.response)} to a {_load(self.force)} at {_words(self.force)}"


def _point_of(dof: ModelDof) -> tuple[str, bool, str]:
    return dof.place, dof.rotation, dof.direction


def _words(dof: ModelDof) -> str:
    return f"{dof.place}{f' ({dof.direction})' if dof.direction else ' (rotation)' if dof.rotation else ''}"


def _load(dof: ModelDof) -> str:
    return "moment" if dof.rotation else "force"


class _End(NamedTuple):
    """The response or the force of an FRF: as given, and as used."""

    role: Role
    noun: str
    dof: GivenDof
    used: ModelDof


def check_roles(
    roles: Sequence[Role],
    *,
    substructures: Collection[str] = (),
    passive: bool = True,
    distinct: bool = True,
) -> None:
    """Compare the FRFs of one command with their use; every command that uses measured FRFs calls this.

    Parameters
    ----------
    roles : sequence of Role
    substructures : collection of str
        Names of the model's substructures; as the keys of a mapping to whether each of them moves.
    passive : bool
        Whether FRFs of drive points are also checked for the power that they deliver; there is a warning where it is
        considerable.
    distinct : bool
        Whether different places are different nodes.

    Raises
    ------
    MeasurementError
        The points given in a file contradict its use or those of another file, the same measurement is used at two
        places, or an FRF cannot be that of a drive point. The first contradiction is reported.

    Warns
    -----
    UserWarning
        A text names only other parts than the one at which the FRF is used, among words that are not understood, or an
        axis that a planar model does not have; or axes have other names than those of a model in space.
    """
    fault = next(contradictions(roles, substructures=substructures, distinct=distinct), None)
    if fault is not None:
        raise MeasurementError(fault)
    _warn_of_axes(roles, substructures)
    for role in roles:
        _warn_of_words(role, substructures)
        if passive and role.is_drive_point:
            _check_passive(role)


def _warn_of_axes(roles: Sequence[Role], substructures: Collection[str]) -> None:
    """Warn if axes in files have other names than those of a model in space along which the FRFs are used."""
    other = {
        (end.dof.axis, end.used.axis): end
        for role in reversed(roles)
        for end in _ends(role, substructures)
        if end.used.axis and end.dof.axis not in ("", "r", end.used.axis)
    }
    if other:
        pairs = ", ".join(f"{axis} is used as {used}" for axis, used in sorted(other))
        end = next(reversed(other.values()))
        text = f"{end.role.name}: its {end.noun} is {end.dof.text[:60]}, and it is used along {end.used.direction}"
        warnings.warn(f"{text} at {end.used.place} ({pairs}). Are the axes of the files other ones?", stacklevel=4)


def _warn_of_words(role: Role, substructures: Collection[str]) -> None:
    """Warn of words that name only another part, or another axis than a planar model has."""
    certain, loose = (_ends(role, substructures, certain=each) for each in (True, False))
    for end in [*certain, *loose]:
        text = f"{role.name}: its {end.noun} is '{end.dof.text[:60]}', and it is used at {end.used.place}"
        if end.dof.is_other_axis(end.used):
            warnings.warn(f"{text}, in a model in one plane.", stacklevel=4)
        elif end.dof.is_other_part(end.used):
            warnings.warn(f"{text}.", stacklevel=4)


def contradictions(
    roles: Sequence[Role], *, substructures: Collection[str] = (), distinct: bool = True
) -> Iterator[Fault]:
    """Yield the first contradiction of each FRF with its use, or else with another FRF, as `check_roles` finds them."""
    ends = [tuple(_ends(role, substructures)) for role in roles]
    alone = [next(_faults_alone(role, own, distinct), None) for role, own in zip(roles, ends, strict=True)]
    yield from (fault for fault in alone if fault is not None)
    sound = [(role, own) for role, own, fault in zip(roles, ends, alone, strict=True) if fault is None]
    refused = set[int]()
    for (first, one), (second, other) in combinations(enumerate(sound), 2):
        if first in refused or second in refused:
            continue
        fault = next(_faults_between(*one, *other, distinct), None)
        if fault is not None:
            refused.add(second)
            yield fault


def _faults_alone(role: Role, ends: Sequence[_End], distinct: bool) -> Iterator[Fault]:
    """Yield what the file of one FRF says that contradicts its use."""
    frf, used_as = role.frf, role.kind
    if (frf.rotation or frf.by_moment or frf.has_unit) and frf.kind != used_as:
        problem = f"its unit, {frf.unit}, is that of a {frf.kind}, and the response is a {used_as}."
        remedy = "Correct the response's 'direction' or that of its 'force', or the unit."
        yield Fault(role.name, problem, remedy=remedy)
    for end in ends:
        dof, used = end.dof, end.used
        its = f"its {end.noun}, {dof.text[:60]},"
        if dof.axis and dof.is_rotation != used.rotation:
            kinds = ("rotation or moment", "displacement or force")
            found, wanted = kinds if dof.is_rotation else kinds[::-1]
            problem = f"{its} is a {found}, and it is used as a {wanted} at {used.place}."
            yield _fault(role, problem, "Correct the 'direction' in the description, or give another FRF.")
        if dof.is_other_part(used):
            problem = f"{its} is on '{dof.named[0]}', and it is used at {used.place}."
            yield _fault(role, problem, "Correct the point in the description, or give another FRF.")
        if dof.is_other_label(used):
            problem = f"its {end.noun} is at node {dof.node or dof.label}, and it is used at node {used.label}"
            place = f", {used.place}." if used.label not in used.place else "."
            yield _fault(role, problem + place, "Correct the node in the description, or give another FRF.")
        if dof.is_elsewhere(used):
            problem = f"{its} is not at {used.place}, where it is used."
            yield _fault(role, problem, "Correct the position in the description, or give another FRF.")
        if dof.axis and used.axis and dof.named and dof.axis != used.axis:
            problem = f"{its} is along {dof.axis}, and it is used along {used.direction} at {used.place}."
            yield _fault(role, problem, "Correct the 'direction' in the description, or give another FRF.")
    for first, second in sorted(combinations(ends, 2), key=lambda pair: pair[0].noun != pair[1].noun):
        if first.noun == second.noun and first.dof.other_node(second.dof):
            problem = (
                f"its file gives two points for its {first.noun}: {first.dof.text[:60]} and {second.dof.text[:60]}."
            )
            yield _fault(role, problem, "Correct the file.")
        elif first.noun == second.noun and first.dof.other_direction(second.dof):
            texts = f"{first.dof.text[:60]} and {second.dof.text[:60]}"
            yield _fault(role, f"its file gives two directions for its {first.noun}: {texts}.", "Correct the file.")
        if {first.noun, second.noun} == {"response", "force"}:
            yield from _faults_of_pair(role, first.dof, second.dof, distinct)


def _faults_of_pair(role: Role, response: GivenDof, force: GivenDof, distinct: bool) -> Iterator[Fault]:
    """Yield what the file says of response and force that contradicts its use."""
    is_same_node, is_same_place = response.same_node(force), role.response.place == role.force.place
    if (is_same_place and response.other_node(force)) or (distinct and is_same_node and not is_same_place):
        what = "a drive-point FRF" if is_same_node else "a transfer FRF between two points"
        problem = f"its file says {role.dofs}, {what}, and it is used as {role.use}."
        described = "'response' without 'force'" if is_same_node else "'response' and its 'force'"
        yield _fault(role, problem, f"Give the FRF of this use, or describe {described} as measured.")
    if axes_disagree((response, role.response), (force, role.force)):
        along = "along one" if response.axis != force.axis else "along two"
        found = "two directions" if response.axis != force.axis else "one direction"
        problem = f"its file says {role.dofs}, {found}, and it is used as {role.use} {along}."
        yield _fault(role, problem, "Give the FRF of one direction." if along == "along one" else "Give another FRF.")


def _faults_between(
    earlier: Role, ends: Sequence[_End], later: Role, other_ends: Sequence[_End], distinct: bool
) -> Iterator[Fault]:
    """Yield what the files of two FRFs say that contradicts their use."""
    for first in ends:
        for second in other_ends:
            yield from _faults_of_ends(first, second, distinct)
    uses = [{_point_of(role.response), _point_of(role.force)} for role in (earlier, later)]
    are_given = all({"response", "force"} <= {end.noun for end in own if end.dof.node} for own in (ends, other_ends))
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
    if first.other_node(second) and earlier.used.place == later.used.place:
        problem = (
            f"its file says {later.role.dofs}: node {second.node} is used as {later.used.place}, and so is node "
            f"{first.node} in {pair}."
        )
        yield _fault(later.role, problem, _EXCHANGED)
    if axes_disagree((first, earlier.used), (second, later.used)):
        if earlier.used.axis == later.used.axis:
            problem = f"its file says {later.role.dofs}, another direction than {pair}; the model has one."
        else:
            problem = f"its file says {later.role.dofs}, the same direction as {pair}; the model has two."
        yield _fault(later.role, problem, "Give FRFs of one direction.")


_EXCHANGED = (
    "Correct their order or their points. If an FRF is used by reciprocity, exchange its response and its force."
)


def _fault(role: Role, problem: str, remedy: str) -> Fault:
    return Fault(role.name, problem, remedy=f"{remedy} {role.remedy}")


def _ends(role: Role, substructures: Collection[str], *, certain: bool = True) -> Iterator[_End]:
    """Yield the points of response and force as far as the file gives them, by their names or in its note.

    Titles, and texts with words that are not understood, are yielded only if `certain` is False.
    """
    used = {"response": role.response, "force": role.force}
    texts = [("response", role.frf.response, False), ("force", role.frf.force, False)]
    if role.frf.note:
        texts += [(one.end, one.text, one.key == "title") for one in points_of_note(role.frf.note)]
    for noun, text, is_title in texts:
        for at in [used[noun]] if noun in used else [role.response]:
            dof = read_dof(text, substructures, at.labels, GENERAL_NOUNS if is_title else ()) if text else None
            if dof is None or (dof.is_certain and not is_title) != certain or (is_title and not dof.is_certain):
                continue
            if noun == "point" and not role.is_drive_point:  # of which end is open
                if {role.response.part, role.force.part} & {*dof.named, ""}:
                    continue
                dof = GivenDof(dof.text, named=dof.named)
            yield _End(role, noun, dof, at)


def _equal(first: Frf, second: Frf) -> bool:
    return np.array_equal(first.frequency, second.frequency) and np.array_equal(first.values, second.values)


def _check_passive(role: Role) -> None:
    """Refuse an FRF that cannot be that of a drive point, and warn if much power is delivered."""
    share = power_delivered(role.frf, turn=PHASE_ERROR)
    statement = f"as {role.use}, it delivers {100.0 * share:.0f} % of the power, which no passive structure does"
    if share > MOST_DELIVERED:
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
