"""Measured parts in space: virtual points of channels and impacts, coupled and decoupled, against a dense solution."""

from __future__ import annotations

import csv
import warnings
from pathlib import Path

import numpy as np
import pytest

import dovetail
from dovetail import DIRECTIONS, MeasuredDofs, couple, decouple, interface_modes
from dovetail.assembly import find_warnings
from dovetail_plugins.substructures.channel_tables import read_channels, read_impacts
from support.dense_space import DenseStructure

STEEL = {"young": 2.05e11, "density": 7850.0, "poisson": 0.3, "loss_factor": 0.01}
MATERIAL = tuple(STEEL[name] for name in ("young", "density", "poisson", "loss_factor"))
FREQUENCY = np.arange(40.0, 1200.0, 10.0)
LENGTH, SIDES, ELEMENTS = 0.4, (0.03, 0.02), 4
"""The measured bar, along -y of its own, with virtual points at its ends."""
HEAD = np.array([0.0, -LENGTH, 0.0])
QUANTITIES = {"Displacement": 0, "Velocity": 1, "Acceleration": 2}


def bar_receptance(frequency=FREQUENCY):
    """Return the receptance (n_freq, 12, 12) of both ends of the free bar, by the dense solution."""
    dense = DenseStructure(ELEMENTS + 1, ELEMENTS)
    dense.add_beam(0, ELEMENTS, LENGTH, (0, -1, 0), (1, 0, 0), MATERIAL, SIDES)
    ends = np.array([*range(6), *range(6 * ELEMENTS, 6 * ELEMENTS + 6)])
    return np.stack([np.linalg.inv(_stiffness(dense, f))[np.ix_(ends, ends)] for f in frequency])


def _stiffness(dense, f):
    omega = 2 * np.pi * f
    return dense.K + 1j * omega * dense.C - omega**2 * dense.M


def sensors(rng, counts, prefix):
    """Return MeasuredDofs around both ends, in random directions, and their groups."""
    places, groups = [], []
    for name, end in (("foot", np.zeros(3)), ("head", HEAD)):
        places += [end + rng.uniform(-0.03, 0.03, 3) for _ in range(counts[name])]
        groups += [name] * counts[name]
    ways = rng.standard_normal((len(places), 3))
    names = tuple(f"{prefix}{number}" for number in range(len(places)))
    return MeasuredDofs(names, np.array(places), ways / np.linalg.norm(ways, axis=1)[:, None]), groups


def motion_of(dofs, groups):
    """Return the motion (n, 12) of channels by those of both ends."""
    foot, head = interface_modes(dofs, np.zeros(3), DIRECTIONS), interface_modes(dofs, HEAD, DIRECTIONS)
    at_foot = np.array([group == "foot" for group in groups])[:, None]
    return np.hstack([np.where(at_foot, foot, 0.0), np.where(at_foot, 0.0, head)])


def write_table(path, dofs, groups, quantity, unit=1.0):
    columns = ["Name", "Quantity", "Grouping", *(f"{w}_{n}" for w in ("Position", "Direction") for n in (1, 2, 3))]
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        for name, group, place, way in zip(dofs.names, groups, dofs.positions / unit, dofs.directions, strict=True):
            writer.writerow([name, quantity, group, *map(repr, place.tolist()), *map(repr, way.tolist())])


def measured(folder, seed=0, counts=None, quantity="Acceleration", noise=0.0, change=None, **options):
    """Write the bar's FRFs and tables, and return the section that reads them."""
    rng, counts = np.random.default_rng(seed), counts or {"foot": 9, "head": 12}
    (channels, of_channels), (impacts, of_impacts) = (sensors(rng, counts, prefix) for prefix in "sh")
    H = motion_of(channels, of_channels) @ bar_receptance() @ motion_of(impacts, of_impacts).T
    if change is not None:
        H = change(H)
    errors = rng.standard_normal((*H.shape, 2)) @ [1.0, 1.0j] / np.sqrt(2.0)
    H = H + noise * np.abs(H) * errors
    omega = 2j * np.pi * FREQUENCY[:, None, None]
    np.savez(folder / "bar.npz", frequency=FREQUENCY, frfs=H * omega ** QUANTITIES[quantity])
    unit = 1e-3 if "unit_of_length" in options else 1.0
    write_table(folder / "channels.csv", channels, of_channels, quantity, unit)
    write_table(folder / "impacts.csv", impacts, of_impacts, "Force", unit)
    return {
        "model": "measured",
        "file": str(folder / "bar.npz"),
        "channels": str(folder / "channels.csv"),
        "impacts": str(folder / "impacts.csv"),
        "points": {"foot": {"at": [0.0, 0.0, 0.0]}, "head": {"at": HEAD.tolist()}},
        **options,
    }


