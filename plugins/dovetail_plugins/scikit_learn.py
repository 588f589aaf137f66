"""Estimators of scikit-learn by name, and their state as arrays.

Only scikit-learn's estimators can be named, options are plain values, and a state consists of arrays and plain values.
Therefore neither a description nor a model's folder can run code in this way.
"""

from __future__ import annotations

import difflib
import inspect
import json
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from dovetail import ComponentConfig, ComponentState, DovetailError, Fault
from dovetail_plugins.arrays import checked_rows, state_number

Plain = bool | int | float | str | None | list[bool | int | float | str | None]
"""Types of options."""

_OF_THE_DESCRIPTION = {"random_state": "the description's seed is used", "memory": "nothing is kept on disk"}
_TRUSTING = frozenset((
    *("SVC", "NuSVC", "OneClassSVM", "KMeans", "MiniBatchKMeans", "BisectingKMeans", "AffinityPropagation"),
    *("MeanShift", "Birch", "NearestCentroid", "NearestNeighbors", "KNeighborsRegressor", "KNeighborsClassifier"),
    *("KNeighborsTransformer", "RadiusNeighborsRegressor", "RadiusNeighborsClassifier", "RadiusNeighborsTransformer"),
    *("LocalOutlierFactor", "Isomap", "LocallyLinearEmbedding"),
))  # fmt: skip
"""Estimators whose native code reads outside of its arrays, or divides by zero, if the state was manipulated."""
_LIBSVM = ("SVR", "NuSVR")
"""Such estimators whose states can be checked."""
_NESTED = ("feature_extraction.image", "feature_extraction.text")
"""Public modules of scikit-learn with estimators that the module above does not export."""
_TRIAL = (48, 64)
"""Rows and columns of the random numbers to which an estimator is fitted, to see if it can be stored."""
_WORKING = "Those that work are listed in the documentation, on the page 'Estimators of scikit-learn'."
_LOST = object()
_STRUCTURE = "structure"


@cache
def _exported() -> dict[str, type]:
    """Return the estimators of scikit-learn by name: those of `all_estimators`, which imports torch on its way."""
    import sklearn
    from sklearn.base import BaseEstimator

    names = {*sklearn.__all__, *_NESTED}
    modules = [import_module(f"sklearn.{name}") for name in names if find_spec(f"sklearn.{name}") is not None]
    classes = {name: entry for module in modules for name, entry in inspect.getmembers(module, inspect.isclass)}
    return {
        name: entry
        for name, entry in classes.items()
        if issubclass(entry, BaseEstimator) and entry is not BaseEstimator and not inspect.isabstract(entry)
        if not name.startswith("_") and name not in _TRUSTING
    }


class EstimatorConfig(ComponentConfig):
    """An estimator of scikit-learn: the name of its class, and the options of its constructor."""

    method: ClassVar[Literal["predict", "transform"]]
    """Method that the estimator must have; one that predicts must also be a regressor."""

    estimator: str
    options: dict[str, Plain] = Field(default={}, description="Plain values for its constructor.")

    @model_validator(mode="after")
    def _can_be_made_and_kept(self) -> Self:
        self.new_estimator()
        objection = objection_to(self.estimator, self.method, json.dumps(self.options, sort_keys=True))
        if objection:
            raise ValueError(objection)
        return self

    def new_estimator(self, seed: int | None = None) -> Any:
        """Return the estimator before fitting.

        Raises
        ------
        ValueError
            There is no such estimator, or it does not take these options.
        """
        return _new_estimator(_estimator_class(self.estimator, self.method), self.options, seed)


@cache
def objection_to(name: str, method: Literal["predict", "transform"], options: str = "{}") -> str:
    """Return why what an estimator fits cannot be stored, from a trial on random numbers; empty if it can.

    An estimator that cannot be fitted to them, as one with more components than they have columns, is not judged.

    Parameters
    ----------
    name : str
    method : {"predict", "transform"}
    options : str
        JSON.
    """
    estimator = _new_estimator(_estimator_class(name, method), json.loads(options), 0)
    try:
        _try(estimator, method)
    except UnkeptError as error:
        return f"{name} cannot be used: {error.faults[0].problem} {_WORKING}"
    except DovetailError:
        return ""
    return ""


def _try(estimator: Any, method: Literal["predict", "transform"]) -> None:
    """Fit an estimator to random numbers, and store it.

    Raises
    ------
    UnkeptError
        It cannot be stored.
    DovetailError
        It cannot be fitted to these numbers.
    """
    random = np.random.default_rng(0)
    rows, targets = random.random(_TRIAL), random.random((_TRIAL[0], 2))
    one = method == "predict" and not estimator.__sklearn_tags__().target_tags.multi_output
    wanted = () if method == "transform" else (targets[:, 0] if one else targets,)
    KeptEstimator.fitted(estimator, rows, *wanted, method=method, owner=type(estimator).__name__)


