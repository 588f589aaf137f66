"""Every entry of the matrices of beams and joints, for round numbers, worked out independently of the plugins.

Those of the beam elements are from sympy, exactly. The shape functions are the static deflections of the Timoshenko
beam under loads at its ends, w cubic and r = w' + E I / (kappa G A) w'''. K is the integral of
E I r'^2 + kappa G A (w' - r)^2, M that of rho A w^2 + rho I r^2. Material: E = 200 GPa, rho = 8000 kg/m^3, nu = 1/4, so
that G = 80 GPa. The joints are by hand: a spring k between two DOFs adds k to the diagonal at both and -k between them.
"""

from __future__ import annotations

import numpy as np
import pytest

from dovetail.registry import components

MATERIAL = {"young": 200e9, "density": 8000.0, "poisson": 0.25, "loss_factor": 0.01}

# A tube of 40 mm and 20 mm, an element of 20 mm: A = 300 pi mm^2, I = 37500 pi mm^4, kappa = 125/203, phi = 609/40.
TUBE_MASS = np.pi * np.array(
    [
        [541698 / 33504625, 214031 / 6700925000, 262413 / 33504625, -322043 / 6700925000],
        [214031 / 6700925000, 6640699 / 3350462500000, 322043 / 6700925000, 4436177 / 6700925000000],
        [262413 / 33504625, 322043 / 6700925000, 541698 / 33504625, -214031 / 6700925000],
        [-322043 / 6700925000, 4436177 / 6700925000000, -214031 / 6700925000, 6640699 / 3350462500000],
    ]
)
TUBE_STIFFNESS = (np.pi / 649) * np.array(
    [
        [450e9, 4.5e9, -450e9, 4.5e9],
        [4.5e9, 288375e3, -4.5e9, -198375e3],
        [-450e9, -4.5e9, 450e9, -4.5e9],
        [4.5e9, -198375e3, -4.5e9, 288375e3],
    ]
)

# A bar 30 mm wide and 20 mm high, an element of 40 mm: kappa = 50/59, phi = 59/80.
BAR_MASS = np.array(
    [
        [1176248 / 16905875, 29471 / 84529375, 446716 / 16905875, -123139 / 422646875],
        [29471 / 84529375, 1143917 / 316985156250, 123139 / 422646875, -1634329 / 633970312500],
        [446716 / 16905875, 123139 / 422646875, 1176248 / 16905875, -29471 / 84529375],
        [-123139 / 422646875, -1634329 / 633970312500, -29471 / 84529375, 1143917 / 316985156250],
    ]
)
BAR_STIFFNESS = (1e5 / 139) * np.array(
    [
        [600000, 12000, -600000, 12000],
        [12000, 379, -12000, 101],
        [-600000, -12000, 600000, -12000],
        [12000, 101, -12000, 379],
    ]
)


def component(kind, model, **options):
    made = components().find(kind, model).component
    return made(made.Config(**options))


def matrices_of(model, values, **options):
    made = component("joint", model, **options).matrices(np.array([values]))
    assert made.K.shape[0] == 1
    return {name: getattr(made, name)[0] for name in "MKCD"}


def expect(actual, **expected):
    """Compare all four matrices entry by entry; a tiny entry counts as much as a large one, and a zero is zero."""
    for name in "MKCD":
        wanted = expected.get(name, np.zeros_like(actual["K"]))
        np.testing.assert_allclose(actual[name], wanted, rtol=1e-12, atol=0.0, err_msg=name)


def chained(element, count):
    """Elements end to end, in exactly the order in which they are added."""
    whole = np.zeros((2 * count + 2, 2 * count + 2))
    for first in range(0, 2 * count, 2):
        whole[first : first + 4, first : first + 4] += element
    return whole


def two_sided(*springs):
    """A layer between equal sides: spring i from DOF i of one side to DOF i of the other."""
    side = np.diag(springs)
    return np.block([[side, -side], [-side, side]])


@pytest.mark.parametrize(
    ("section", "mass", "stiffness"),
    [
        ({"length": 0.02, "outer": 0.04, "inner": 0.02}, TUBE_MASS, TUBE_STIFFNESS),
        ({"length": 0.04, "width": 0.03, "height": 0.02}, BAR_MASS, BAR_STIFFNESS),
    ],
    ids=["tube", "bar"],
)
@pytest.mark.parametrize("elements", [1, 3])
def test_every_matrix_entry_of_a_beam_is_that_of_the_formulas(section, mass, stiffness, elements):
    whole = {**section, "length": elements * section["length"], "elements": elements}
    made = component("substructure", "timoshenko_beam", material=MATERIAL, sections=[whole]).matrices()
    M, K = chained(mass, elements), chained(stiffness, elements)
    actual = {name: getattr(made, name) for name in "MKCD"}
    np.testing.assert_allclose(actual["M"], M, rtol=1e-11, atol=1e-17)  # turns cancel at inner nodes to rounding
    np.testing.assert_allclose(actual["K"], K, rtol=1e-11, atol=1e-6)
    np.testing.assert_allclose(actual["D"], 0.01 * K, rtol=1e-11, atol=1e-8)
    assert not actual["C"].any()


# Dc, dc, mn1, mn2; kt, kr, ct, cr of the layer between tool and collet, then of that between holder and collet
COLLET = [0.04, 0.02, 0.05, 0.11, 3e8, 2e4, 300.0, 2.0, 7e8, 5e5, 700.0, 5.0]