BAR = {
    "model": "spatial_beam",
    "material": STEEL,
    "sections": [{"length": LENGTH, "height": SIDES[0], "width": SIDES[1], "elements": ELEMENTS}],
}
K, C = [2e6, 3e6, 4e6, 2e3, 3e3, 4e3], [20.0, 30.0, 40.0, 0.2, 0.3, 0.4]
TURN = [{"about": [1, 2, 3], "angle": "40 deg"}]


def joined(part, at, joint=None, response=None, **lines):
    """Return the bar's foot on a bushing upon a post, turned by skew angles; `at` are the nodes of its ends."""
    place = {"origin": [0.1, 0.2, 0.3], "rotate": TURN}
    bushing = {
        "model": "bushing",
        "axes": {"x": [1, 1, 0], "z": "z"},
        "parameters": {
            **{f"k_{each}": {"value": value} for each, value in zip(DIRECTIONS, K, strict=True)},
            **{f"c_{each}": {"value": value} for each, value in zip(DIRECTIONS, C, strict=True)},
        },
    }
    connect = {"a": {"to": "bar", "at": at[0]}, "b": {"to": "post", "at": 0.0}}
    where = {"at": "bar", "position": at[1], "quantity": "receptance", "direction": [1, 1, 0]}
    post = {**BAR, "place": {"origin": [0.1, 0.2, 0.3], "along": "-z"}}
    return dovetail.load(
        {
            "dovetail": 1,
            "name": "bar on a post",
            "frequency": lines or {"start": 40.0, "stop": 1190.0, "step": 10.0},
            "substructures": {"bar": {**part, "place": place}, "post": post, "floor": {"model": "ground"}},
            "joints": {
                "middle": {**(joint or bushing), "connect": connect},
                "weld": {
                    "model": "rigid",
                    "direction": "all",
                    "connect": {"a": {"to": "post", "at": LENGTH}, "b": {"to": "floor", "at": 0.0}},
                },
            },
            "response": {**where, **(response or {})},
        }
    )


def difference(found, expected):
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def test_a_placed_measured_part_on_a_bushing_has_the_frfs_of_a_dense_solution(tmp_path):
    found = joined(measured(tmp_path), ("foot", "head"))
    dense = DenseStructure(2 * (ELEMENTS + 1), 2 * ELEMENTS)
    rotation = found.description.placements["bar"].rotation
    dense.add_beam(0, ELEMENTS, LENGTH, -rotation[:, 1], rotation[:, 0], MATERIAL, SIDES)
    dense.add_beam(ELEMENTS + 1, ELEMENTS, LENGTH, (0, 0, -1), (1, 0, 0), MATERIAL, SIDES)
    x = np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0)
    axes = np.column_stack([x, np.cross([0, 0, 1], x), [0, 0, 1]])
    dense.add_bushing(0, ELEMENTS + 1, np.array(K), np.array(C), axes)
    free = np.setdiff1d(np.arange(len(dense.K)), 6 * (2 * ELEMENTS + 1) + np.arange(6))
    head = [int(np.flatnonzero(free == 6 * ELEMENTS + n)[0]) for n in (0, 1)]
    inverse = np.stack([np.linalg.inv(_stiffness(dense, f)[np.ix_(free, free)]) for f in FREQUENCY])
    expected = inverse[:, head][:, :, head].sum(axis=(1, 2)) / 2.0
    assert difference(found.frf(), expected) < 1e-7


