"""Joints whose dampers act as structural damping, against closed formulas."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import dovetail
from dovetail.errors import DescriptionError
from dovetail_bench.evaluation.mesh_refinement import finer

ASSEMBLIES = Path(__file__).resolve().parents[2] / "assemblies"
AT = 159.0
"""Hz; where structural damping and dampers are equal."""
K, C = 1e6, 50.0


def damped(name, structural="159 Hz", **changes):
    description = json.loads(dovetail.load(ASSEMBLIES / name).description.text)
    for joint in description["joints"].values():
        joint["structural_damping"] = structural
    return dovetail.load(description | changes)


def test_the_loss_factor_equals_that_of_the_damper_at_the_given_frequency():
    """One mass: -omega^2 / (k (1 + i eta) - omega^2 m), with eta = omega c / k at that frequency."""
    model = damped("sdof.yaml")
    omega, eta = 2.0 * np.pi * model.frequency, 2.0 * np.pi * AT * C / K
    by_formula = -(omega**2) / (K * (1.0 + 1j * eta) - omega**2)
    values, jacobian = model.frf_jacobian({"k": K, "c": C})
    assert np.allclose(values, by_formula, rtol=1e-12, atol=0.0)
    by_damper = 1j * 2.0 * np.pi * AT * by_formula**2 / omega**2
    assert np.allclose(jacobian[:, 1], by_damper, rtol=1e-9, atol=0.0)


def test_an_exponential_window_does_not_change_structural_damping():
    """It moves the frequency to omega - i s, on which the stiffness k (1 + i eta) does not depend."""
    response = {"at": "mass", "position": 0, "quantity": "receptance", "calibration": {"window": "20 1/s"}}
    model = damped("sdof.yaml", response=response)
    moved, eta = 2.0 * np.pi * model.frequency - 20j, 2.0 * np.pi * AT * C / K
    assert np.allclose(model.frf({"k": K, "c": C}), 1.0 / (K * (1.0 + 1j * eta) - moved**2), rtol=1e-10, atol=0.0)


@pytest.mark.parametrize("name", ["bolted_lap_beam.yaml", "bt40_er32_quick.yaml"])
def test_it_equals_the_viscous_joint_only_at_the_given_frequency(name):
    model, viscous = damped(name), dovetail.load(ASSEMBLIES / name)
    theta = viscous.from_unit(np.full(len(viscous.parameters), 0.9))
    axis = np.array([0.5, 1.0, 2.0]) * AT
    there, plain = model.on(axis).frf(theta), viscous.on(axis).frf(theta)
    assert there[1] == pytest.approx(plain[1], rel=1e-12)
    assert (np.abs(there - plain) > 1e-9 * np.abs(plain)).tolist() == [True, False, True]


def test_a_finer_mesh_keeps_it():
    model = damped("bolted_lap_beam.yaml")
    theta = model.from_unit(np.full(len(model.parameters), 0.9))
    same = finer(model, 2).on(np.array([2.0 * AT])).frf(theta)
    plain = finer(dovetail.load(ASSEMBLIES / "bolted_lap_beam.yaml"), 2).on(np.array([2.0 * AT])).frf(theta)
    assert np.abs(same - plain) > 1e-9 * np.abs(plain)


@pytest.mark.parametrize(
    ("structural", "message"),
    [
        ("0 Hz", "joints.mount.structural_damping\n  '0 Hz' must be greater than 0."),
        ("3 m", "joints.mount.structural_damping\n  '3 m'"),
        (True, "joints.mount.structural_damping\n  true"),
    ],
)
def test_an_impossible_frequency_of_structural_damping_is_refused(structural, message):
    with pytest.raises(DescriptionError) as refused:
        damped("sdof.yaml", structural)
    assert message in str(refused.value)


def test_a_joint_without_dampers_is_refused():
    base = {"a": {"to": "mass", "at": 0}, "b": {"to": "base", "at": 0}}
    joints = {"mount": {"model": "rigid", "connect": base, "structural_damping": "159 Hz"}}
    with pytest.raises(DescriptionError, match="has no dampers that could act as structural damping"):
        dovetail.load(json.loads(dovetail.load(ASSEMBLIES / "sdof.yaml").description.text) | {"joints": joints})


def test_a_model_may_have_an_option_of_that_name(tmp_path):
    """Then it is the model's own, as any other option."""
    (tmp_path / "pad.py").write_text(
        "import dovetail\n"
        "from dovetail_plugins.joints.spring_damper import SpringDamper\n\n\n"
        "class Pad(SpringDamper):\n"
        "    name = 'pad'\n\n"
        "    class Config(SpringDamper.Config):\n"
        "        structural_damping: float = 0.1\n\n\n"
        "@dovetail.hookimpl\n"
        "def dovetail_components():\n"
        "    return [Pad]\n"
    )
    description = json.loads(dovetail.load(ASSEMBLIES / "sdof.yaml").description.text)
    description["joints"]["mount"] |= {"model": "pad", "structural_damping": 0.3}
    joint = dovetail.load(description, plugins=[tmp_path / "pad.py"]).description.joints["mount"]
    assert joint.connection.model.config.structural_damping == 0.3
    assert joint.structural_damping is None
