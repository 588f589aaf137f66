"""The ``dovetail`` command as a process of its own."""

from __future__ import annotations

import os
import sys


def main() -> None:
    """Run the command line; Ctrl-C ends it without a traceback from the first import on.

    Linear algebra has one thread unless the environment says otherwise: its matrices are small, and what is large is
    divided among threads of Dovetail's own. Idle threads of OpenBLAS would take 0.25 s of processor time.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read when NumPy and SciPy are loaded
    try:
        from dovetail.cli import main as run
    except KeyboardInterrupt:
        sys.stderr.write("\nInterrupted.\n")
        sys.exit(130)
    run()


if __name__ == "__main__":
    main()