@pytest.mark.parametrize("joint", ["bushing", "rigid", "ball"])
def test_a_measured_part_couples_as_the_modelled_one(joint, tmp_path):
    joints = {
        "bushing": None,
        "rigid": {"model": "rigid", "direction": "all"},
        "ball": {"model": "rigid", "direction": ["x", "y", "z"]},
    }
    found = joined(measured(tmp_path, quantity="Velocity"), ("foot", "head"), joints[joint])
    whole = joined(BAR, (0.0, LENGTH), joints[joint])
    assert difference(found.frf(), whole.frf()) < 1e-6
    assert not [warning for warning in find_warnings(found) if warning.startswith("substructures.bar: ")]


def test_the_rotation_of_a_virtual_point_is_a_response(tmp_path):
    response = {"direction": "rz", "force": {"position": "foot", "direction": "y"}}
    found = joined(measured(tmp_path), ("foot", "head"), response=response)
    whole = joined(BAR, (0.0, LENGTH), response={**response, "force": {"position": 0.0, "direction": "y"}})
    assert difference(found.frf(), whole.frf()) < 1e-6


def test_deformations_of_the_interface_are_separated_from_its_motion(tmp_path):
    """Channels around the foot that also move with a deformation: without it, the motion is wrong."""
    rng = np.random.default_rng(3)
    counts = {"foot": 15, "head": 12}
    channels, groups = sensors(np.random.default_rng(0), counts, "s")
    at_foot = np.array([group == "foot" for group in groups])[:, None]
    shape = np.where(at_foot, interface_modes(channels, np.zeros(3), ["ex", "sxy"]), 0.0)
    load = 1e-4 * (rng.standard_normal((len(FREQUENCY), 2, len(groups))) + 0j)
    options = {"counts": counts, "change": lambda H: H + shape @ load}
    whole = joined(BAR, (0.0, LENGTH))
    wrong = measured(tmp_path, **options)
    assert difference(joined(wrong, ("foot", "head")).frf(), whole.frf()) > 1e-2
    right = {**wrong, "points": {**wrong["points"], "foot": {"at": [0.0, 0.0, 0.0], "flexible": ["ex", "sxy"]}}}
    assert difference(joined(right, ("foot", "head")).frf(), whole.frf()) < 1e-6


def test_coupling_and_decoupling_of_measured_parts_return_the_dense_solution(tmp_path):
    """Two bars welded end to end; the second one comes back, from more points than the interface has DOFs."""
    H = bar_receptance()
    at, tip = slice(6, 12), slice(0, 6)
    mirrored = np.diag([-1.0, -1.0, 1.0] * 4)  # half a turn about z
    other = mirrored @ H @ mirrored
    both = couple(H[:, tip, tip], H[:, tip, at], H[:, at, tip], H[:, at, at], other[:, at, at])
    dense = DenseStructure(2 * ELEMENTS + 1, 2 * ELEMENTS)
    dense.add_beam(0, ELEMENTS, LENGTH, (0, -1, 0), (1, 0, 0), MATERIAL, SIDES)
    dense.add_beam(ELEMENTS, ELEMENTS, LENGTH, (0, -1, 0), (1, 0, 0), MATERIAL, SIDES)
    expected = np.stack([np.linalg.inv(_stiffness(dense, f))[:6, :6] for f in FREQUENCY])
    assert difference(both, expected) < 1e-8
    rng = np.random.default_rng(1)
    channels, _ = sensors(rng, {"foot": 12, "head": 0}, "s")
    R = interface_modes(channels, np.zeros(3), DIRECTIONS)
    assert np.linalg.matrix_rank(R) == 6
    parts = R @ H[:, tip, tip] @ R.T, R @ H[:, tip, at], H[:, at, tip] @ R.T, H[:, at, at]
    second = decouple(R @ both @ R.T, *parts, tolerance=1e-9)
    assert difference(second, other[:, at, at]) < 1e-5


