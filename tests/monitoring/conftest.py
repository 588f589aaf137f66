"""Mornings that several tests watch."""

import pytest

from support.watched_mornings import write_mornings, write_series


@pytest.fixture(scope="session")
def mornings(tmp_path_factory):
    """A folder with 28 mornings, the stiffness of the last eight a tenth smaller, and the description of the watch."""
    folder = tmp_path_factory.mktemp("mornings")
    write_mornings(folder / "files", 28, loss_at=20)
    return folder, write_series(folder)