def working_estimators(method: Literal["predict", "transform"]) -> tuple[str, ...]:
    """Return the estimators of the installed scikit-learn that can be fitted with default options, and stored."""
    names = []
    for name in sorted(_exported()):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                _try(_new_estimator(_estimator_class(name, method), {}, 0), method)
        except (ValueError, DovetailError):
            continue
        names.append(name)
    return tuple(names)


def _estimator_class(name: str, method: str) -> Any:
    """Return an estimator class of scikit-learn with a method."""
    from sklearn.base import RegressorMixin

    fitting = {word: entry for word, entry in _exported().items() if _has_method(entry, method)}
    if name in fitting:
        if method == "predict" and not issubclass(fitting[name], RegressorMixin):
            raise ValueError(f"scikit-learn's {name} is not a regressor")
        return fitting[name]
    if name in _exported():
        raise ValueError(f"scikit-learn's {name} has no method '{method}' for new FRFs")
    if name in _TRUSTING:
        raise ValueError(f"{name} is refused: its native code trusts a stored model, whoever changed it")
    raise ValueError(f"scikit-learn has no '{name}'{_nearest(name, fitting)}")


def _new_estimator(model: Any, options: Mapping[str, Any], seed: int | None) -> Any:
    accepted = [name for name in inspect.signature(model).parameters if name not in _OF_THE_DESCRIPTION]
    for name in options:
        if name in _OF_THE_DESCRIPTION:
            raise ValueError(f"'{name}' cannot be chosen: {_OF_THE_DESCRIPTION[name]}")
        if name not in accepted:
            hint = _nearest(name, accepted)
            raise ValueError(f"'{name}' is not an option of {model.__name__}{hint}; it has {', '.join(accepted)}")
    seeded = {"random_state": seed} if "random_state" in inspect.signature(model).parameters else {}
    try:
        estimator = model(**{name: _tuple(value) for name, value in options.items()}, **seeded)
    except TypeError as error:
        raise ValueError(f"{model.__name__} cannot be made of plain values: {error}") from None
    if hasattr(estimator, "_parameter_constraints"):
        estimator._validate_params()
    return estimator


class UnkeptError(DovetailError):
    """What an estimator fitted cannot be stored as arrays and plain values."""


class KeptEstimator:
    """A fitted estimator, which is always rebuilt from its state, even directly after fitting.

    Parameters
    ----------
    state : mapping
        Arrays and plain values, as `fitted` returns them.
    owner : str
        Name in messages.

    Raises
    ------
    DovetailError
        The state is invalid, or names a class that scikit-learn does not export.
    """

    def __init__(self, state: ComponentState, owner: str) -> None:
        self._state = dict(state)
        self._owner = owner
        self._width = int(state_number(state, "width", owner))
        try:
            tree = json.loads(str(state[_STRUCTURE]))
            if not isinstance(tree, dict) or "estimator" not in tree:
                raise ValueError("it is not an estimator")
            self._estimator = _decode(tree, state)
        except (KeyError, TypeError, ValueError, RecursionError) as error:
            problem = f"its state cannot be read: {type(error).__name__}: {error}."
            raise DovetailError(Fault(owner, problem)) from None

    @classmethod
    def fitted(
        cls, estimator: Any, rows: NDArray[Any], *targets: NDArray[Any], method: str, owner: str
    ) -> KeptEstimator:
        """Fit an estimator, in double precision, and store its state.

        Raises
        ------
        DovetailError
            It cannot be fitted to these samples, or gives other results after rebuilding it from its state.
        """
        samples = rows.astype(np.float64)
        try:
            with _own_random_numbers(), _in_this_process(), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                estimator.fit(samples, *targets)
                expected = _rows(getattr(estimator, method)(samples[:2]), 2)
        except Exception as error:  # an estimator may raise anything on samples that it is not made for
            raise DovetailError(Fault(owner, f"it cannot be fitted: {str(error).rstrip('.')}.")) from None
        arrays: dict[str, Any] = {}
        lost: list[str] = []
        tree = _encode(estimator, arrays, lost, type(estimator).__name__)
        try:
            kept = cls({_STRUCTURE: json.dumps(tree), "width": rows.shape[1], **arrays}, owner)
            is_same = np.allclose(kept.answer(rows[:2], method), expected, rtol=1e-4, atol=1e-6)
        except Exception:  # an estimator without some of its attributes may raise anything
            is_same = False
        if not is_same:
            raise _not_arrays(owner, lost)
        return kept

    def answer(self, features: NDArray[Any], method: str) -> NDArray[np.float64]:
        """Return the result of a method for features (n_samples, n_features), with a row for each sample."""
        rows = checked_rows(features, self._owner, width=self._width).astype(np.float64)
        with _in_this_process():
            return _rows(getattr(self._estimator, method)(rows), len(rows))

    def state(self) -> ComponentState:
        """Return arrays and plain values."""
        return {name: value.copy() if isinstance(value, np.ndarray) else value for name, value in self._state.items()}


def _in_this_process() -> Any:
    """Return a context in which `n_jobs` starts no processes, which would import from the current folder."""
    from joblib import parallel_config

    return parallel_config("sequential")


