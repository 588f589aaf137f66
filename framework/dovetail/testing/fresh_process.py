"""The results of a component in a separate process: restored from files, and fitted without earlier fits."""

from __future__ import annotations

import importlib
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import Component, ComponentState
from dovetail.testing.outcomes import Nonconformity
from dovetail.testing.training_sets import TrainingSet, fit

_LIMIT = 300
"""Seconds after which the process is ended; fits of networks take minutes on a slow machine."""
WORK = "work"
"""Working folder of a fresh process, initially empty."""
_REQUEST, _ARRAYS, _SAMPLES = "request.json", "state.safetensors", "samples.npz"
_START = (
    "import os; from dovetail.worker_processes import end_with_parent; end_with_parent(os.getppid()); "
    "from {} import main; main()"
)
_REMEDY = "Put the class at the top of a module, and compute restore from the state and the Config only."


@dataclass(frozen=True, eq=False)
class FreshAnswers:
    """The results of a fresh process.

    Parameters
    ----------
    answers : mapping of str to array
        'restored': output of the object restored from the state; 'fitted': of the one fitted in that process.
    failures : mapping of str to str
        Reasons for missing results.
    files : tuple of str
        Files in the working folder afterwards, which was empty before.
    """

    answers: Mapping[str, NDArray[Any]]
    failures: Mapping[str, str]
    files: tuple[str, ...]

    def get(self, name: str) -> NDArray[Any]:
        """Return a result.

        Raises
        ------
        Nonconformity
            It is missing.
        """
        if name in self.failures:
            raise Nonconformity(f"it cannot be {name} in a fresh process: {self.failures[name]}", _REMEDY)
        return self.answers[name]


def ask_a_fresh_process(component: Component, state: ComponentState, samples: TrainingSet, seed: int) -> FreshAnswers:
    """Store a state as in a model's folder, and restore and fit in a fresh process with another hash seed.

    Parameters
    ----------
    component : Component
        A reducer or a regressor.
    state : mapping
        Of a fitted object; it is restored and evaluated for the features of `samples`.
    samples : TrainingSet
        To which the fresh process also fits a new component.
    seed : int
    """
    from safetensors.numpy import save_file

    arrays = {name: np.asarray(value, order="C") for name, value in state.items() if isinstance(value, np.ndarray)}
    request = {
        "config": component.config.model_dump(mode="json", by_alias=True),
        "values": {name: value for name, value in state.items() if name not in arrays},
        "seed": seed,
    }
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        save_file(arrays, folder / _ARRAYS)
        np.savez(folder / _SAMPLES, features=samples.features, targets=samples.targets)
        if reason := run_in_fresh_process(__name__, type(component), request, folder, os.environ, _LIMIT):
            return FreshAnswers({}, dict.fromkeys(("restored", "fitted"), reason), ())
        answers = {file.stem: np.load(file, allow_pickle=False) for file in folder.glob("*.npy")}
        failures = {file.stem: file.read_text(encoding="utf-8") for file in folder.glob("*.txt")}
        return FreshAnswers(answers, failures, tuple(sorted(entry.name for entry in (folder / WORK).iterdir())))


def run_in_fresh_process(
    entry: str,
    model: type[Component],
    request: Mapping[str, Any],
    folder: Path,
    environment: Mapping[str, str],
    limit: float,
) -> str:
    """Run the function `main` of a module in a fresh process, with another hash seed and in an empty folder.

    Parameters
    ----------
    entry : str
        The module; its `main` reads the request with `read_request`.
    model : component class
    request : mapping
        Plain values.
    folder : Path
        For the request and the results; the process works in its empty folder `WORK`.
    environment : mapping of str to str
    limit : float
        Seconds.

    Returns
    -------
    str
        The reason if it failed, else an empty text.
    """
    module = sys.modules[model.__module__]
    path = [str(Path(place or os.curdir).resolve()) for place in sys.path]
    component_class = {
        "module": module.__name__,
        "file": str(getattr(module, "__file__", "")),
        "name": model.__qualname__,
    }
    (folder / _REQUEST).write_text(json.dumps({**component_class, **request}), encoding="utf-8")
    (folder / WORK).mkdir()
    salt = "1" if os.environ.get("PYTHONHASHSEED") != "1" else "2"
    done = subprocess.run(
        [sys.executable, "-c", _START.format(entry), str(folder)],
        capture_output=True,
        text=True,
        env={**environment, "PYTHONPATH": os.pathsep.join(path), "PYTHONHASHSEED": salt},
        cwd=folder / WORK,
        timeout=limit,
        check=False,
    )
    return (done.stderr.strip().splitlines() or ["it gave no reason"])[-1] if done.returncode else ""


def read_request() -> tuple[Path, dict[str, Any]]:
    """Return the folder given on the command line, and the request in it."""
    folder = Path(sys.argv[1])
    return folder, json.loads((folder / _REQUEST).read_text(encoding="utf-8"))


def requested_class(request: Mapping[str, Any]) -> Any:
    """Import the component class named in a request."""
    model: Any = _load_module(request["module"], request["file"])
    for part in request["name"].split("."):
        model = getattr(model, part)
    return model


def main() -> None:
    """Process the request in the folder given on the command line; unpickling while restoring is refused."""
    from safetensors.numpy import load_file

    folder, request = read_request()
    model = requested_class(request)
    component = model(model.Config.model_validate(request["config"]))
    with np.load(folder / _SAMPLES, allow_pickle=False) as stored:
        samples = TrainingSet(stored["features"], stored["targets"])
    state = {**load_file(folder / _ARRAYS), **request["values"]}
    refusing = [True]
    sys.addaudithook(lambda event, arguments: _refuse_pickles(event, arguments) if refusing else None)
    _note(folder / "restored", lambda: _answer(component, component.restore(state), samples.copy()))
    refusing.clear()
    fresh = model(component.config)
    _note(folder / "fitted", lambda: _answer(fresh, fit(fresh, samples.copy(), request["seed"]), samples))


def _answer(component: Any, fitted: Any, samples: TrainingSet) -> Any:
    return fitted.transform(samples.features) if component.kind == "reducer" else fitted.predict(samples.features)


def _note(file: Path, call: Callable[[], Any]) -> None:
    """Write the result of a call, or its error."""
    try:
        np.save(file.with_suffix(".npy"), call())
    except Exception as error:  # a plugin may raise anything
        file.with_suffix(".txt").write_text(f"{type(error).__name__}: {error}", encoding="utf-8")


def _load_module(name: str, file: str) -> Any:
    """Import the component's module by its name or, for a plugin file, from the file."""
    if name != "__main__" and importlib.util.find_spec(name.partition(".")[0]) is not None:
        return importlib.import_module(name)
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None:
        raise ImportError(f"there is no module '{name}' in '{file}'")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def _refuse_pickles(event: str, arguments: tuple[Any, ...]) -> None:
    if event == "pickle.find_class":
        raise RuntimeError(f"it unpickles {'.'.join(map(str, arguments[:2]))}")
