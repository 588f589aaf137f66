"""A sound reader of matrices, and one with a single fault for each check of the kit that such readers have."""

from __future__ import annotations

import struct

import numpy as np

from dovetail import DofTable, MatrixReader, RecordedMatrix, RecordedModel
from support.broken_plugins.lists import breaks

HEAD = b"STIFFNESS 1\n"


class SoundMatrixReader(MatrixReader):
    """A signature and little-endian doubles: the stiffness of a row of springs."""

    name = "sound_matrix_reader"
    summary = "Springs behind a signature"
    suffixes = (".spr",)

    def sniff(self, content):
        """Look for the signature."""
        return content.startswith(HEAD)

    def read(self, path, content):
        """Return the one matrix."""
        if not content.startswith(HEAD) or len(content) < len(HEAD) + 8 or (len(content) - len(HEAD)) % 8:
            raise ValueError("the file is cut.")
        return self.recorded(np.frombuffer(content[len(HEAD) :], dtype="<f8"), path)

    def recorded(self, springs, path):
        """Return the matrix of the springs."""
        K = np.diag([*springs, 0.0]) + np.diag([0.0, *springs]) - np.diag(springs, 1) - np.diag(springs, -1)
        nodes = tuple(str(node) for node in range(len(K)))
        table = DofTable(nodes, ("x",) * len(K), np.arange(len(K)), None, str(path))
        return RecordedModel({"K": RecordedMatrix(K, "K")}, table)

    def samples(self, folder):
        """Write one file."""
        file = folder / "sample.spr"
        file.write_bytes(HEAD + struct.pack("<3d", 1e6, 2e6, 3e6))
        return [file]


@breaks("sample_files_have_a_suffix_of_it")
class WithoutMatrixSamples(SoundMatrixReader):
    """No file to be tested with."""

    def samples(self, folder):
        """Write nothing."""
        return []


@breaks("sample_files_are_read")
class ShortTable(SoundMatrixReader):
    """Names a row that the matrix does not have."""

    def recorded(self, springs, path):
        """Return the table with its rows counted from 1."""
        model = super().recorded(springs, path)
        table = DofTable(model.table.nodes, model.table.directions, model.table.rows + 1, None, str(path))
        return RecordedModel(model.matrices, table)


@breaks("other_files_are_not_taken")
class GreedyMatrixReader(SoundMatrixReader):
    """Takes whatever has its suffix."""

    def sniff(self, content):
        """Take it."""
        return True


@breaks("reading_twice_gives_the_same")
class Stiffening(SoundMatrixReader):
    """Counts in its class what it has read."""

    count = 0

    def recorded(self, springs, path):
        """Return stiffer springs each time."""
        type(self).count += 1
        return super().recorded(self.count * springs, path)


@breaks("damaged_files_are_refused_or_read")
class TrustingMatrixReader(SoundMatrixReader):
    """Fails with an error of struct's where the file is cut."""

    def read(self, path, content):
        """Unpack what is expected."""
        return self.recorded(np.array(struct.unpack_from("<3d", content, len(HEAD))), path)


@breaks("nothing_is_printed_or_changed")
class ChattingMatrixReader(SoundMatrixReader):
    """Prints what it reads."""

    def recorded(self, springs, path):
        """Print the number of springs."""
        print(len(springs))
        return super().recorded(springs, path)