def replaced(path, old, new):
    path.write_text(path.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")


def with_row(folder, table, row, column, value):
    """Change one cell of a table."""
    path = folder / table
    rows = list(csv.reader(path.read_text(encoding="utf-8").splitlines()))
    rows[row][rows[0].index(column)] = value
    path.write_text("\n".join(map(",".join, rows)) + "\n", encoding="utf-8")


def drop(folder, table, count):
    path = folder / table
    path.write_text("\n".join(path.read_text(encoding="utf-8").splitlines()[:count]) + "\n", encoding="utf-8")


SWEEP = {
    "no column of names": (lambda f: replaced(f / "channels.csv", "Name,", "Nam,"), "no column 'name'"),
    "no direction": (lambda f: replaced(f / "impacts.csv", "Direction_3", "Way_3"), "no column 'direction_3'"),
    "a column of units": (lambda f: replaced(f / "channels.csv", "Grouping", "Unit"), "the column 'unit' may change"),
    "twice a name": (lambda f: with_row(f, "channels.csv", 2, "Name", "s0"), "the name 's0' is there twice"),
    "no name": (lambda f: with_row(f, "impacts.csv", 3, "Name", ""), "there is no name"),
    "a word as a position": (lambda f: with_row(f, "impacts.csv", 1, "Position_2", "left"), "position_2 is 'left'"),
    "nan": (lambda f: with_row(f, "impacts.csv", 1, "Direction_2", "nan"), "direction_2 is 'nan'"),
    "no unit vector": (lambda f: with_row(f, "channels.csv", 4, "Direction_1", "7"), "the direction of 's3' has the"),
    "a strange quantity": (lambda f: with_row(f, "channels.csv", 2, "Quantity", "Strain"), "the quantity is 'Strain'"),
    "a force as a channel": (lambda f: with_row(f, "channels.csv", 2, "Quantity", "Force"), "the quantity is 'Force'"),
    "another group": (lambda f: replaced(f / "channels.csv", ",head,", ",tip,"), "has the Grouping 'head'"),
    "a row too few": (lambda f: drop(f, "channels.csv", 21), "'frfs' has the shape (116, 21, 21)"),
    "a header alone": (lambda f: drop(f, "impacts.csv", 1), "the table has no rows"),
    "one channel": (
        lambda f: [
            replaced(f / "channels.csv", ",foot,", ",elsewhere,"),
            with_row(f, "channels.csv", 1, "Grouping", "foot"),
        ],
        "its 1 channels do not determine its motion in x, y, z, rx, ry, rz",
    ),
}


@pytest.mark.parametrize("case", SWEEP)
def test_a_wrong_table_is_one_clear_error(case, tmp_path):
    change, said = SWEEP[case]
    section = measured(tmp_path)
    change(tmp_path)
    with pytest.raises(dovetail.DescriptionError) as caught:
        joined(section, ("foot", "head"))
    assert len(caught.value.faults) == 1
    assert said in str(caught.value)


def with_column(path, name, cell):
    lines = path.read_text(encoding="utf-8").splitlines()
    path.write_text("\n".join([f"{lines[0]},{name}", *(f"{line},{cell}" for line in lines[1:])]), encoding="utf-8")


@pytest.mark.parametrize("table", ["channels.csv", "impacts.csv"])
@pytest.mark.parametrize(
    ("name", "cell"),
    [
        ("Units", "g"), ("Einheit", "mm"), ("Faktor", "2"), ("Polarity", "-1"), ("Sign", "-"), ("Inverted", "yes"),
        ("Delay", "0.001"), ("dB", "20"), ("Multiplier", "2"), ("Coordinates", "cm"), ("Axis", "X"), ("Frame", "local"),
    ],
)  # fmt: skip
def test_a_column_that_is_not_understood_is_refused(table, name, cell, tmp_path):
    section = measured(tmp_path)
    with_column(tmp_path / table, name, cell)
    with pytest.raises(dovetail.DescriptionError, match=f"the column '{name.lower()}' may change"):
        joined(section, ("foot", "head"))


@pytest.mark.parametrize(("name", "cell"), [("Serial", "a7"), ("Comment", "by hand"), ("", "3"), ("Unit", "")])
def test_a_column_that_changes_nothing_is_read_over(name, cell, tmp_path):
    section = measured(tmp_path)
    with_column(tmp_path / "channels.csv", name, cell)
    joined(section, ("foot", "head"))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("scale", 1000.0), ("gain", np.full(21, 9.81)), ("calibration", 9.81), ("delay", 1e-3), ("polarity", -1),
        ("sensitivity", [2.0, 3.0]), ("inverted", True), ("window_decay", 5.0), ("df", 1.0), ("unit", "g/N"),
        ("quantity", "mobility"), ("f_unit", "kHz"),
    ],
)  # fmt: skip
def test_an_entry_of_the_archive_that_may_act_on_the_values_is_refused(name, value, tmp_path):
    section = measured(tmp_path)
    with np.load(tmp_path / "bar.npz") as archive:
        arrays = dict(archive)
    np.savez(tmp_path / "bar.npz", **arrays, **{name: value})
    with pytest.raises(dovetail.DescriptionError, match=name):
        joined(section, ("foot", "head"))


