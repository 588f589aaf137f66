"""Matrices that models declare as linear in parameters or as scaled: verified, exact, and computed in one product."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import dovetail
from dovetail.description.placed_parts import OrientationSection
from dovetail.description.unknown_parts import UnknownPart
from dovetail.registry import components

STEEL = {"young": 200e9, "density": 7850.0, "poisson": 0.28, "loss_factor": 0.003}
JOINTS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("spring_damper", {}),
    ("spring_damper", {"nodes": 3, "direction": "rz"}),
    ("bearing", {}),
    ("bolted", {}),
    ("bolted", {"nodes": 4, "bolt_mass": True, "preload": {"force": 8e3, "reference": 1e4, "exponent": 0.5}}),
    ("interference_fit", {"length": 0.04}),
    ("interference_fit", {"length": 0.03, "nodes": 5, "pressure": "linear"}),
    ("collet", {"material": STEEL}),
    ("collet", {"material": STEEL, "segment": 8e-3, "elements_per_segment": 3}),
    ("rigid", {"nodes": 2}),
)
TUBE = {"length": 0.06, "outer": 0.04, "inner": 0.02, "elements": 3}
CONE = {"length": 0.05, "outer": 0.04, "outer_end": 0.03, "inner": 0.01, "inner_end": 0.015, "elements": 2}
BAR = {"length": 0.2, "width": 0.03, "height": 0.01, "elements": 2}
BEAM = {"material": STEEL, "sections": [TUBE, BAR, CONE, TUBE]}
OPTIONS = (
    *(f"material.{name}" for name in STEEL),
    *(f"sections.0.{name}" for name in ("length", "outer", "inner")),
    *(f"sections.1.{name}" for name in ("length", "width", "height")),
    *(f"sections.2.{name}" for name in ("length", "outer", "outer_end", "inner", "inner_end")),
)
MASSES = {"masses": [{"mass": 1.0, "inertia": 1e-3}, {"mass": 0.5, "position": 0.1}]}


def component(kind, model, options):
    made = components().find(kind, model).component
    return made(made.Config.model_validate(options))


def unknown_part(model, options, places, *, reversed=False):
    """Return a part with some options unknown, within 10 % of their values."""
    part = component("substructure", model, options)
    parameters = []
    for place in places:
        value: Any = part.config
        for step in place.split("."):
            value = value[int(step)] if step.isdecimal() else getattr(value, step)
        parameters.append(dovetail.Parameter(place, "1", 0.9 * value, 1.1 * value))
    turned = OrientationSection(reversed=reversed).placement
    return UnknownPart(part, parameters, turned)


def random_theta(model, count, seed=0):
    fractions = np.random.default_rng(seed).random((count, len(model.parameters)))
    columns = [p.from_unit(part) for p, part in zip(model.parameters, fractions.T, strict=True)]
    return np.stack(columns, axis=1) if columns else fractions


def stacked(matrices):
    return np.stack([getattr(matrices, name) for name in "MKCD"], axis=1)


def largest_error(values, expected, negligible=0.0):
    """Return the largest error of (n, 4, d, d) arrays on the scale of each entry, and of the largest of its matrix."""
    largest = np.abs(expected).max(axis=(0, 2, 3), keepdims=True)
    scale = np.abs(expected).max(axis=0, keepdims=True) + 1e-6 * largest + negligible
    return float((np.abs(values - expected) / np.where(scale > 0, scale, 1.0)).max())


def by_eighth_order(function, theta, column):
    """Return differences of eighth order by one parameter, with steps of 1 % of it."""
    step = np.zeros_like(theta)
    step[:, column] = 1e-2 * theta[:, column]
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    total = sum(w * (function(theta + k * step) - function(theta - k * step)) for k, w in weights.items())
    return total / step[:, column].reshape(-1, 1, 1, 1)


SUPERPOSED = [
    *(pytest.param(lambda m=m, o=o: component("joint", m, o), id=f"{m}-{i}") for i, (m, o) in enumerate(JOINTS)),
    *(pytest.param(lambda place=place: unknown_part("timoshenko_beam", BEAM, [place]), id=place) for place in OPTIONS),
    pytest.param(lambda: unknown_part("timoshenko_beam", BEAM, OPTIONS), id="every option"),
    pytest.param(lambda: unknown_part("timoshenko_beam", BEAM, OPTIONS[:6], reversed=True), id="reversed"),
    pytest.param(lambda: unknown_part("lumped", MASSES, ["masses.0.mass", "masses.0.inertia"]), id="lumped"),
    pytest.param(lambda: unknown_part("lumped", MASSES, ["masses.1.mass"], reversed=True), id="lumped reversed"),
]


@pytest.mark.parametrize("make", SUPERPOSED)
def test_a_superposition_is_the_matrices_to_rounding(make):
    model = make()
    theta = random_theta(model, 20, seed=1)
    superposed = model.superposition
    assert superposed is not None
    entries = superposed.entries @ superposed.functions(theta)
    values = np.moveaxis(entries.reshape(4, model.size, model.size, -1), -1, 0)
    assert largest_error(values, stacked(model.matrices(theta))) < 1e-12


@pytest.mark.parametrize("make", SUPERPOSED)
def test_derivatives_in_closed_form_agree_with_differences_of_eighth_order(make):
    model = make()
    theta = random_theta(model, 6, seed=2)
    jacobian = model.matrices_jacobian(theta)
    assert len(jacobian) == len(model.parameters)
    for column, derivative in enumerate(jacobian):
        expected = by_eighth_order(lambda vectors: stacked(model.matrices(vectors)), theta, column)
        rounding = 1e-3 * np.abs(stacked(model.matrices(theta))) / theta[:, column].reshape(-1, 1, 1, 1)
        assert largest_error(stacked(derivative), expected, rounding) < 2e-9


@pytest.mark.parametrize("make", SUPERPOSED)
def test_a_vector_has_the_same_functions_and_slopes_bit_for_bit_in_any_batch(make):
    model = make()
    theta = random_theta(model, 37, seed=3)
    superposed = model.superposition
    for evaluate in (superposed.functions, superposed.slopes):
        together = evaluate(theta)
        for row in (0, 5, 36):
            assert np.array_equal(evaluate(theta[row : row + 1])[:, 0], together[:, row])


class Spring(dovetail.JointModel):
    """A spring whose stiffness is a function of two parameters."""

    name = "spring"
    summary = "A spring"
    parameters = (dovetail.Parameter("k", "N/m", 1e5, 1e7, "log"), dovetail.Parameter("p", "1", 0.5, 2.0))
    ports = (dovetail.JointPort("a", 1), dovetail.JointPort("b", 1))

    def stiffness(self, k, p):
        return k + 1e5 * p**3

    def matrices(self, theta):
        joint = dovetail.StructuralMatrices.zeros(len(theta), self.size)
        joint.add_contact_layer([(0, 2), (1, 3)], self.stiffness(*theta.T))
        return joint


class LinearInStiffness(Spring):
    linear_parameters = ("k",)

    def matrices(self, theta):
        return super().matrices(theta)


class SquareRoot(LinearInStiffness):
    linear_parameters = ("k",)

    def matrices(self, theta):
        return super().matrices(np.sqrt(theta))


class SlopeThatChanges(LinearInStiffness):
    linear_parameters = ("k",)

    def matrices(self, theta):
        return super().matrices(theta * theta[:, 1:])


class SlightlyBent(LinearInStiffness):
    linear_parameters = ("k",)

    def matrices(self, theta):
        return super().matrices(theta + 1e-15 * theta**2)


class OfNoParameter(LinearInStiffness):
    linear_parameters = ("q",)

    def matrices(self, theta):
        return super().matrices(theta)


class WrongSlope(LinearInStiffness):
    """Its scaled matrices do not add up to the rest."""

    linear_parameters = ("k",)
    factor = 2e5

    @property
    def scaled_matrices(self):
        K = np.kron(np.array([[1.0, -1.0], [-1.0, 1.0]]), np.eye(2))
        return dovetail.ScaledMatrices(
            [dovetail.StructuralMatrices(np.zeros_like(K), K)],
            lambda theta: self.factor * theta**3,
            lambda theta: 3.0 * self.factor * theta[..., np.newaxis] ** 2,
        )

    def matrices(self, theta):
        return super().matrices(theta)


class RightSlope(WrongSlope):
    factor = 1e5


class WrongShape(RightSlope):
    linear_parameters = ("k",)

    @property
    def scaled_matrices(self):
        scaled = super().scaled_matrices
        return dovetail.ScaledMatrices(scaled.matrices, lambda theta: theta[:, 0], scaled.slopes)

    def matrices(self, theta):
        return super().matrices(theta)


class NotFinite(RightSlope):
    """Its functions are not finite where p is large."""

    linear_parameters = ("k",)

    @property
    def scaled_matrices(self):
        scaled = super().scaled_matrices

        def factors(theta):
            return np.where(theta > 2.5, np.nan, scaled.factors(theta))

        return dovetail.ScaledMatrices(scaled.matrices, factors, scaled.slopes)

    def matrices(self, theta):
        return super().matrices(theta)


@pytest.mark.parametrize(
    ("model", "message"),
    [
        (SquareRoot, r"joint model 'spring'.*not linear in 'k' .* Remove 'k' from its linear parameters"),
        (SlopeThatChanges, r"not linear in 'k' with a slope that no parameter changes"),
        (SlightlyBent, r"not linear in 'k'"),
        (OfNoParameter, r"it has no parameter 'q'\.\s+Accepted: k, p"),
        (WrongSlope, r"scaled_matrices and linear parameters do not add up to its matrices"),
        (WrongShape, r"its factors have the shape \(4,\)\.\s+Accepted: \(4, 1\)"),
    ],
)
def test_a_false_declaration_is_an_error(model, message):
    with pytest.raises(dovetail.PluginError, match=f"(?s){message}"):
        model().matrices_jacobian(np.array([[1e6, 1.0]]))


def test_a_declared_parameter_has_an_exact_slope_and_the_others_are_differentiated():
    theta = random_theta(Spring(), 5)
    by_k, by_p = LinearInStiffness().matrices_jacobian(theta)
    assert LinearInStiffness().superposition is None
    assert (by_k.K[:, 0, 0] == 1.0).all()
    np.testing.assert_allclose(by_p.K[:, 0, 0], 3e5 * theta[:, 1] ** 2, rtol=1e-9)
    exact = RightSlope().matrices_jacobian(theta)
    assert (exact[0].K[:, 0, 2] == -1.0).all()
    np.testing.assert_allclose(exact[1].K[:, 0, 0], 3e5 * theta[:, 1] ** 2, rtol=1e-14)


def test_a_derived_class_with_other_matrices_inherits_no_declaration():
    class Cubic(RightSlope):
        def matrices(self, theta):
            joint = super().matrices(theta)
            joint.K[:] **= 3
            return joint

    assert Cubic().superposition is None
    theta = np.array([[1e6, 1.0]])
    expected = 3.0 * RightSlope().matrices(theta).K[0, 0, 0] ** 2
    assert Cubic().matrices_jacobian(theta)[0].K[0, 0, 0] == pytest.approx(expected, rel=1e-9)


def test_a_function_that_is_not_finite_is_an_error_that_names_the_matrix():
    with pytest.raises(dovetail.PluginError, match="returns a matrix K that is not finite"):
        NotFinite().superposition.functions(np.array([[1e6, 3.0]]))


PLUGIN = """
import dovetail
import numpy as np


