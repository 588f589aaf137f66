"""Virtual points: FRFs between channels and impacts around an interface as FRFs between motions and loads of a point.

The motion of channels is the sum of interface modes: the six of a rigid body and, on request, deformations of the
interface. Least squares give the motion of the point from the channels, and its load from the impacts.

References
----------
M. V. van der Seijs, D. D. van den Bosch, D. J. Rixen, D. de Klerk, An improved methodology for the virtual point
transformation of measured frequency response functions in dynamic substructuring, COMPDYN 2013.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.errors import Fault, MeasurementError, listing
from dovetail.interfaces import DIRECTIONS, carried

FLEXIBLE_MODES = (
    *("ex", "ey", "ez", "tx", "ty", "tz"),
    *("sxy", "sxz", "syz", "syx", "szx", "szy"),
    *("bxy", "bxz", "byz", "byx", "bzx", "bzy"),
)
"""Deformations of an interface, as pyFBS names them: extension, torsion, shear and bending.

``ex`` extends along x, ``tx`` twists about x, ``sxy`` shears along x over y, ``bxy`` bends x over y.
"""
TOLERANCE = 1e-6
"""Singular value, over the largest one, below which a motion of the interface is left out."""
_RESOLVED = 1e-6
"""Deviation from 1 of the share of a motion that its estimate contains; rounding leaves 1e-12."""
_CHECKED = 1e-6
"""Share of a channel that the others must determine so that it can be compared with them."""


def _flexible_modes(ways: NDArray[np.float64]) -> Mapping[str, NDArray[np.float64]]:
    """Return the displacements (n, 3) of points, at ways (n, 3) from the virtual point, by each deformation."""
    x, y, z = ways.T
    o = np.zeros(len(ways))
    columns = {
        **{"ex": (x, o, o), "ey": (o, y, o), "ez": (o, o, z)},
        **{"tx": (o, -x * z, x * y), "ty": (y * z, o, -x * y), "tz": (-y * z, x * z, o)},
        **{"sxy": (x * y, o, o), "sxz": (x * z, o, o), "syz": (o, y * z, o)},
        **{"syx": (o, x * y, o), "szx": (o, o, x * z), "szy": (o, o, y * z)},
        **{"bxy": (-x * y, x**2 / 2.0, o), "bxz": (-x * z, o, x**2 / 2.0), "byz": (o, -y * z, y**2 / 2.0)},
        **{"byx": (y**2 / 2.0, -x * y, o), "bzx": (z**2 / 2.0, o, -x * z), "bzy": (o, z**2 / 2.0, -y * z)},
    }
    return {name: np.stack(parts, axis=1) for name, parts in columns.items()}


def _flexible_turns(ways: NDArray[np.float64]) -> Mapping[str, NDArray[np.float64]]:
    """Return the rotations (n, 3) of the material at points by each deformation: half the curl of the displacements.

    These are of the second degree, so that central differences are exact with any step.
    """
    steps = [(_flexible_modes(ways + step), _flexible_modes(ways - step)) for step in np.eye(3)]
    slopes = {name: [(ahead[name] - behind[name]) / 2.0 for ahead, behind in steps] for name in FLEXIBLE_MODES}
    return {
        name: np.stack([by_y[:, 2] - by_z[:, 1], by_z[:, 0] - by_x[:, 2], by_x[:, 1] - by_y[:, 0]], axis=1) / 2.0
        for name, (by_x, by_y, by_z) in slopes.items()
    }


@dataclass(frozen=True, eq=False)
class MeasuredDofs:
    """Channels, or impacts: where and in which direction they measure or act.

    Parameters
    ----------
    names : tuple of str
    positions : (n, 3) array
        m.
    directions : (n, 3) array
        Unit vectors.
    rotational : (n,) bool array, optional
        Which are rotations or moments about their direction; none by default.
    weights : (n,) array, optional
        In the least squares; all 1 by default, 0 for one that does not count.

    Raises
    ------
    MeasurementError
        Shapes differ, a direction is not a unit vector, or a weight is negative.
    """

    names: tuple[str, ...]
    positions: NDArray[np.float64]
    directions: NDArray[np.float64]
    rotational: NDArray[np.bool_] | None = None
    weights: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        count = len(self.names)
        for name, shape in {"positions": (count, 3), "directions": (count, 3)}.items():
            array = np.asarray(getattr(self, name), dtype=np.float64)
            if array.shape != shape or not np.isfinite(array).all():
                raise MeasurementError(
                    Fault(name, f"the shape is {array.shape}, or numbers are not finite.", f"{shape}")
                )
            object.__setattr__(self, name, array)
        lengths = np.linalg.norm(self.directions, axis=1)
        if (wrong := np.flatnonzero(np.abs(lengths - 1.0) > 1e-2)).size:  # printed digits are rounded
            problem = f"the direction of '{self.names[wrong[0]]}' has the length {lengths[wrong[0]]:.4g}."
            raise MeasurementError(Fault("directions", problem, "unit vectors"))
        object.__setattr__(self, "directions", self.directions / lengths[:, np.newaxis])
        turns = np.zeros(count, dtype=np.bool_) if self.rotational is None else np.asarray(self.rotational, dtype=bool)
        weights = np.ones(count) if self.weights is None else np.asarray(self.weights, dtype=np.float64)
        for name, sizes in (("rotational", list(turns.shape)), ("weights", list(weights.shape))):
            if sizes != [count]:
                raise MeasurementError(Fault(name, f"the shape is {sizes}.", f"[{count}]"))
        if not (np.isfinite(weights).all() and (weights >= 0.0).all()):
            raise MeasurementError(Fault("weights", "a weight is negative or not finite.", "0 or more"))
        object.__setattr__(self, "rotational", turns)
        object.__setattr__(self, "weights", weights)

    def chosen(self, indices: Sequence[int]) -> MeasuredDofs:
        """Return some of them."""
        at = np.asarray(indices, dtype=np.intp)
        assert self.rotational is not None
        assert self.weights is not None
        names = tuple(self.names[index] for index in indices)
        return MeasuredDofs(names, self.positions[at], self.directions[at], self.rotational[at], self.weights[at])


def interface_modes(
    dofs: MeasuredDofs, point: ArrayLike, modes: Sequence[str], *, turning: bool = False
) -> NDArray[np.float64]:
    """Return the motion (n, m) of channels, or the work of impacts, by each motion of a point.

    Parameters
    ----------
    dofs : MeasuredDofs
    point : (3,) array
        m.
    modes : sequence of str
        Motions of a rigid body, ``x y z rx ry rz``, and deformations of `FLEXIBLE_MODES`.
    turning : bool
        Whether rotations turn with the material by the deformations, by half the curl of the displacements. By default
        deformations do not turn them, as in pyFBS.
    """
    ways = dofs.positions - np.asarray(point, dtype=np.float64)
    rigid, flexible = np.stack([carried(way) for way in ways]), _flexible_modes(ways)
    turned = _flexible_turns(ways) if turning else dict.fromkeys(FLEXIBLE_MODES, np.zeros((len(ways), 3)))
    turns = np.asarray(dofs.rotational)[:, np.newaxis]
    columns = []
    for mode in modes:
        moved = flexible.get(mode)
        if moved is None:
            moved = np.where(turns, rigid[:, 3:, DIRECTIONS.index(mode)], rigid[:, :3, DIRECTIONS.index(mode)])
        else:
            moved = np.where(turns, turned[mode], moved)
        columns.append((moved * dofs.directions).sum(axis=1))
    return np.stack(columns, axis=1)


@dataclass(frozen=True, eq=False)
class Projection:
    """Least squares that give the motions of a point from channels, or from impacts its loads.

    Parameters
    ----------
    modes : (n, m) array
        Motion of each channel by each motion of the point.
    weights : (n,) array
    tolerance : float
        Singular value, over the largest one, below which a motion is left out. The columns are scaled to one length
        before, so that units do not matter.
    """

    modes: NDArray[np.float64]
    weights: NDArray[np.float64]
    tolerance: float = TOLERANCE

    @cached_property
    def matrix(self) -> NDArray[np.float64]:
        """The matrix (m, n) of u = T y; a load f of impacts is T^T times that of the point."""
        root = np.sqrt(self.weights)
        length = np.linalg.norm(self.modes, axis=0)
        scale = np.divide(1.0, length, out=np.ones_like(length), where=length > 0.0)
        U, sizes, Vt = np.linalg.svd(root[:, np.newaxis] * self.modes * scale, full_matrices=False)
        kept = sizes > self.tolerance * sizes.max(initial=0.0)
        inverse = (Vt[kept].T / sizes[kept]) @ U[:, kept].T
        return np.asarray(scale[:, np.newaxis] * inverse * root)

    @property
    def unresolved(self) -> NDArray[np.intp]:
        """The motions that the channels do not determine, by number."""
        resolution = self.matrix @ self.modes
        lengths = np.linalg.norm(self.modes, axis=0)
        scale = np.where(lengths > 0.0, lengths, 1.0)
        deviation = np.abs(resolution - np.eye(len(resolution))) * scale[:, np.newaxis] / scale
        return np.flatnonzero(deviation.max(axis=1, initial=0.0) > _RESOLVED)

    def suspect(self, values: NDArray[np.complex128]) -> tuple[int, float] | None:
        """Return the channel without which the others fit best, and how far it is from what they say, over its size.

        Parameters
        ----------
        values : (n_freq, n, n_loads) complex array
            Motion of the channels. For impacts, the transposed matrix.

        Returns
        -------
        (int, float) or None
            Its number, and the median of the deviation over the lines; None if no channel can be compared with others.
        """
        filtered = self.modes @ self.matrix
        rest = 1.0 - np.diagonal(filtered)  # the share of a channel's error that is left in its residual
        compared = np.flatnonzero((rest > _CHECKED) & (self.weights > 0.0))
        if not len(compared):
            return None
        residual = np.linalg.norm(values - filtered @ values, axis=2)[:, compared]
        size = np.linalg.norm(values, axis=2)[:, compared]
        whole = np.linalg.norm(values, axis=(1, 2))[:, np.newaxis]
        explained = np.divide(residual**2, rest[compared] * whole**2, out=np.zeros_like(residual), where=whole > 0.0)
        worst = int(np.argmax(self.weights[compared] * explained.mean(axis=0)))
        ratio = np.divide(residual, size, out=np.zeros_like(residual), where=size > 0.0)[:, worst]
        return int(compared[worst]), float(np.median(ratio) / rest[compared[worst]])


@dataclass(frozen=True)
class VirtualPoint:
    """A point of an interface, its motions, and the channels and impacts around it.

    Parameters
    ----------
    point : three floats
        m.
    directions : tuple of str
        Motions and loads of the point: some of ``x y z rx ry rz``, in this order.
    channels, impacts : tuple of int
        Numbers of those around it.
    flexible : tuple of str
        Deformations of the interface that are estimated with the motions.
    """

    point: tuple[float, float, float]
    channels: tuple[int, ...]
    impacts: tuple[int, ...]
    directions: tuple[str, ...] = DIRECTIONS
    flexible: tuple[str, ...] = ()

    @property
    def modes(self) -> tuple[str, ...]:
        """Its motions, then the deformations."""
        return (*self.directions, *self.flexible)


@dataclass(frozen=True, eq=False)
class VirtualPoints:
    """The transformation of FRFs between channels and impacts to those between virtual points.

    Parameters
    ----------
    channels, impacts : MeasuredDofs
    points : mapping of str to VirtualPoint
    tolerance : float
        Of `Projection`.

    Raises
    ------
    MeasurementError
        The channels or the impacts around a point do not determine one of its motions.
    """

    channels: MeasuredDofs
    impacts: MeasuredDofs
    points: Mapping[str, VirtualPoint]
    tolerance: float = TOLERANCE

    def __post_init__(self) -> None:
        for name, point in self.points.items():
            if unknown := [mode for mode in point.modes if mode not in (*DIRECTIONS, *FLEXIBLE_MODES)]:
                accepted = listing((*DIRECTIONS, *FLEXIBLE_MODES))
                raise MeasurementError(Fault(name, f"'{unknown[0]}' is not a motion of an interface.", accepted))
            for noun, projection in zip(("channels", "impacts"), self._projections[name], strict=True):
                missing = [point.modes[number] for number in projection.unresolved]
                if missing := [mode for mode in missing if mode in point.directions]:
                    problem = f"its {len(projection.modes)} {noun} do not determine its motion in {', '.join(missing)}."
                    if noun == "impacts":
                        problem = f"its {len(projection.modes)} {noun} cannot load it in {', '.join(missing)}."
                    remedy = "Leave these out of 'directions', or take more that lie elsewhere or point elsewhere."
                    raise MeasurementError(Fault(name, problem, remedy=remedy))

    @cached_property
    def _projections(self) -> dict[str, tuple[Projection, Projection]]:
        """Those of channels and impacts of each point."""
        return {name: (self._of(self.channels, point, point.channels), self._of(self.impacts, point, point.impacts))
                for name, point in self.points.items()}  # fmt: skip

    def _of(self, dofs: MeasuredDofs, point: VirtualPoint, around: Sequence[int]) -> Projection:
        some = dofs.chosen(around)
        assert some.weights is not None
        return Projection(interface_modes(some, point.point, point.modes), some.weights, self.tolerance)

    @property
    def dofs(self) -> tuple[tuple[str, str], ...]:
        """The name of the point and the direction of each row of the FRFs between motions."""
        return tuple((name, each) for name, point in self.points.items() for each in point.directions)

    @property
    def modes(self) -> tuple[tuple[str, str], ...]:
        """The name of the point and the motion or deformation of each row of the FRFs with deformations."""
        return tuple((name, each) for name, point in self.points.items() for each in point.modes)

    def transformed(self, values: NDArray[np.complex128], *, deformations: bool = False) -> NDArray[np.complex128]:
        """Return the FRFs (n_freq, d, d) between the motions of the points.

        Parameters
        ----------
        values : (n_freq, n_channels, n_impacts) complex array
        deformations : bool
            Whether the deformations of the points are there too, in the order of `modes`. Parts whose interfaces
            deform are coupled by all of them; without them, an interface deforms freely.

        Raises
        ------
        MeasurementError
            The channels or the impacts around a point do not determine one of these deformations.
        """
        if deformations:
            self._check_deformations()
        out, into = self._matrices
        rows = [deformations or mode in DIRECTIONS for _, mode in self.modes]
        return np.asarray(out[rows] @ values @ into[rows].T)

    def _check_deformations(self) -> None:
        for name, point in self.points.items():
            for noun, projection in zip(("channels", "impacts"), self._projections[name], strict=True):
                if missing := [point.modes[number] for number in projection.unresolved]:
                    problem = f"its {len(projection.modes)} {noun} do not determine its deformation {missing[0]}."
                    remedy = "Leave it out of 'flexible', or take more that lie elsewhere or point elsewhere."
                    raise MeasurementError(Fault(name, problem, remedy=remedy))

    @cached_property
    def _matrices(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """T of the channels and of the impacts for all modes, (m, n) each."""
        matrices = []
        for side, dofs in enumerate((self.channels, self.impacts)):
            rows = []
            for name, point in self.points.items():
                row = np.zeros((len(point.modes), len(dofs.names)))
                around = point.impacts if side else point.channels
                row[:, list(around)] = self._projections[name][side].matrix
                rows.append(row)
            matrices.append(np.concatenate(rows))
        return matrices[0], matrices[1]

    def suspects(self, values: NDArray[np.complex128]) -> dict[str, float]:
        """Return the channel and the impact around each point that fit the others worst, and how far they are off.

        Parameters
        ----------
        values : (n_freq, n_channels, n_impacts) complex array

        Returns
        -------
        dict
            By ``"channel 'NAME'"`` or ``"impact 'NAME'"``: the deviation from what the others say, over its size,
            median over the lines; 2 for a reversed sign. Without those that the others do not determine.
        """
        deviations: dict[str, float] = {}
        sides = ("channel", self.channels, values), ("impact", self.impacts, np.swapaxes(values, 1, 2))
        for name, point in self.points.items():
            each = zip(sides, (point.channels, point.impacts), self._projections[name], strict=True)
            for (noun, dofs, matrix), around, projection in each:
                suspect = projection.suspect(matrix[:, list(around)])
                if suspect is not None:
                    deviations[f"{noun} '{dofs.names[around[suspect[0]]]}'"] = suspect[1]
        return deviations
