"""Two like masses on springs can be exchanged: two separate sets of stiffnesses explain an FRF equally well."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

import dovetail


def like_branches(*names) -> dovetail.Assembly:
    """Masses of 1 kg on a driven one of 1.5 kg, their springs unknown."""
    masses = {"root": 1.5, **dict.fromkeys(names, 1.0)}
    parts = {name: {"model": "lumped", "masses": [{"mass": mass}]} for name, mass in masses.items()}
    unknown = {"range": [1e5, 6e6], "scale": "log"}

    def spring(lower, upper, stiffness):
        connect = {"a": {"to": lower, "at": 0}, "b": {"to": upper, "at": 0}}
        parameters = {"k": stiffness, "c": {"value": 25.0}}
        return {"model": "spring_damper", "direction": "x", "connect": connect, "parameters": parameters}

    return dovetail.load(
        {
            "dovetail": 1,
            "name": "branches",
            "frequency": {"start": 10.0, "stop": 350.0, "lines": 120},
            "substructures": {"ground": {"model": "ground"}, **parts},
            "joints": {
                "foot": spring("ground", "root", {"value": 1e6}),
                **{name: spring("root", name, unknown) for name in names},
            },
            "response": {"at": "root", "position": 0, "quantity": "receptance"},
        }
    )


@pytest.mark.parametrize("seed", [0, 1])
def test_samples_about_each_of_two_modes_scatter_as_the_noise_says(seed):
    """One tangent map reached half of each mode: a third too narrow, and next to the truth."""
    assembly = like_branches("first", "second")
    truth = np.array([9e5, 1.1e6])
    clean = dovetail.Frf(assembly.frequency, assembly.frf(truth), "receptance")
    measured = dovetail.noisy_frf(clean, 0.05, seed)
    posterior = dovetail.identify(assembly, measured, "posterior", model_error=0.0, cause_seconds=0).posterior
    by_log = assembly.frf_jacobian(truth[np.newaxis])[1][0] * truth
    information = 2.0 * np.real(by_log.T @ (by_log.conj() / measured.variance[:, np.newaxis]))
    deviation = np.sqrt(np.diag(np.linalg.inv(information)))
    lower_first = posterior.theta[:, 0] < posterior.theta[:, 1]
    for in_mode, values in ((lower_first, truth), (~lower_first, truth[::-1])):
        weight = posterior.weight[in_mode]
        assert weight.sum() == pytest.approx(0.5, abs=0.1)
        logs = np.log(posterior.theta[in_mode] / values)
        order = np.argsort(values)
        np.testing.assert_allclose(logs.std(axis=0)[order], deviation, rtol=0.2)
        assert (np.abs(weight @ logs / weight.sum())[order] < 3.0 * deviation).all()
    assert len(posterior.groups) == 2
    assert max(posterior.split_half_difference.values()) < 0.3  # both halves of the samples have both modes


@pytest.mark.parametrize("seed", [0, 1])
def test_every_order_of_like_branches_is_sampled(seed):
    """Of six orders, searches from points at random found two to four."""
    assembly = like_branches("first", "second", "third")
    truth = np.array([3e5, 8e5, 2e6])
    clean = dovetail.Frf(assembly.frequency, assembly.frf(truth), "receptance")
    measured = dovetail.noisy_frf(clean, 0.05, seed)
    posterior = dovetail.identify(assembly, measured, "posterior", model_error=0.0, cause_seconds=0).posterior
    order = np.argsort(posterior.theta, axis=1)
    shares = [posterior.weight[(order == np.array(one)).all(axis=1)].sum() for one in permutations(range(3))]
    np.testing.assert_allclose(shares, 1 / 6, atol=0.06)