class Stop(dovetail.JointModel):
    name = "stop"
    summary = "A spring in translation, and one in rotation that acts only above p = 2"
    parameters = (dovetail.Parameter("k", "N/m", 1e5, 1e7, "log"), dovetail.Parameter("p", "1", 0.5, 2.0))
    ports = (dovetail.JointPort("a", 1), dovetail.JointPort("b", 1))
    linear_parameters = DECLARED

    def matrices(self, theta):
        joint = dovetail.StructuralMatrices.zeros(len(theta), self.size)
        joint.add_contact_layer([(0, 2)], theta[:, 0])
        joint.add_contact_layer([(0, 3)], 1e4 * np.maximum(theta[:, 1] - 2.0, 0.0))
        return joint

    @property
    def scaled_matrices(self):
        K = self.matrices(np.array([[0.0, 3.0]])).K[0]
        return SCALED and dovetail.ScaledMatrices(
            [dovetail.StructuralMatrices(np.zeros_like(K), K)],
            lambda theta: np.maximum(theta - 2.0, 0.0),
            lambda theta: (theta > 2.0)[..., None].astype(float),
        )


@dovetail.hookimpl
def dovetail_components():
    return [Stop]
"""
TWO_MASSES: dict[str, Any] = {
    "dovetail": 1,
    "name": "two masses",
    "frequency": {"start": "20 Hz", "stop": "900 Hz", "step": "20 Hz"},
    "substructures": {
        "first": {"model": "lumped", "masses": [{"mass": "1 kg", "inertia": "1e-3 kg m^2"}]},
        "second": {"model": "lumped", "masses": [{"mass": "2 kg", "inertia": "2e-3 kg m^2"}]},
    },
    "joints": {"stop": {"model": "stop", "connect": {"a": {"to": "first", "at": 0}, "b": {"to": "second", "at": 0}}}},
    "response": {"at": "first", "position": 0},
}


def test_entries_that_only_other_parameters_fill_extend_the_plan(tmp_path):
    plain, declared = tmp_path / "plain.py", tmp_path / "declared.py"
    plain.write_text(PLUGIN.replace("DECLARED", "()").replace("SCALED and", "None and"))
    declared.write_text(PLUGIN.replace("DECLARED", '("k",)').replace("SCALED and", ""))
    theta = np.array([[1e6, 1.0], [2e6, 3.0], [5e5, 2.5]])
    known, planned = (dovetail.load(TWO_MASSES, plugins=file) for file in (plain, declared))
    assert known.graph.connections["stop"].model.superposition is None
    assert planned.graph.connections["stop"].model.superposition is not None
    first = planned.frf(theta[:1])
    np.testing.assert_allclose(planned.frf(theta), known.frf(theta), rtol=1e-12)
    for values, expected in zip(planned.frf_jacobian(theta), known.frf_jacobian(theta), strict=True):
        np.testing.assert_allclose(values, expected, rtol=1e-7, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_allclose(planned.frf(theta[:1]), first, rtol=1e-12)


FREE_BEAM: dict[str, Any] = {
    "dovetail": 1,
    "name": "free beam",
    "frequency": {"start": "100 Hz", "stop": "1200 Hz", "step": "20 Hz"},
    "substructures": {
        "beam": {
            "model": "timoshenko_beam",
            "material": {
                "young": {"range": ["190 GPa", "220 GPa"]},
                "density": {"range": ["7600 kg/m^3", "8000 kg/m^3"]},
                "loss_factor": {"range": [1e-4, 1e-2], "scale": "log"},
            },
            "sections": [
                {"length": "600 mm", "width": "40 mm", "height": {"range": ["8 mm", "12 mm"]}, "elements": 52}
            ],
        }
    },
    "response": {"at": "beam", "position": 0},
}


def test_a_beam_of_many_nodes_takes_memory_for_its_filled_entries_only(peak_of):
    assembly = dovetail.load(FREE_BEAM)
    theta = assembly.from_unit(np.random.default_rng(0).random((400, 4)))
    assembly.frf_jacobian(theta[0])
    inputs, by_joint = assembly.engine.plan.inputs, assembly.by_joint(theta)
    arrays = (inputs.gather(by_joint, 400), inputs.gather_weights(by_joint, 400))
    dense = 8 * 400 * 4 * 106**2 / 1e6
    assert sum(array.nbytes for array in arrays) / 1e6 < 0.25 * dense
    assert peak_of(lambda: inputs.gather(by_joint, 400)) < 0.1 * dense
    assert peak_of(lambda: inputs.gather_weights(by_joint, 400)) < 0.4 * dense
