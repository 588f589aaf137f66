"""The readers of matrices that ship with Dovetail, by the conformance kit as anybody's."""

from __future__ import annotations

import pytest

from dovetail.registry import installed_components
from dovetail.testing import check_names
from dovetail.testing.kit import each_check

READERS = [offer.component for offer in installed_components().offers("matrix_reader")]
GUARDED = ("matrix_archive", "matrix_market", "ansys_full")
"""Those that read some files in a process of their own, which takes time; `tests/fuzz` alters their files."""
DAMAGE = "damaged_files_are_refused_or_read"


@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.name)
def test_own_matrix_readers_pass_the_kit(reader):
    checks = set(check_names("matrix_reader")) - ({DAMAGE} if reader.name in GUARDED else set())
    results = [*each_check(reader, checks)]
    assert [str(result) for result in results if not result.ok] == []


@pytest.mark.slow
@pytest.mark.parametrize("reader", [reader for reader in READERS if reader.name in GUARDED], ids=lambda one: one.name)
def test_damage_to_guarded_formats_is_refused_or_read(reader):
    assert [str(result) for result in each_check(reader, {DAMAGE}) if not result.ok] == []


def test_every_format_has_a_matrix_reader():
    suffixes = {suffix for reader in READERS for suffix in reader.suffixes}
    assert {".npz", ".mat", ".mtx", ".op4", ".pch", ".bdf", ".inp", ".matrix", ".mapping", ".full"} <= suffixes
