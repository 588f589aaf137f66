"""A bent frame as finite element programs export it: every format is written here by its published rules.

The matrices are those of `DenseStructure`, from published shape functions; nothing of the plugins is used. Numbers are
in millimetres, tonnes and seconds.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np

from support.dense_space import DenseStructure

STEEL = {"young": 210e9, "density": 7850.0, "poisson": 0.3, "loss_factor": 0.01}
SIDES = (0.012, 0.02)
LABELS = (101, 7, 103, 104, 33, 106, 12, 200)
"""Labels of the nodes, out of order as programs have them."""
LEGS = ((0.2, 4, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), (0.15, 3, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)))
"""Length, elements, direction and own x of the two legs; the second one starts at the end of the first."""
UNITS = {"length": "1 mm", "mass": "1 t", "stiffness": "1 N/mm"}
ANSYS = ("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ")


@dataclass
class Frame:
    """Matrices in mm, t and s, the node and component (1 to 6, 0 for inner DOFs) of each row, and coordinates."""

    M: np.ndarray
    K: np.ndarray
    dofs: list[tuple[int, int]]
    points: dict[int, tuple[float, float, float]]

    def reordered(self, order):
        return Frame(
            self.M[np.ix_(order, order)], self.K[np.ix_(order, order)], [self.dofs[at] for at in order], self.points
        )

    def sorted(self):
        """Rows in the order of nodes and components, as NASTRAN has them."""
        return self.reordered(sorted(range(len(self.dofs)), key=lambda row: self.dofs[row]))


def frame(loss_factor=None):
    """Return the frame; with a loss factor, also the dense structure in SI."""
    nodes, elements = 8, 7
    material = (STEEL["young"], STEEL["density"], STEEL["poisson"], loss_factor or 0.0)
    dense = DenseStructure(nodes, elements)
    points, start, first = [np.zeros(3)], np.zeros(3), 0
    for length, count, along, side in LEGS:
        dense.add_beam(first, count, length, along, side, material, SIDES)
        points += [start + np.array(along) * length * (k + 1) / count for k in range(count)]
        start, first = points[-1], first + count
    unit = np.where(np.arange(len(dense.K)) % 6 < 3, 1e-3, 1.0)
    unit[6 * nodes :] = 1e-3
    M, K = (np.outer(unit, unit) * matrix.real / 1e-3 for matrix in (dense.M, dense.K))
    dofs = [(LABELS[row // 6], row % 6 + 1) for row in range(6 * nodes)]
    dofs += [(9001 + row, 0) for row in range(len(K) - 6 * nodes)]
    places = {label: tuple((1e3 * point).tolist()) for label, point in zip(LABELS, points, strict=True)}
    return Frame(M, K, dofs, places)


def grids(model):
    lines = [
        f"GRID*   {node:16d}{0:16d}{x:16.9E}{y:16.9E}\n*       {z:16.9E}" for node, (x, y, z) in model.points.items()
    ]
    lines += [f"SPOINT  {node:8d}" for node, component in model.dofs if component == 0]
    return "\n".join(["$ nodes", *lines]) + "\n"


def dmig(name, matrix, model, *, form=6, half="lower"):
    """A matrix as NASTRAN punches it."""
    lines = [f"DMIG    {name:8s}{0:8d}{form:8d}{2:8d}{0:8d}"]
    for column, (node, component) in enumerate(model.dofs):
        rows = [row for row in range(len(matrix)) if matrix[row, column] and _stored(row, column, half)]
        if rows:
            lines.append(f"DMIG*   {name:8s}        {node:16d}{component:16d}")
        for row in rows:
            value = f"{matrix[row, column]: .9E}".replace("E", "D")
            lines.append(f"*       {model.dofs[row][0]:16d}{model.dofs[row][1]:16d}{value:>16s}")
    return "\n".join(lines) + "\n"


def _stored(row, column, half):
    return half == "both" or (row >= column if half == "lower" else row <= column)


def write_dmig(folder, model=None, **options):
    model = (model or frame()).sorted()
    (folder / "frame.pch").write_text(
        "$ PUNCHED BY A PROGRAM\n"
        + dmig("KAAX", model.K, model, **options)
        + dmig("MAAX", model.M, model, **options)
        + grids(model)
    )
    return {"file": "frame.pch"}


def write_op4(folder, model=None, **options):
    model = (model or frame()).sorted()
    matrices = [("KGG", model.K), ("MGG", model.M), ("BXX", np.zeros((1, 1)))]
    (folder / "frame.op4").write_bytes(op4(matrices, **options))
    (folder / "frame.bdf").write_text("SOL 103\nCEND\nBEGIN BULK\n" + grids(model) + "ENDDATA\n")
    return {"file": "frame.op4", "dofs": "frame.bdf"}


def op4(matrices, *, layout="dense", binary=True, order="<", wide=False, double=True, form=6):
    """The bytes of an OUTPUT4 file: `layout` is dense, bigmat or nonbigmat; `wide` has integers of 64 bits."""
    write = _op4_binary if binary else _op4_text
    parts = [write(name, np.asarray(matrix), layout, order, wide, double, form) for name, matrix in matrices]
    return b"".join(parts)


def _strings(column):
    """Runs of entries that are not zero: first row, from 1, and values."""
    filled = np.flatnonzero(column)
    for run in np.split(filled, np.flatnonzero(np.diff(filled) > 1) + 1) if len(filled) else ():
        yield int(run[0]) + 1, column[run]


def _op4_binary(name, matrix, layout, order, wide, double, form):
    integer, real = ("q" if wide else "i"), ("d" if double or wide else "f")
    words = 2 if real == "d" and not wide else 1

    def record(content):
        length = struct.pack(f"{order}i", len(content))
        return length + content + length

    def pack(kinds, *values):
        return struct.pack(order + kinds, *values)

    rows = -len(matrix) if layout == "bigmat" else len(matrix)
    title = f"{name:8s}".encode().ljust(16 if wide else 8)
    parts = [record(pack(f"4{integer}", matrix.shape[1], rows, form, 2 if double else 1) + title)]
    for number, column in enumerate(matrix.T, start=1):
        if layout == "dense" and column.any():
            first, last = np.flatnonzero(column)[[0, -1]]
            values = column[first : last + 1]
            head = pack(f"3{integer}", number, int(first) + 1, words * len(values))
            parts.append(record(head + pack(f"{len(values)}{real}", *values)))
        elif column.any():
            body, count = b"", 0
            for first, values in _strings(column):
                length = words * len(values)
                if layout == "bigmat":
                    body += pack(f"2{integer}", length + 1, first)
                    count += length + 2
                else:
                    body += pack(integer, first + 65536 * (length + 1))
                    count += length + 1
                body += pack(f"{len(values)}{real}", *values)
            parts.append(record(pack(f"3{integer}", number, 0, count) + body))
    parts.append(record(pack(f"3{integer}", matrix.shape[1] + 1, 1, 1) + pack(real, 1.0)))
    return b"".join(parts)


def _op4_text(name, matrix, layout, order, wide, double, form):
    words, rows = (2 if double else 1), (-len(matrix) if layout == "bigmat" else len(matrix))

    def numbers(values):
        cells = [f"{value:23.16E}" for value in values]
        return ["".join(cells[at : at + 3]) for at in range(0, len(cells), 3)]

    lines = [f"{matrix.shape[1]:8d}{rows:8d}{form:8d}{2 if double else 1:8d}{name:8s}1P,3E23.16"]
    for number, column in enumerate(matrix.T, start=1):
        if layout == "dense" and column.any():
            first, last = np.flatnonzero(column)[[0, -1]]
            values = column[first : last + 1]
            lines += [f"{number:8d}{first + 1:8d}{len(values):8d}", *numbers(values)]
        elif column.any():
            body, count = [], 0
            for first, values in _strings(column):
                length = words * len(values)
                if layout == "bigmat":
                    body.append(f"{length + 1:8d}{first:8d}")
                    count += length + 2
                else:
                    body.append(f"{first + 65536 * (length + 1):12d}")
                    count += length + 1
                body += numbers(values)
            lines += [f"{number:8d}{0:8d}{count:8d}", *body]
    lines += [f"{matrix.shape[1] + 1:8d}{1:8d}{1:8d}", *numbers([1.0])]
    return ("\n".join(lines) + "\n").encode()


def abaqus_entries(matrix, model, half="lower"):
    """Lines of FORMAT=MATRIX INPUT; inner DOFs are those of internal nodes, with negative labels."""
    names = [(node, one) if one else (9000 - node, 1) for node, one in model.dofs]
    lines = []
    for column in range(len(matrix)):
        for row in range(len(matrix)):
            if (matrix[row, column] or row == column) and _stored(row, column, half):
                (i, a), (j, b) = names[row], names[column]
                lines.append(f"{i},{a}, {j},{b}, {matrix[row, column]:.15e}")
    return "\n".join(lines) + "\n"


def write_abaqus(folder, model=None, half="lower"):
    model = model or frame()
    for name, matrix in (("STIF2", model.K), ("MASS2", model.M)):
        (folder / f"frame_{name}.mtx").write_text(abaqus_entries(matrix, model, half))
    (folder / "frame.inp").write_text("*HEADING\na frame\n" + nodes_of_abaqus(model))
    return {"stiffness": "frame_STIF2.mtx", "mass": "frame_MASS2.mtx", "coordinates": "frame.inp"}


def nodes_of_abaqus(model):
    lines = [f"{node}, {x:.12g}, {y:.12g}, {z:.12g}" for node, (x, y, z) in model.points.items()]
    return "\n".join(["*NODE, NSET=ALL", *lines]) + "\n"


def write_abaqus_rows(folder, model=None):
    """FORMAT=COORDINATE, with a table of the rows that somebody made."""
    model = model or frame()
    for name, matrix in (("K", model.K), ("M", model.M)):
        entries = [(r + 1, c + 1, matrix[r, c]) for c, r in np.argwhere(matrix.T) if r >= c]
        (folder / f"{name}.mtx").write_text("".join(f"{r} {c} {value:.15e}\n" for r, c, value in entries))
    lines = [f"{row},{node},{one}" for row, (node, one) in enumerate(model.dofs, start=1) if one]
    (folder / "dofs.csv").write_text("row,node,direction\n" + "\n".join(lines) + "\n")
    (folder / "frame.inp").write_text(nodes_of_abaqus(model))
    return {"stiffness": "K.mtx", "mass": "M.mtx", "dofs": "dofs.csv", "coordinates": "frame.inp"}


def harwell_boeing(title, matrix, *, kind="RSA"):
    """A matrix as HBMAT of Ansys writes it: one half by columns, one number in each line."""
    columns = [
        [row for row in range(len(matrix)) if matrix[row, c] and (row >= c or kind == "RUA")]
        for c in range(len(matrix))
    ]
    pointers = np.cumsum([1, *map(len, columns)])
    rows = [row + 1 for column in columns for row in column]
    values = [_fortran(matrix[row, c]) for c, column in enumerate(columns) for row in column]
    counts = len(pointers), len(rows), len(values), 0
    head = [f"{title} from ANSYS FULL file dumped into Harwell-Boeing format".ljust(80)]
    head += ["".join(f"{count:14d}" for count in (sum(counts), *counts))]
    head += [kind + " " * 11 + f"{len(matrix):14d}{len(matrix):14d}{len(rows):14d}{0:14d}"]
    head += ["(I14)           (I14)           (d25.15)            (d25.15)            "]
    return "\n".join([*head, *(f"{number:14d}" for number in (*pointers, *rows)), *values]) + "\n"


def _fortran(value):
    """A number in d25.15, as Fortran writes it: zero before the point."""
    mantissa, exponent = f"{value:.14E}".split("E")
    sign, digits = ("-" if value < 0 else ""), mantissa.replace("-", "").replace(".", "")
    return f"{sign}0.{digits}D{int(exponent) + 1:+03d}".rjust(25)


def mapping(model):
    lines = ["    Matrix Eqn          Node    DOF     "]
    for row, (node, one) in enumerate(model.dofs, start=1):
        lines.append(f"{row:14d}{node:14d}    {ANSYS[one - 1] if one else 'TEMP':4s}")
    return "\n".join(lines) + "\n"


def write_ansys(folder, model=None):
    model = model or frame()
    model = model.reordered(np.random.default_rng(3).permutation(len(model.dofs)))
    (folder / "K.matrix").write_text(harwell_boeing("Stiffness matrix", model.K))
    (folder / "M.matrix").write_text(harwell_boeing("Mass matrix", model.M))
    (folder / "K.mapping").write_text(mapping(model))
    lines = [f"{node:9d}{x:21.13f}{y:21.13f}{z:21.13f}" for node, (x, y, z) in sorted(model.points.items())]
    (folder / "frame.node").write_text("\n".join(lines) + "\n")
    return {"stiffness": "K.matrix", "mass": "M.matrix", "dofs": "K.mapping", "coordinates": "frame.node"}


WRITERS = {
    "dmig": write_dmig,
    "op4": write_op4,
    "abaqus": write_abaqus,
    "abaqus rows": write_abaqus_rows,
    "ansys": write_ansys,
}


def assembly(part, foot=("part", "node 101"), tip=("part", "node 200")):
    """A description of the part on a bushing at its foot, with the response of its tip in a skew direction."""
    substructures = part if "frame" in part else {"part": part}
    joints = {} if "frame" not in part else substructures.pop("frame")
    stiffness = {"k_x": 4e7, "k_y": 3e7, "k_z": 5e7, "k_rx": 2e4, "k_ry": 3e4, "k_rz": 1e4}
    connect = {"a": {"to": foot[0], "at": foot[1]}, "b": {"to": "base", "at": 0.0}}
    parameters = {name: {"value": value} for name, value in stiffness.items()}
    parameters |= {name.replace("k", "c"): {"value": 0.0} for name in stiffness}
    return {
        "dovetail": 1,
        "name": "frame",
        "frequency": {"start": 20.0, "stop": 3000.0, "lines": 150},
        "substructures": {**substructures, "base": {"model": "ground"}},
        "joints": {**joints, "foot": {"model": "bushing", "parameters": parameters, "connect": connect}},
        "response": {"at": tip[0], "position": tip[1], "direction": [1, 2, -1], "quantity": "receptance"},
    }


def beams():
    """The same frame of two `spatial_beam`s welded together."""
    parts, origin = {}, np.zeros(3)
    for number, (length, count, along, side) in enumerate(LEGS):
        section = {"length": length, "height": SIDES[0], "width": SIDES[1], "elements": count}
        place = {"origin": origin.tolist(), "along": list(along), "across": list(side)}
        parts[f"leg{number}"] = {"model": "spatial_beam", "material": STEEL, "sections": [section], "place": place}
        origin = origin + np.array(along) * length
    weld = {"a": {"to": "leg0", "at": "n5"}, "b": {"to": "leg1", "at": "n1"}}
    joints = {"weld": {"model": "rigid", "direction": "all", "connect": weld}}
    return assembly({**parts, "frame": joints}, ("leg0", "n1"), ("leg1", "n4"))


def imported(folder, form, **options):
    """The section of the frame in one of the formats."""
    return {
        "model": "matrices",
        **WRITERS[form](folder),
        "units": UNITS,
        "loss_factor": STEEL["loss_factor"],
        **options,
    }
