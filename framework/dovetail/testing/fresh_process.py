"""What a fitted component answers in a process of its own, from files alone."""

from __future__ import annotations

import importlib
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.testing.outcomes import Nonconformity
from dovetail.testing.specimens import ReducerSpecimen, RegressorSpecimen

__all__ = ["answer_of_a_fresh_process", "main"]

_LIMIT = 300
_REQUEST, _ARRAYS, _FEATURES, _ANSWER = "request.json", "state.safetensors", "features.npy", "answer.npy"


def answer_of_a_fresh_process(
    specimen: ReducerSpecimen | RegressorSpecimen, features: NDArray[np.float32]
) -> NDArray[Any]:
    """Store what was fitted as a model's folder does, and ask a fresh process what it answers to features.

    Raises
    ------
    Nonconformity
        The process cannot make the component, unpickles something, or fails otherwise.
    """
    from safetensors.numpy import save_file

    state = specimen.fitted.state()
    arrays = {name: np.asarray(value, order="C") for name, value in state.items() if isinstance(value, np.ndarray)}
    module = sys.modules[specimen.model.__module__]
    request = {
        "module": module.__name__,
        "file": str(getattr(module, "__file__", "")),
        "path": [str(Path(entry or os.curdir).resolve()) for entry in sys.path],
        "name": specimen.model.__qualname__,
        "config": specimen.component.config.model_dump(mode="json"),
        "values": {name: value for name, value in state.items() if name not in arrays},
    }
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / _REQUEST).write_text(json.dumps(request), encoding="utf-8")
        save_file(arrays, folder / _ARRAYS)
        np.save(folder / _FEATURES, features)
        command = [sys.executable, "-c", f"from {__name__} import main; main()", name]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(request["path"])}
        done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=_LIMIT, check=False)
        if done.returncode:
            reason = (done.stderr.strip().splitlines() or ["it gave no reason"])[-1]
            raise Nonconformity(f"in a fresh process it cannot be restored: {reason}", _REMEDY)
        answer: NDArray[Any] = np.load(folder / _ANSWER, allow_pickle=False)
        return answer


_REMEDY = "Put the class at the top of a module, and let restore need nothing but the state and the Config."


def main() -> None:
    """Answer a request in the folder that the command line names; nothing is unpickled."""
    from safetensors.numpy import load_file

    folder = Path(sys.argv[1])
    request = json.loads((folder / _REQUEST).read_text(encoding="utf-8"))
    model: Any = _module(request["module"], request["file"])
    for part in request["name"].split("."):
        model = getattr(model, part)
    component = model(model.Config.model_validate(request["config"]))
    features = np.load(folder / _FEATURES, allow_pickle=False)
    sys.addaudithook(_refuse_pickles)
    fitted = component.restore({**load_file(folder / _ARRAYS), **request["values"]})
    answer = fitted.transform(features) if component.kind == "reducer" else fitted.predict(features)
    np.save(folder / _ANSWER, answer)


def _module(name: str, file: str) -> Any:
    """Import the component's module by its name, or, for a plugin file, from the file."""
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
