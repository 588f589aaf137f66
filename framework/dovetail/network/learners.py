"""Another reducer or regressor than the description's: by name, as an object, or an estimator of scikit-learn."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any, Literal, TypeAlias

from dovetail.assembly import Assembly
from dovetail.documents.validation import validated
from dovetail.errors import Fault, ParameterError
from dovetail.interfaces import Reducer, Regressor
from dovetail.registry import installed_components

Learner: TypeAlias = str | Mapping[str, Any] | Reducer | Regressor | object | None
"""A name, a section of a description, a component, an estimator of scikit-learn; or None for the description's own."""

_CONTRACTS: dict[Literal["reducer", "regressor"], type[Reducer] | type[Regressor]] = {
    "reducer": Reducer,
    "regressor": Regressor,
}


def with_learners(assembly: Assembly, reducer: Learner, regressor: Learner) -> Assembly:
    """Return the assembly with another reducer or regressor, all other settings as they are described.

    Parameters
    ----------
    assembly : Assembly
    reducer, regressor : Learner

    Returns
    -------
    Assembly

    Raises
    ------
    ParameterError
        It is none of the forms of a `Learner`, or its options are wrong.
    PluginError
        There is no component of this name.
    """
    section: dict[str, Any] = {}
    components: dict[str, Reducer | Regressor] = {}
    given: dict[Literal["reducer", "regressor"], Learner] = {"reducer": reducer, "regressor": regressor}
    for kind, learner in given.items():
        if learner is not None:
            components[kind], section[kind] = _made(kind, learner)
    if not components:
        return assembly
    return assembly.with_description(assembly.description.with_identification(section, **components))


def _made(kind: Literal["reducer", "regressor"], learner: object) -> tuple[Reducer | Regressor, dict[str, Any]]:
    """Return a component, and its section of a description."""
    contract = _CONTRACTS[kind]
    if isinstance(learner, contract):
        return learner, {"model": learner.name, **learner.config.model_dump(mode="json", exclude_unset=True)}
    if isinstance(learner, str):
        learner = {"model": learner}
    elif type(learner).__module__.startswith("sklearn.") and hasattr(learner, "get_params"):
        learner = _section_of_estimator(learner)
    if not isinstance(learner, Mapping) or "model" not in learner:
        accepted = f"a name, a dovetail.{contract.__name__}, an estimator of scikit-learn, or {{'model': ...}}"
        raise ParameterError(Fault(kind, f"{learner!r:.60} is not a {kind}.", accepted))
    offer = installed_components().find(kind, learner["model"])
    options = {name: value for name, value in learner.items() if name != "model"}
    config = validated(offer.component.Config, options, f"the {kind} '{learner['model']}'")
    component = offer.component(config)
    assert isinstance(component, contract)
    return component, {"model": learner["model"], **options}


def _section_of_estimator(estimator: Any) -> dict[str, Any]:
    """Return the section of a description that makes the same estimator of scikit-learn, before it is fitted."""
    defaults = {name: entry.default for name, entry in inspect.signature(type(estimator)).parameters.items()}
    given = {name: value for name, value in estimator.get_params(deep=False).items() if value is not defaults[name]}
    options = {name: value for name, value in given.items() if not _equal(value, defaults[name])}
    package = type(estimator).__module__.partition(".")[0]  # the model of such estimators has the name of their package
    return {"model": package, "estimator": type(estimator).__name__, "options": options}


def _equal(value: object, other: object) -> bool:
    return type(value) is type(other) and bool(value == other)