@pytest.mark.parametrize(
    ("written", "read", "warned"), [("m", "m", 0), ("mm", "mm", 0), ("mm", "m", 4), ("m", "mm", 4)]
)
def test_positions_in_another_unit_than_the_points_are_reported(written, read, warned, tmp_path):
    section = measured(tmp_path, **({"unit_of_length": "1 mm"} if written == "mm" else {}))
    section = {**section, "unit_of_length": f"1 {read}"}
    if (written, read) == ("m", "mm"):  # the point of the foot is at the origin, near to all of its sensors
        section["points"] = {name: {"at": [0.0, 0.0, 0.0]} for name in ("foot", "head")}
    found = find_warnings(joined(section, ("foot", "head")))
    assert sum("Are the positions in the table in metres" in warning for warning in found) == warned


CHANGES = {
    "no impacts": ({"impacts": ""}, "virtual points need the tables 'channels' and 'impacts'"),
    "no points": ({"points": {}}, "is for virtual points: list them in 'points'"),
    "nodes too": ({"nodes": {"a": 0.0}, "frfs": [{"set": 1, "response": "a", "force": "a"}]}, "'points'"),
    "directions in another order": (
        {"points": {"foot": {"at": [0.0, 0.0, 0.0], "directions": ["y", "x"]}}},
        "'directions' are different ones in their order",
    ),
    "an unknown deformation": (
        {"points": {"foot": {"at": [0.0, 0.0, 0.0], "flexible": ["exx"]}}},
        "'exx' is not a deformation",
    ),
    "two coordinates": ({"points": {"foot": {"at": [0.0, 0.0]}}}, "at"),
    "a sheet of a CSV file that is not there": ({"channels": "none.csv"}, "none.csv"),
}


@pytest.mark.parametrize("case", CHANGES)
def test_a_wrong_section_of_virtual_points_is_one_clear_error(case, tmp_path):
    change, said = CHANGES[case]
    with pytest.raises(dovetail.DescriptionError) as caught:
        joined({**measured(tmp_path), **change}, ("foot", "head"))
    assert len(caught.value.faults) == 1, caught.value
    assert said in str(caught.value)


def test_too_few_channels_for_a_rotation_are_named_with_it(tmp_path):
    """Three channels at one point see no rotation."""
    section = measured(tmp_path)
    path = tmp_path / "channels.csv"
    rows = list(csv.reader(path.read_text(encoding="utf-8").splitlines()))
    first = rows[0].index("Position_1")
    for row in rows[1:10]:
        row[first : first + 3] = ["0.01", "0.0", "0.0"]
    path.write_text("\n".join(map(",".join, rows)) + "\n", encoding="utf-8")
    with pytest.raises(dovetail.DescriptionError, match="do not determine its motion in y, z, rx, ry, rz"):
        joined(section, ("foot", "head"))


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_channel_of_the_wrong_sign_is_named(noise, tmp_path):
    def reversed_channel(H):
        H[:, 4] *= -1.0
        return H

    wrong = joined(measured(tmp_path, change=reversed_channel, noise=noise), ("foot", "head"))
    assert any("channel 's4' differs by" in warning for warning in find_warnings(wrong))
    right = joined(measured(tmp_path, noise=noise), ("foot", "head"))
    assert not any("from what the others around its point say" in warning for warning in find_warnings(right))