@pytest.mark.parametrize("elements", [1, 2])
def test_every_matrix_entry_of_the_collet_is_that_of_the_formulas(elements):
    """Tool nodes at DOFs 0 to 5, holder nodes at 6 to 11, then the collet's own: c1 at 12, and so on to c5."""
    actual = matrices_of("collet", COLLET, material=MATERIAL, segment=0.02 * elements, elements_per_segment=elements)
    c1, c2, c3, c4, c5 = (12 + 2 * elements * node for node in range(5))
    size = 12 + 2 * (4 * elements + 1)
    M, K, C = (np.zeros((size, size)) for _ in "MKC")
    M[12:, 12:], K[12:, 12:] = chained(TUBE_MASS, 4 * elements), chained(TUBE_STIFFNESS, 4 * elements)
    D = 0.01 * K
    M[c1, c1] += 0.05
    M[c2, c2] += 0.11
    layers = [
        (((0, c1), (2, c2), (4, c3)), 3e8, 300.0),
        (((1, c1 + 1), (3, c2 + 1), (5, c3 + 1)), 2e4, 2.0),
        (((6, c3), (8, c4), (10, c5)), 7e8, 700.0),
        (((7, c3 + 1), (9, c4 + 1), (11, c5 + 1)), 5e5, 5.0),
    ]
    for pairs, stiffness, damping in layers:
        for port, own in pairs:
            for matrix, value in ((K, stiffness), (C, damping)):
                matrix[[port, own], [port, own]] += value
                matrix[[port, own], [own, port]] -= value
    for name, expected, rounding in (("M", M, 1e-17), ("K", K, 1e-6), ("C", C, 0.0), ("D", D, 1e-8)):
        np.testing.assert_allclose(actual[name], expected, rtol=1e-11, atol=rounding, err_msg=name)


def test_every_matrix_entry_of_the_bolted_lap_is_that_of_the_formulas():
    """Three nodes; half of the bolt on the middle node of each side; (20 kN / 5 kN)^0.5 doubles the stiffness."""
    actual = matrices_of(
        "bolted",
        [1e8, 1e4, 30.0, 0.2, 0.3],
        nodes=3,
        bolt_mass=True,
        preload={"force": 20e3, "reference": 5e3, "exponent": 0.5},
    )
    expect(
        actual,
        M=np.diag([0, 0, 0.15, 0, 0, 0, 0, 0, 0.15, 0, 0, 0]),
        K=two_sided(2e8, 2e4, 2e8, 2e4, 2e8, 2e4),
        C=two_sided(30, 0.2, 30, 0.2, 30, 0.2),
    )


def test_every_matrix_entry_of_a_bolted_lap_of_an_even_number_of_nodes_is_that_of_the_formulas():
    """Two nodes: a quarter of the bolt on each; without a preload the stiffness is the parameter."""
    actual = matrices_of("bolted", [1e8, 1e4, 30.0, 0.2, 0.4], nodes=2, bolt_mass=True)
    expect(
        actual,
        M=np.diag([0.1, 0, 0.1, 0, 0.1, 0, 0.1, 0]),
        K=two_sided(1e8, 1e4, 1e8, 1e4),
        C=two_sided(30, 0.2, 30, 0.2),
    )
    bare = matrices_of("bolted", [1e8, 1e4, 30.0, 0.2], nodes=2)
    expect(bare, K=actual["K"], C=actual["C"])


def test_every_matrix_entry_of_the_interference_fit_is_that_of_the_formulas():
    """40 mm over three nodes stand for 10, 20 and 10 mm; with g = 1/2 the ends have 1/2 and 3/2 of the stiffness."""
    options = {"length": 0.04, "nodes": 3}
    even = matrices_of("interference_fit", [1e9, 1e6, 1e4, 10.0], **options)
    damping = two_sided(100, 0.1, 200, 0.2, 100, 0.1)
    expect(even, K=two_sided(1e7, 1e4, 2e7, 2e4, 1e7, 1e4), C=damping)
    linear = matrices_of("interference_fit", [1e9, 1e6, 1e4, 10.0, 0.5], pressure="linear", **options)
    expect(linear, K=two_sided(5e6, 5e3, 2e7, 2e4, 1.5e7, 1.5e4), C=damping)


def test_every_matrix_entry_of_bearing_and_spring_damper_is_that_of_the_formulas():
    """The inertia of the bearing's ring goes with the shaft, the first side."""
    bearing = matrices_of("bearing", [1e8, 1e5, 40.0, 0.3, 0.2, 5e-4])
    expect(bearing, M=np.diag([0.2, 5e-4, 0, 0]), K=two_sided(1e8, 1e5), C=two_sided(40, 0.3))
    # two nodes, both directions: k, c, kr, cr
    both = matrices_of("spring_damper", [1e6, 20.0, 1e3, 0.5], nodes=2)
    expect(both, K=two_sided(1e6, 1e3, 1e6, 1e3), C=two_sided(20, 0.5, 20, 0.5))
    across = matrices_of("spring_damper", [1e6, 20.0], nodes=2, direction="x")
    expect(across, K=two_sided(1e6, 0, 1e6, 0), C=two_sided(20, 0, 20, 0))
    turning = matrices_of("spring_damper", [1e3, 0.5], nodes=2, direction="rz")
    expect(turning, K=two_sided(0, 1e3, 0, 1e3), C=two_sided(0, 0.5, 0, 0.5))


def test_every_matrix_entry_of_lumped_masses_is_that_of_the_formulas():
    masses = [{"mass": 0.2, "inertia": 1e-4}, {"position": 0.01, "mass": 3.0}]
    made = component("substructure", "lumped", masses=masses).matrices()
    expect({name: getattr(made, name) for name in "MKCD"}, M=np.diag([0.2, 1e-4, 3.0, 0.0]))