@contextmanager
def _own_random_numbers() -> Iterator[None]:
    """Seed NumPy's global generator, from which some estimators draw, and restore its state afterwards."""
    before = np.random.get_state()  # noqa: NPY002
    np.random.seed(0)  # noqa: NPY002
    try:
        yield
    finally:
        np.random.set_state(before)  # noqa: NPY002


def _not_arrays(owner: str, lost: list[str]) -> UnkeptError:
    listed = ", ".join(lost[:2]) + (f" and {len(lost) - 2} more" if len(lost) > 2 else "")
    what = (
        f"what it fitted is not made of arrays alone ({listed})" if lost else "made of its arrays it answers otherwise"
    )
    problem = f"{what}, so that no model could be stored without pickle."
    return UnkeptError(Fault(owner, problem, remedy="Choose another estimator."))


def _rows(answer: Any, count: int) -> NDArray[np.float64]:
    dense = answer.toarray() if hasattr(answer, "toarray") else answer
    return np.asarray(dense, dtype=np.float64).reshape(count, -1)


def _has_method(entry: type, method: str) -> bool:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return inspect.isfunction(inspect.getattr_static(entry, method, None))


def _nearest(name: str, accepted: Any) -> str:
    near = difflib.get_close_matches(name, list(accepted), 1, 0.4)
    return f" (did you mean '{near[0]}'?)" if near else ""


def _tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, (list, tuple)) else value


def _encode(value: Any, arrays: dict[str, Any], lost: list[str], place: str) -> Any:
    """Return a value in a form for JSON, with its arrays moved to `arrays`; `_LOST` if that is impossible."""
    if isinstance(value, (np.ndarray, np.generic)) and value.dtype.kind in "biuf":
        key = f"array{len(arrays)}"
        arrays[key] = np.array(value)
        return {"array" if isinstance(value, np.ndarray) else "scalar": key}
    if value is None or type(value) in (bool, int, str):
        return value
    if type(value) is float:
        return {"float": repr(value)}
    if isinstance(value, type) and issubclass(value, np.generic):
        return {"dtype": np.dtype(value).name}
    if isinstance(value, (list, tuple)):
        entries = [_encode(entry, arrays, lost, f"{place}[{i}]") for i, entry in enumerate(value)]
        return _LOST if _LOST in entries else {type(value).__name__: entries} if type(value) in (list, tuple) else _LOST
    if isinstance(value, dict) and all(isinstance(key, str) for key in value):
        return {"dict": dict(_encode_items(value, arrays, lost, place))}
    if _exported().get(type(value).__name__) is type(value):
        return {"estimator": type(value).__name__, "with": dict(_encode_items(vars(value), arrays, lost, place))}
    lost.append(f"{place}: {type(value).__name__}")
    return _LOST


def _encode_items(
    items: Mapping[str, Any], arrays: dict[str, Any], lost: list[str], place: str
) -> Iterator[tuple[str, Any]]:
    for name, entry in items.items():
        value = _encode(entry, arrays, lost, f"{place}.{name}")
        if value is not _LOST:
            yield name, value


def _decode(node: Any, arrays: Mapping[str, Any]) -> Any:
    if not isinstance(node, dict):
        return node
    if "estimator" in node:
        model: Any = _exported()[node["estimator"]]
        estimator = model.__new__(model)
        vars(estimator).update({name: _decode(entry, arrays) for name, entry in node["with"].items()})
        if node["estimator"] in _LIBSVM and "support_vectors_" in vars(estimator):
            _check_libsvm(estimator)
        return estimator
    ((kind, held),) = node.items()
    if kind in ("array", "scalar"):
        value = np.array(arrays[held])
        return value if kind == "array" else value[()]
    if kind in ("list", "tuple"):
        entries = [_decode(entry, arrays) for entry in held]
        return entries if kind == "list" else tuple(entries)
    if kind == "dict":
        return {name: _decode(entry, arrays) for name, entry in held.items()}
    return float(held) if kind == "float" else np.dtype(held).type


def _check_libsvm(estimator: Any) -> None:
    """Raise a ValueError for a state that fitting cannot produce, since libsvm trusts the sizes given in it."""
    with _own_random_numbers():  # libsvm draws one, whatever it is for
        held, fitted = vars(estimator), vars(type(estimator)().fit([[0.0], [1.0]], [0.0, 1.0]))
    count, width = held["support_vectors_"].shape
    shapes = dict.fromkeys(("dual_coef_", "_dual_coef_"), (1, count)) | {"support_vectors_": (count, width)}
    shapes |= {"support_": (count,), "_n_support": (2,), "_probA": (0,), "_probB": (0,), "_intercept_": (1,)}
    samples, columns = held["shape_fit_"]
    sound = (
        *(set(held) == set(fitted), held["_sparse"] is False, columns == width),
        all(held[name].shape == shape and held[name].dtype == fitted[name].dtype for name, shape in shapes.items()),
        np.all(held["_n_support"] == count) and np.all((held["support_"] >= 0) & (held["support_"] < samples)),
    )
    if not all(sound):
        raise ValueError(f"its arrays are not those of a fitted {type(estimator).__name__}")