def test_one_receptance_of_the_wrong_sign_in_both_directions_is_reported(tmp_path):
    """Each drive point takes power up, and the matrix is reciprocal, but not passive."""
    dofs, (turn, _) = [*range(3), *range(6, 9)], np.linalg.qr(np.random.default_rng(0).standard_normal((3, 3)))
    both = np.kron(np.eye(2), turn)  # along skew directions, since a bar's own are not coupled
    H = both.T @ bar_receptance()[:, dofs][:, :, dofs] @ both
    table = {"nodes": ["foot"] * 3 + ["head"] * 3, "directions": list("xyz") * 2}
    table |= {f"point_{axis}": [0.0] * 3 + [HEAD[n]] * 3 for n, axis in enumerate("xyz")}
    ball = {"model": "rigid", "direction": ["x", "y", "z"]}
    for sign in (1.0, -1.0):
        H[:, 0, 3] *= sign
        H[:, 3, 0] *= sign
        np.savez(tmp_path / "bar.npz", frequency=FREQUENCY, receptance=H, **table)
        warnings = find_warnings(
            joined({"model": "measured", "file": str(tmp_path / "bar.npz")}, ("foot", "head"), ball)
        )
        assert any("of the power out of the part" in warning for warning in warnings) == (sign < 0.0)


def test_receptances_that_differ_in_both_directions_are_reported(tmp_path):
    def unequal(H):
        H[:, :9, 9:] *= 3.0
        return H

    warnings = find_warnings(joined(measured(tmp_path, change=unequal), ("foot", "head")))
    assert any("By reciprocity they are equal" in warning for warning in warnings)


def test_a_reversed_drive_point_is_refused(tmp_path):
    with pytest.raises(dovetail.DescriptionError, match="which no passive structure does"):
        joined(measured(tmp_path, change=lambda H: -H), ("foot", "head"))


def test_positions_may_be_in_millimetres(tmp_path):
    found = joined(measured(tmp_path, unit_of_length="1 mm"), ("foot", "head"))
    assert difference(found.frf(), joined(BAR, (0.0, LENGTH)).frf()) < 1e-6


def test_a_part_at_the_wrong_place_is_refused_with_both_points(tmp_path):
    section = measured(tmp_path)
    section["points"]["foot"]["at"] = [0.0, 0.01, 0.0]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(dovetail.DescriptionError, match="it is 10 mm away") as caught:
            joined(section, ("foot", "head"))
    assert len(caught.value.faults) == 1


def as_sets(folder, section, names):
    """Write the FRFs of an archive as sets of a UFF file, whose DOFs have the names of the tables."""
    data, content = np.load(section["file"]), b""
    for row, response in enumerate(names[0]):
        for column, force in enumerate(names[1]):
            sense = (-1.0 if "-" in response else 1.0) * (-1.0 if "-" in force else 1.0)
            values, one = sense * data["frfs"][:, row, column], folder / "one.uff"
            frf = dovetail.Frf(FREQUENCY, values, "accelerance", response=response, force=force)
            dovetail.write_frf(frf, one, overwrite=True)
            content += one.read_bytes()
    (folder / "sets.uff").write_bytes(content)
    return {**section, "file": str(folder / "sets.uff")}


def named(folder, section, senses="+-"):
    """Give channels and impacts the names of DOFs, and return the section and the names."""
    both = []
    for table, count, first in (("channels.csv", 18, 1), ("impacts.csv", 18, 101)):
        names = [f"{first + number // 3}{senses[number % len(senses)]}{'xyz'[number % 3]}" for number in range(count)]
        for row, name in enumerate(names, 1):
            with_row(folder, table, row, "Name", name)
        both.append(names)
    return section, both


def test_frfs_of_a_universal_file_are_found_by_their_dofs(tmp_path):
    section, names = named(tmp_path, measured(tmp_path, counts={"foot": 9, "head": 9}))
    found = joined(as_sets(tmp_path, section, names), ("foot", "head"))
    assert difference(found.frf(), joined(BAR, (0.0, LENGTH)).frf()) < 1e-4  # single precision in the file


