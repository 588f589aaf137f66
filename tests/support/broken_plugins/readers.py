"""A sound reader, and one with a single fault for each check of the kit that readers have."""

from __future__ import annotations

import struct

import numpy as np

from dovetail import FrfReader, RecordedFrf
from support.broken_plugins.lists import breaks

HEAD = b"SOUND 1\n"
LINE = 24


class SoundReader(FrfReader):
    """A signature and little-endian doubles: frequency, real and imaginary part."""

    name = "sound_reader"
    summary = "Doubles behind a signature"
    suffixes = (".snd",)

    def sniff(self, content):
        """Look for the signature."""
        return content.startswith(HEAD)

    def read(self, path, content):
        """Return the one FRF."""
        if not content.startswith(HEAD) or len(content) < len(HEAD) + LINE or (len(content) - len(HEAD)) % LINE:
            raise ValueError("the file is cut.")
        return [self.recorded(np.frombuffer(content[len(HEAD) :], dtype="<f8").reshape(-1, 3))]

    def recorded(self, lines):
        """Return the FRF of the lines."""
        return RecordedFrf(lines[:, 0], lines[:, 1] + 1j * lines[:, 2], "m/N")

    def samples(self, folder):
        """Write one file."""
        file = folder / "sample.snd"
        file.write_bytes(HEAD + struct.pack("<9d", 10.0, 1.0, 0.1, 20.0, 2.0, 0.2, 30.0, 3.0, 0.3))
        return [file]


@breaks("sample_files_have_a_suffix_of_it")
class WithoutSamples(SoundReader):
    """No file to be tested with."""

    def samples(self, folder):
        """Write nothing."""
        return []


@breaks("sample_files_are_read")
class InMillimetres(SoundReader):
    """A unit that is none of an FRF."""

    def recorded(self, lines):
        """Return an FRF in mm."""
        return RecordedFrf(lines[:, 0], lines[:, 1] + 1j * lines[:, 2], "mm")


@breaks("other_files_are_not_taken")
class Greedy(SoundReader):
    """Takes whatever has its suffix."""

    def sniff(self, content):
        """Take it."""
        return True


@breaks("reading_twice_gives_the_same")
class Growing(SoundReader):
    """Counts in its class what it has read."""

    count = 0

    def recorded(self, lines):
        """Return an FRF with a larger amplitude each time."""
        type(self).count += 1
        return RecordedFrf(lines[:, 0], self.count * lines[:, 1], "m/N")


@breaks("damaged_files_are_refused_or_read")
class Trusting(SoundReader):
    """Fails with an error of struct's where the file is cut."""

    def read(self, path, content):
        """Unpack what is announced."""
        lines = np.array(struct.unpack_from("<9d", content, len(HEAD))).reshape(-1, 3)
        return [self.recorded(lines)]


@breaks("written_files_are_read")
class WritingAmplitudes(SoundReader):
    """Writes a format that has no phase."""

    written = (".snd",)

    def write(self, content, path):
        """Write the amplitude as the real part."""
        lines = np.column_stack([content.frf.frequency, np.abs(content.values), 0 * content.frf.frequency])
        return HEAD + lines.astype("<f8").tobytes()


@breaks("nothing_is_printed_or_changed")
class Chatting(SoundReader):
    """Prints what it reads."""

    def recorded(self, lines):
        """Print the number of lines."""
        print(len(lines))
        return super().recorded(lines)
