"""The example assemblies and measurements that ship with the package."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from dovetail.assembly import Assembly
from dovetail.assembly import load as load_description
from dovetail.atomic_files import write_whole
from dovetail.errors import DovetailError, Fault, ParameterError, did_you_mean, listing
from dovetail.frf import Frf
from dovetail.measurement import read_frf

_PLACES = (Path(__file__).with_name("assemblies"), Path(__file__).parents[2] / "assemblies")
"""Where the files are in an installed package, and in a clone of the repository, from which the package takes them."""


@dataclass(frozen=True)
class Example:
    """One example.

    Parameters
    ----------
    name : str
    summary : str
    description : str
        File of the assembly or of the series, below the folder of all examples.
    measurement : str
        File of a measured FRF; empty if there is none.
    further : tuple of str
        Patterns of other files that belong to it.
    """

    name: str
    summary: str
    description: str
    measurement: str = ""
    further: tuple[str, ...] = ()


_COLLET = "measurements/h0_j_t0_60Nm"
_CAMPAIGN = ("bt40_er32.yaml", "campaign/*.yaml", "campaign/*.py", "campaign/cases/*", "campaign/measurements/*")
EXAMPLES = {
    example.name: example
    for example in (
        Example("sdof", "one mass on a spring and a damper, the smallest assembly", "sdof.yaml"),
        Example(
            "collet",
            "a tool in an ER32 collet in a BT40 holder, twelve parameters; synthetic FRF",
            "bt40_er32.yaml",
            f"{_COLLET}.uff",
            (f"{_COLLET}.truth.json", f"{_COLLET}_two_points.uff", "bt40_er32_quick.yaml", "bt40_er32_two_points.yaml"),
        ),
        Example(
            "bolted",
            "two bars with a bolted lap; synthetic FRF",
            "bolted_lap_beam.yaml",
            "measurements/bolted_lap_beam.uff",
            ("measurements/bolted_lap_beam.truth.json",),
        ),
        Example(
            "shaft-hub",
            "a shaft in a hub by an interference fit; synthetic FRF",
            "shaft_hub.yaml",
            "measurements/shaft_hub.uff",
            ("measurements/shaft_hub.truth.json",),
        ),
        Example(
            "spindle",
            "tool, collet, holder, taper and spindle: two joints at once; synthetic FRF",
            "spindle_bt40_er32.yaml",
            "measurements/spindle_bt40_er32.uff",
            ("measurements/spindle_bt40_er32.truth.json", "bt40_er32.yaml"),
        ),
        Example(
            "hammer-test",
            "one mode of a structure, measured with an impact hammer (pyFRF's example)",
            "hammer_test.yaml",
            "measurements/hammer_test.uff",
            ("measurements/hammer_test.LICENSE.txt",),
        ),
        Example(
            "oscillator",
            "one mode, measured (Engineering Vibration Toolbox)",
            "oscillator.yaml",
            "measurements/oscillator_case1.uff",
            ("measurements/oscillator_case1.LICENSE.txt",),
        ),
        Example(
            "series",
            "five tests of a clamped rod at different torques; synthetic FRFs",
            "series/torques.yaml",
            "series/torque_60.csv",
            ("series/*",),
        ),
        Example(
            "campaign",
            "tools and holders at several torques, synthetic, for validation",
            "campaign/h0_t0.yaml",
            "campaign/measurements/h0_j60_t0.uff",
            _CAMPAIGN,
        ),
    )
}
"""By name."""


def names() -> tuple[str, ...]:
    """Return the names of the examples."""
    return tuple(EXAMPLES)


def path(name: str) -> Path:
    """Return the file of an example's description, for `dovetail.load` or, of the series, `dovetail.read_series`.

    Raises
    ------
    ParameterError
        There is no such example.
    """
    return _folder() / _find(name).description


def measurement_path(name: str) -> Path:
    """Return the file of an example's measured FRF.

    Raises
    ------
    ParameterError
        There is no such example, or it has no measurement.
    """
    example = _find(name)
    if not example.measurement:
        problem = f"the example '{name}' has no measurement."
        remedy = "Simulate one: dovetail.noisy_frf(assembly.simulate(...), 0.01)."
        raise ParameterError(Fault("example", problem, remedy=remedy))
    return _folder() / example.measurement


def load(name: str) -> Assembly:
    """Return the assembly of an example; of a series, that of its tests.

    Raises
    ------
    ParameterError
        There is no such example.
    """
    file = path(name)
    return load_description(file.with_name("clamped_rod.yaml") if name == "series" else file)


def measurement(name: str) -> Frf:
    """Return the measured FRF of an example.

    Raises
    ------
    ParameterError
        There is no such example, or it has no measurement.
    """
    return read_frf(measurement_path(name))


def copy(name: str, folder: str | Path = "assemblies") -> tuple[Path, ...]:
    """Copy the files of an example, or of all of them, into a folder.

    Parameters
    ----------
    name : str
        Of the example; ``"all"`` for everything.
    folder : path
        Created if necessary. Files that are there already and are the same stay.

    Returns
    -------
    tuple of Path
        The files, the description first.

    Raises
    ------
    ParameterError
        There is no such example.
    DovetailError
        Another file of the same name is there; then nothing is copied.
    """
    target, source = Path(folder), _folder()
    pairs = [(file, target / file.relative_to(source)) for file in _files(name)]
    if target.exists() and not target.is_dir():
        raise DovetailError(Fault(str(target), "this is a file, not a folder.", remedy="Choose another folder."))
    for file, place in pairs:
        if place.exists() and not (place.is_file() and place.read_bytes() == file.read_bytes()):
            problem = "another file or folder of this name is here already."
            raise DovetailError(Fault(str(place), problem, remedy="Choose another folder, or remove it."))
    for file, place in pairs:
        place.parent.mkdir(parents=True, exist_ok=True)
        write_whole(place, file.read_bytes(), overwrite=True)
    return tuple(place for _, place in pairs)


def _files(name: str) -> list[Path]:
    source = _folder()
    if name == "all":
        every = [file for file in sorted(source.rglob("*")) if file.is_file() and file.suffix != ".pyc"]
        return sorted(every, key=lambda file: file.name != "sdof.yaml")
    example = _find(name)
    patterns = [pattern for pattern in (example.description, example.measurement, *example.further) if pattern]
    return list(dict.fromkeys(f for pattern in patterns for f in sorted(source.glob(pattern)) if f.is_file()))


def _find(name: str) -> Example:
    if name not in EXAMPLES:
        hint = did_you_mean(name, EXAMPLES)
        raise ParameterError(Fault("example", f"there is no example '{name:.40}'.", listing(EXAMPLES, 20), hint))
    return EXAMPLES[name]


def _folder() -> Path:
    for place in _PLACES:
        if (place / "sdof.yaml").is_file():
            return place
    raise DovetailError(
        Fault("examples", "the files of the examples are not installed.", remedy="Install Dovetail anew.")
    )