def test_a_universal_file_without_an_frf_is_refused_with_the_pair(tmp_path):
    section, names = named(tmp_path, measured(tmp_path, counts={"foot": 9, "head": 9}))
    sets = as_sets(tmp_path, section, [names[0][1:], names[1]])
    with pytest.raises(dovetail.DescriptionError, match=r"no FRF of channel '1\+x' by impact '101\+x' \(18 of 324"):
        joined(sets, ("foot", "head"))


def test_a_workbook_of_pyfbs_is_read():
    folder = Path(__file__).parents[1] / "coupling" / "virtual_points"
    for name, read in (("channels", read_channels), ("impacts", read_impacts)):
        sheet, plain = read(str(folder / "tables.xlsx"), "", 1.0), read(str(folder / f"{name}.csv"), "", 1.0)
        assert sheet.names == plain.names
        assert sheet.groups == plain.groups
        np.testing.assert_allclose(sheet.dofs.positions, plain.dofs.positions, rtol=1e-14)
        np.testing.assert_allclose(sheet.dofs.directions, plain.dofs.directions, rtol=1e-14)
    with pytest.raises(dovetail.DovetailError, match="the workbook has no sheet 'B'"):
        read_channels(str(folder / "tables.xlsx"), "B", 1.0)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"Name,Quantity\n", b"\xff\xfe\x00"])
def test_a_damaged_workbook_is_one_clear_error(content, tmp_path):
    section = measured(tmp_path)
    (tmp_path / "bad.xlsx").write_bytes(content)
    with pytest.raises(dovetail.DescriptionError, match=r"bad\.xlsx") as caught:
        joined({**section, "channels": str(tmp_path / "bad.xlsx")}, ("foot", "head"))
    assert len(caught.value.faults) == 1


def test_sets_of_several_directions_are_coupled_in_space(tmp_path):
    """Three displacements of both ends, from sets of a UFF file, on a ball joint."""
    H, content, frfs = bar_receptance(), b"", []
    dofs = [
        (node, direction, 6 * n + axis)
        for n, node in enumerate(("foot", "head"))
        for axis, direction in enumerate("xyz")
    ]
    for one, (node, direction, row) in enumerate(dofs):
        for force, along, column in dofs[one:]:
            frf = dovetail.Frf(
                FREQUENCY,
                H[:, row, column],
                "receptance",
                response=f"{1 + 4 * (node == 'head')}+{direction}",
                force=f"{1 + 4 * (force == 'head')}+{along}",
            ).to("accelerance")
            dovetail.write_frf(frf, tmp_path / "one.uff", overwrite=True)
            content += (tmp_path / "one.uff").read_bytes()
            entry = {"set": len(frfs) + 1, "response": node, "force": force}
            frfs.append({**entry, "direction": direction, "force_direction": along})
    (tmp_path / "sets.uff").write_bytes(content)
    places = {"foot": [0.0, 0.0, 0.0], "head": HEAD.tolist()}
    section = {"model": "measured", "file": str(tmp_path / "sets.uff"), "nodes": places, "frfs": frfs}
    ball = {"model": "rigid", "direction": ["x", "y", "z"]}
    found, whole = joined(section, ("foot", "head"), ball), joined(BAR, (0.0, LENGTH), ball)
    assert difference(found.frf(), whole.frf()) < 1e-3  # single precision in the file
    frfs[1]["direction"] = "z"
    frfs[1]["force_direction"] = "z"
    with pytest.raises(dovetail.DescriptionError, match="is used as") as caught:
        joined(section, ("foot", "head"), ball)
    assert len(caught.value.faults) == 1


def test_a_table_of_six_directions_in_an_archive_is_a_part_in_space(tmp_path):
    points = [np.zeros(3), HEAD]
    table = {f"point_{axis}": [point[n] for point in points for _ in range(6)] for n, axis in enumerate("xyz")}
    np.savez(
        tmp_path / "bar.npz",
        frequency=FREQUENCY,
        receptance=bar_receptance(),
        nodes=["foot"] * 6 + ["head"] * 6,
        directions=[*DIRECTIONS] * 2,
        **table,
    )
    found = joined({"model": "measured", "file": str(tmp_path / "bar.npz")}, ("foot", "head"))
    assert difference(found.frf(), joined(BAR, (0.0, LENGTH)).frf()) < 1e-6
