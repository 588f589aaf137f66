"""What `import dovetail` offers: one list, the stub; documented, typed, and complete."""

import ast
import builtins
import inspect
import re
import runpy
import typing

import pytest
from house import ROOT

import dovetail
import dovetail_bench

STUB = ROOT / "framework" / "dovetail" / "__init__.pyi"


def stub_names():
    """The names that the stub re-exports, as a type checker reads it."""
    tree = ast.parse(STUB.read_text(encoding="utf-8"))
    return [alias.asname for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names]


def annotated():
    """Yield every public function, and every public method and property of a public class."""
    for name in dovetail.__all__:
        value = getattr(dovetail, name)
        if inspect.isfunction(value):
            yield name, value
        elif inspect.isclass(value):
            yield name, value
            for member, attribute in vars(value).items():
                function = (
                    attribute.fget if isinstance(attribute, property) else getattr(attribute, "__func__", attribute)
                )
                if not member.startswith("_") and inspect.isfunction(function):
                    yield f"{name}.{member}", function


def test_the_stub_is_the_list_each_name_once():
    names = stub_names()
    assert sorted(names) == sorted(set(names)) == sorted(dovetail.__all__)
    assert set(dovetail.__all__) <= set(dir(dovetail))


def test_a_public_name_can_be_had_and_says_what_it_is():
    values = {name: getattr(dovetail, name) for name in dovetail.__all__}
    coded = {name: value for name, value in values.items() if inspect.isclass(value) or inspect.isfunction(value)}
    assert len(coded) > 100
    assert [name for name, value in coded.items() if not value.__doc__] == []


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="identfy"):
        dovetail.identfy  # noqa: B018


def test_type_hints_can_be_read_at_run_time():
    hints = {name: typing.get_type_hints(value) for name, value in annotated()}
    assert len(hints) > 300
    functions = [name for name, value in annotated() if inspect.isfunction(value)]
    assert [name for name in functions if "return" not in hints[name]] == []


def test_the_errors_that_public_docstrings_name_are_public():
    named = {
        line.strip()
        for _, value in annotated()
        for line in (inspect.getdoc(value) or "").partition("Raises\n------\n")[2].partition("\n\n")[0].splitlines()
        if line.strip().endswith("Error") and not line.startswith(" ")
    }
    assert {"MeasurementError", "ParameterError", "BundleError"} <= named
    assert named - set(vars(builtins)) <= set(dovetail.__all__)


def test_the_pages_of_the_api_have_every_public_name():
    made = runpy.run_path(str(ROOT / "docs" / "make_api.py"))["pages"]()
    for name, text in made.items():
        assert (ROOT / "docs" / name).read_text(encoding="utf-8") == text, "run: python docs/make_api.py"
    assert {f"api/{file.name}" for file in (ROOT / "docs" / "api").iterdir()} == set(made) - {"api.md"}
    listed = "".join(made.values()).replace(":: dovetail.", ":: ")  # modules are listed with their package
    for name in dovetail.__all__:
        assert f":: {name}\n" in listed


def test_the_pages_of_the_api_describe_values_and_not_their_types():
    """Autodoc would show the text of `int` below a number, and those of pydantic and of named tuples."""
    for text in runpy.run_path(str(ROOT / "docs" / "make_api.py"))["pages"]().values():
        assert "autodata" not in text
        assert not re.search(r"^\.\. data:: .*\n(   :value: .*\n)?\n(?!   \S)", text, flags=re.M)
    is_noise = runpy.run_path(str(ROOT / "docs" / "conf.py"))["is_noise"]
    assert is_noise(None, "class", "model_config", {}, False, None)
    assert is_noise(None, "class", "text", dovetail.Statement.text, False, None)
    assert is_noise(None, "class", "read", dovetail.FrfReader.read, False, None) is None


@pytest.mark.parametrize("command", ["generate", "identify", "merge_datasets", "plan_measurements", "predict", "train"])
def test_what_a_command_does_is_a_public_function(command):
    assert inspect.isfunction(getattr(dovetail, command))


@pytest.mark.parametrize("command", ["calibrate", "compare", "robustness", "study", "validate"])
def test_what_a_command_of_the_bench_does_is_a_public_function_of_it(command):
    assert inspect.isfunction(getattr(dovetail_bench, command))
