"""The descriptions that ship with the built-in components, sound and broken."""

from __future__ import annotations

import json

import pytest

from dovetail.description import read_description
from dovetail.errors import DescriptionError
from dovetail.registry import installed_components

BROKEN = {
    "parameter": (
        "      kr_tc:",
        "      k_ry:",
        "joints.collet.parameters.k_ry\n"
        "  'k_ry' is not a parameter of joint model 'collet' (dovetail-frf 0.1.0).\n"
        "  Did you mean 'kr_tc'?  Accepted: Dc [m], dc [m], mn1 [kg], mn2 [kg], kt_tc [N/m], kr_tc [N m/rad], "
        "ct_tc [N s/m], cr_tc [N m s/rad], kt_hc [N/m], kr_hc [N m/rad], ct_hc [N s/m], cr_hc [N m s/rad]",
    ),
    "model": (
        "    model: collet",
        "    model: colet",
        "joints.collet.model\n"
        "  'colet' is not a joint model.\n"
        "  Did you mean 'collet'?",
    ),
    "bore": (
        "inner: 25 mm",
        "inner: 52 mm",
        "substructures.holder.sections[2]\n  the inner diameter must be smaller than the outer one.",
    ),
    "material": (
        "poisson: 0.3, loss_factor: 0.005",
        "poison: 0.3, loss_factor: 0.005",
        "substructures.tool.material.poison\n"
        "  'poison' is not a key of 'material' of substructure model 'timoshenko_beam' (dovetail-frf 0.1.0).\n"
        "  Did you mean 'poisson'?",
    ),
}  # fmt: skip


def test_all_of_them_read_and_survive_their_own_text(assemblies):
    files = sorted(assemblies.glob("*.yaml"))
    assert files
    for file in files:
        first = read_description(file, installed_components())
        second = read_description(json.loads(first.text), installed_components())
        assert second.text == first.text
        assert {n: p.config for n, p in second.substructures.items()} == {
            n: p.config for n, p in first.substructures.items()
        }


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_shipped_description_has_its_message(case, assemblies, tmp_path):
    old, new, expected = BROKEN[case]
    sound = (assemblies / "bt40_er32.yaml").read_text()
    assert sound.count(old) == 1
    text = sound.replace(old, new)
    file = tmp_path / "bt40_er32.yaml"
    file.write_text(text)
    with pytest.raises(DescriptionError) as caught:
        read_description(file, installed_components())
    place, _, message = str(caught.value).partition("  ")
    line = next(number for number, words in enumerate(text.splitlines(), start=1) if new.strip() in words)
    assert place.startswith(f"{file}:{line}:")
    assert message.startswith(expected)
