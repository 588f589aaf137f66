"""FRFs of parts that are not as described, and intervals that allow for it."""

from dataclasses import replace

import numpy as np
import pytest

import dovetail
from dovetail.inference.fitting import refine
from dovetail.inference.posterior import error_shapes, laplace_posterior, typical_model_error
from dovetail.inference.posterior.likelihood import build_likelihood
from dovetail.problem import Problem
from dovetail.problem.part_quantities import known_quantities, list_quantities, quantity_derivatives, with_part


def test_derivatives_are_those_of_an_oscillator_by_its_mass(sdof):
    stiffness, damping = theta = sdof.from_unit(np.array([0.3, 0.7]))
    lines = np.arange(5, 600, 7)
    omega = 2.0 * np.pi * sdof.frequency[lines]
    dynamic_stiffness = stiffness + 1j * omega * damping - omega**2
    (by_mass,) = quantity_derivatives(sdof, theta, lines)
    assert by_mass == pytest.approx(-(omega**4) / dynamic_stiffness**2, rel=1e-3)


def test_only_parts_that_are_known_have_quantities(assemblies):
    known = dovetail.load(assemblies / "shaft_hub.yaml")
    named = [(part, quantity.name) for part, quantity, _ in known_quantities(known)]
    assert {part for part, _ in named} == {"shaft", "hub"}
    assert ("shaft", "material.young") in named
    assert len(named) == sum(len(list_quantities(part)) for part in known.description.known_parts.values())


def test_an_assembly_with_another_part_has_the_contacts_and_lines_of_the_first(assemblies):
    rigid = dovetail.load(assemblies / "shaft_hub.yaml").rigid()
    rigid = rigid.on(rigid.frequency[::9])
    same = with_part(rigid, "shaft", rigid.description.substructures["shaft"])
    np.testing.assert_array_equal(same.frf(), rigid.frf())


def test_each_quantity_is_off_by_as_much_as_displaced_resonances_are_large(sdof):
    values = sdof.frf(sdof.from_unit(np.full(2, 0.5)))
    frf = dovetail.Frf(sdof.frequency, values, "accelerance", variance=1e-4 * np.abs(values) ** 2)
    fit = refine(Problem.of(sdof, frf))
    error = typical_model_error(5e-4)
    with_parts = replace(error, quantities=error.natural_frequency)
    plain, parts = (build_likelihood(Problem.of(sdof, frf), fit, allowed).errors for allowed in (error, with_parts))
    assert parts[:-1] == pytest.approx(plain)
    shapes = error_shapes([frf], [sdof.frf(fit.theta)], error)["natural_frequency"]
    displaced = np.sqrt(2.0 * np.sum(np.abs(shapes) ** 2 / fit.variance))
    assert np.linalg.norm(parts[-1]) == pytest.approx(displaced)


def test_intervals_hold_what_the_modulus_of_a_part_hides(assemblies):
    """A shaft that is 0.4 % stiffer: the stiffness of the fit follows it, and the residuals show a tenth of it."""
    assembly = dovetail.load(assemblies / "shaft_hub.yaml")
    assembly = assembly.on(assembly.frequency[::4])
    theta = assembly.from_unit(np.full(4, 0.5))
    shaft = assembly.description.substructures["shaft"]
    young = next(quantity for quantity in list_quantities(shaft) if quantity.name == "material.young")
    values = with_part(assembly, "shaft", young.replace(shaft, 1.004 * young.value)).frf(theta)
    random = np.random.default_rng(0)
    noise = 0.01 * np.abs(values) * random.standard_normal((2, len(values))).T.copy().view(complex)[:, 0] / np.sqrt(2.0)
    measured = dovetail.Frf(
        assembly.frequency, values + noise, assembly.description.response.quantity, variance=1e-4 * np.abs(values) ** 2
    )
    result = dovetail.identify(assembly, measured, form="laplace", cause_seconds=0)
    allowed = result.adequacy.error_in_intervals
    assert allowed.quantities == allowed.natural_frequency
    truth = dict(zip(result.posterior.names, theta, strict=True))

    def held(posterior):
        return {name for name, (low, high) in posterior.interval().items() if low <= truth[name] <= high}

    assert held(result.posterior) == set(truth)
    without = laplace_posterior(
        Problem.of(assembly, measured), result.fit, model_error=replace(allowed, quantities=0.0)
    )
    assert held(without) < set(truth)
