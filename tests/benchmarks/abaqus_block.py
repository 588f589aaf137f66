"""Genuine files of Abaqus: a free steel block of solid elements against the same block as a beam in space.

    python tests/benchmarks/abaqus_block.py FOLDER

FOLDER is main/pythonDev/TestModels/testData/abaqus in a clone of jgerstmayr/EXUDYN, whose files are not copied here.
Abaqus/CAE 2021 wrote them (``*MATRIX OUTPUT, FORMAT=COORDINATE``), with input files of parts and instances. Their rows
are three DOFs of each node, in the order of the input file. The block is 4 x 1 x 1 m: its length is four times its
width, so that a beam is only a rough model of its bending.
"""

from __future__ import annotations

import argparse
import re
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import dovetail

ELEMENTS = ("C3D4", "C3D8", "C3D10", "C3D20", "C3D20R")
MATERIAL = {"young": 2e11, "density": 2900.0, "poisson": 0.3, "loss_factor": 0.001}
LENGTH, SIDE = 4.0, 1.0
MODES = 7


def table_of_dofs(input_file: Path, table: Path) -> int:
    """Write the DOFs of solid elements in the order of their nodes, and return the number of nodes."""
    block = re.search(r"^\*Node\s*\n(.*?)^\*", input_file.read_text(encoding="latin-1"), flags=re.S | re.M | re.I)
    if block is None:
        raise ValueError(f"{input_file} has no *Node.")
    nodes = [line.split(",")[0].strip() for line in block[1].splitlines() if line.strip()]
    table.write_text("".join(["node,direction\n", *(f"{node},{each}\n" for node in nodes for each in "xyz")]))
    return len(nodes)


def assembly(part: dict[str, Any], response: dict[str, Any]) -> dovetail.Assembly:
    """Return a free part."""
    described = {
        "dovetail": 1,
        "name": "block",
        "frequency": {"start": 10.0, "stop": 1000.0, "lines": 3},
        "substructures": {"block": part},
        "joints": {},
        "response": {"at": "block", "quantity": "receptance", **response},
    }
    return dovetail.load(described)


def imported(folder: Path, element: str, table: Path) -> dovetail.Assembly:
    """Return the block of one kind of element."""
    name = folder / f"block{element}"
    part = {
        "model": "matrices",
        "stiffness": f"{name}_STIF1.mtx",
        "mass": f"{name}_MASS1.mtx",
        "dofs": str(table),
        "coordinates": f"{name}.inp",
        "axes": {each: each for each in "xyz"},
        "units": {"length": "1 m", "mass": "1 kg", "stiffness": "1 N/m"},
        "loss_factor": MATERIAL["loss_factor"],
    }
    return assembly(part, {"position": "node 1", "direction": "x"})


def sorted_modes(natural: np.ndarray) -> tuple[float, float, float]:
    """Return the first natural frequencies in bending, in torsion and in extension.

    Bending is the lowest pair. The others are nearest to Saint-Venant's torsion and to a rod with lateral inertia.
    """
    young, density, poisson = (MATERIAL[name] for name in ("young", "density", "poisson"))
    rod = np.sqrt(young / density) / (2 * LENGTH) / np.sqrt(1 + (poisson * np.pi / LENGTH) ** 2 * SIDE**2 / 6)
    torsion = np.sqrt(young / 2 / (1 + poisson) * 0.140577 / density * 6) / (2 * LENGTH)
    nearest = [float(natural[2:][np.argmin(np.abs(natural[2:] - hertz))]) for hertz in (torsion, rod)]
    return float(natural[:2].mean()), nearest[0], nearest[1]


def main() -> None:
    """Print the natural frequencies of each kind of element and of the beam."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    section = {"length": LENGTH, "width": SIDE, "height": SIDE, "elements": 40}
    beam = assembly({"model": "spatial_beam", "material": MATERIAL, "sections": [section]}, {"position": 0.0})
    print("| elements | nodes | bending Hz | torsion Hz | extension Hz |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as place:
        for element in ELEMENTS:
            table = Path(place) / f"{element}.csv"
            nodes = table_of_dofs(folder / f"block{element}.inp", table)
            modes = sorted_modes(imported(folder, element, table).natural_frequencies(count=MODES))
            print(f"| {element} | {nodes} | " + " | ".join(f"{hertz:.1f}" for hertz in modes) + " |")
    modes = sorted_modes(beam.natural_frequencies(count=MODES))
    print("| beam in space | 41 | " + " | ".join(f"{hertz:.1f}" for hertz in modes) + " |")


if __name__ == "__main__":
    main()
