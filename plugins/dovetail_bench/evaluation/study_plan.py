"""What a study tries: the description, sweeps, the best of each together, a search, and at the end the test."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias

from dovetail import Assembly, DescriptionError, DovetailError, Fault, Progress, silent
from dovetail.evaluation import Registry, SearchRange, Storage, needs_phase, read_description

Kind: TypeAlias = Literal["described", "sweep", "together", "search", "test"]
State: TypeAlias = Literal["waiting", "running", "done", "pruned", "failed"]


@dataclass(frozen=True)
class StudyTrial:
    """The settings of a trial, its state, and its result.

    Parameters
    ----------
    number : int
        From 0.
    kind : {"described", "sweep", "together", "search", "test"}
        The settings of the description, one option changed, the best value of each sweep, a search's proposal, or the
        best settings evaluated on the test part.
    changes : dict of str to Any
        Options that differ from the description, by their places in `identification`.
    state : {"waiting", "running", "done", "pruned", "failed"}
        Waiting are those that no process has begun, or whose process was interrupted or killed.
    first : float or None
        Validation error of a search's proposal on the first part of the samples, by which it is pruned.
    answer : dict or None
        Errors, times and sizes.
    reason : str
        Why it failed.
    attempts : int
        How often it was begun.
    """

    number: int
    kind: Kind
    changes: dict[str, Any]
    state: State = "waiting"
    first: float | None = None
    answer: dict[str, Any] | None = None
    reason: str = ""
    attempts: int = 0

    @property
    def ended(self) -> bool:
        """Whether no process needs to work on it any more."""
        return self.state in ("done", "pruned", "failed")


@dataclass(frozen=True)
class Sweep:
    """The trials in which one option takes several values, with all others as described.

    Parameters
    ----------
    option : str
        Its place in `identification`.
    values : tuple
    trials : tuple of int
        Numbers of the trials.
    """

    option: str
    values: tuple[Any, ...]
    trials: tuple[int, ...]


class StudyPlan:
    """The trials of a study: those that its description names, and those that follow from the results so far.

    Parameters
    ----------
    assembly : Assembly
        With a study in its description.
    registry : Registry
    progress : callable
        Called for each value that is checked.

    Attributes
    ----------
    section : StudySection
    first : list of StudyTrial
        The trials known from the start.
    sweeps : list of Sweep
    described : dict of str to Any
        The description's value of each option that is varied.

    Raises
    ------
    DescriptionError
        There is no study, or an option cannot have one of the values to be tried.
    """

    def __init__(self, assembly: Assembly, registry: Registry, progress: Progress = silent) -> None:
        section = assembly.description.study
        if section is None:
            remedy = "Add, for example: study: {sweeps: {reducer.n_components: [10, 30, 100]}}"
            problem = "the description has no study."
            raise DescriptionError(Fault(f"{assembly.description.source}  study", problem, remedy=remedy))
        self.assembly, self.section, self._registry = assembly, section, registry
        self.settings = assembly.description.identification
        self._plain = json.loads(assembly.description.text)
        varied = [*section.sweeps, *(section.search.options if section.search else ())]
        self.described = {option: _value_at(self.settings, option) for option in varied}
        search = {} if section.search is None else section.search.options
        self._values = sum(map(len, section.sweeps.values())) + sum(len(_ends(tried)) for tried in search.values())
        self._seen, self._needs_phase, self._progress = 0, needs_phase(assembly), progress
        self.first, self.sweeps = self._planned()
        self._check_search()

    def about(self) -> dict[str, Any]:
        """Return plain values that identify this study."""
        settings = self.settings
        return {
            "fingerprint": self.assembly.description.fingerprint,
            "study": self._plain["study"],
            "settings": [_key(self.assembly), settings.samples, settings.seed, settings.test_fraction],
        }

    def _planned(self) -> tuple[list[StudyTrial], list[Sweep]]:
        """Return the trials known from the start, each setting once, and the sweeps over them.

        Raises
        ------
        DescriptionError
            Names all values that their options cannot have.
        """
        first, numbers = [StudyTrial(0, "described", {})], {_key(self.assembly): 0}
        sweeps, faults = [], list[Fault]()
        for option, values in self.section.sweeps.items():
            trials = []
            for index, value in enumerate(values):
                try:
                    key = _key(self._examined_variant({option: value}))
                except DescriptionError as error:
                    place = f"{self.assembly.description.source}  study.sweeps.{option}[{index}]"
                    faults += [replace(fault, where=place) for fault in error.faults]
                    continue
                if key not in numbers:
                    numbers[key] = len(first)
                    first.append(StudyTrial(len(first), "sweep", {option: value}))
                trials.append(numbers[key])
            sweeps.append(Sweep(option, values, tuple(trials)))
        if faults:
            raise DescriptionError(*faults)
        return first, sweeps

    def _check_search(self) -> None:
        """Raise a DescriptionError that names all options of the search that cannot have one of their values."""
        faults = list[Fault]()
        for option, tried in (self.section.search.options if self.section.search else {}).items():
            for value in _ends(tried):
                try:
                    self._examined_variant({option: value})
                except DescriptionError as error:
                    place = f"{self.assembly.description.source}  study.search.options.{option}"
                    faults += [replace(fault, where=place) for fault in error.faults]
        if faults:
            raise DescriptionError(*faults)

    def _examined_variant(self, changes: Mapping[str, Any]) -> Assembly:
        self._progress("settings", self._seen, self._values)
        self._seen += 1
        variant = self.variant(changes)
        self._needs_phase = self._needs_phase or needs_phase(variant)
        return variant

    def variant(self, changes: Mapping[str, Any]) -> Assembly:
        """Return the assembly with other settings, and with the validation part instead of the test part."""
        description = read_description({**self._plain, "identification": self.identification(changes)}, self._registry)
        identification = replace(description.identification, test_fraction=self.section.validation_fraction)
        varied = replace(self.assembly.description, text=description.text, identification=identification)
        return self.assembly.with_description(varied)

    def identification(self, changes: Mapping[str, Any]) -> dict[str, Any]:
        """Return the section `identification` with changes, those of whole sections before those of their options."""
        section = dict(self._plain["identification"])
        for place in sorted(changes, key=lambda place: place.count(".")):
            section = _changed(section, place.split("."), changes[place])
        return section

    def complete_sections(self, changes: Mapping[str, Any]) -> dict[str, Any]:
        """Return the changed sections as a description that extends this one needs them.

        A section that was replaced as a whole lists all its options, so that none is inherited. A reducer is written
        with the augmentation, since a description that names a reducer has none by default.
        """
        sections, settings = self.identification(changes), self.variant(changes).description.identification
        if "augmentation" in changes and settings.augmentation is not None:
            sections["augmentation"] = settings.augmentation.model_dump(mode="json")
        for name in ("reducer", "regressor"):
            if name in changes:
                options = getattr(settings, name).config.model_dump(mode="json", by_alias=True)
                sections[name] = {"model": sections[name]["model"], **options}
        names = dict.fromkeys(place.partition(".")[0] for place in changes)
        if "reducer" in names and settings.augmentation is not None:
            names["augmentation"] = None
        return {name: sections[name] for name in names}

    def propose(self, trials: Sequence[StudyTrial]) -> StudyTrial | None:
        """Return the next trial: a planned one, the best value of each sweep together, a search's, or the test.

        The settings of a search's trial are drawn when it begins.
        """
        number = len(trials)
        if number < len(self.first):
            return self.first[number]
        planned_ended = all(trial.ended for trial in trials[: len(self.first)])
        if planned_ended and not any(trial.kind == "together" for trial in trials):
            changes = self._best_of_sweeps(trials)
            if changes is not None:
                return StudyTrial(number, "together", changes)
        search = self.section.search
        proposed = sum(trial.kind == "search" for trial in trials)
        if planned_ended and search is not None and proposed < search.trials:
            return StudyTrial(number, "search", {})
        if not all(trial.ended for trial in trials) or any(trial.kind == "test" for trial in trials):
            return None
        return StudyTrial(number, "test", self.best(trials).changes)

    def _best_of_sweeps(self, trials: Sequence[StudyTrial]) -> dict[str, Any] | None:
        """Return the best value of each sweep, or None if these settings have been tried already."""
        changes: dict[str, Any] = {}
        for sweep in self.sweeps:
            done = [trials[number] for number in sweep.trials if trials[number].state == "done"]
            if done:
                changes |= min(done, key=_error).changes
        tried = [trial.changes for trial in trials]
        return None if changes in tried else changes

    def best(self, trials: Iterable[StudyTrial]) -> StudyTrial:
        """Return the trial with the least validation error.

        Raises
        ------
        DovetailError
            None succeeded.
        """
        ended = [trial for trial in trials if trial.kind != "test"]
        done = [trial for trial in ended if trial.state == "done"]
        if not done:
            reason = next((trial.reason for trial in ended if trial.reason), "")
            raise DovetailError(Fault(self.assembly.name, f"none of {len(ended)} trials succeeded. {reason}".strip()))
        return min(done, key=_error)

    @property
    def test_samples(self) -> int:
        """Samples of the test part, a dataset of its own."""
        return round(self.settings.test_fraction * self.settings.samples)

    @property
    def storage(self) -> Storage:
        """What is stored of each FRF: with its phase where a setting needs it."""
        return "complex" if self._needs_phase else "amplitude"


def _ends(tried: SearchRange | tuple[Any, ...]) -> tuple[Any, ...]:
    """Return the choices of an option, or the ends of its range."""
    return tried if isinstance(tried, tuple) else tried.range


def _key(assembly: Assembly) -> str:
    """Return a text that is equal for equal settings, whether they are given or defaults."""
    settings = assembly.description.identification
    further = () if settings.correction is None else (settings.correction,)
    components = [(type(one), one.config.model_dump()) for one in (settings.reducer, settings.regressor)]
    return repr((components, settings.augmentation, *further))


def _value_at(settings: Any, place: str) -> Any:
    """Return the value of an option, with its default; None where it has none."""
    value = settings
    for step in place.split("."):
        value = getattr(value, "config", value)
        aliases = {field.alias: name for name, field in getattr(type(value), "model_fields", {}).items()}
        step = aliases.get(step, step)
        value = value.get(step) if isinstance(value, Mapping) else getattr(value, step, None)
    return list(value) if isinstance(value, tuple) else value


def _changed(section: Any, steps: Sequence[str], value: Any) -> Any:
    step, *others = steps
    if isinstance(section, list):
        changed = list(section)
        changed[int(step)] = _changed(changed[int(step)], others, value) if others else value
        return changed
    known = {} if section is None else section
    return {**known, step: _changed(known.get(step), others, value) if others else value}


def _error(trial: StudyTrial) -> float:
    assert trial.answer is not None
    return float(trial.answer["mae"])
