"""Options that belong together are one parameter of a command, and the same options of each command."""

import pytest
import typer
from typer.testing import CliRunner

from dovetail.cli.app import app
from dovetail.cli.bundles import bundled
from dovetail.cli.reading import Reading, with_reading

READING = {"--quantity", "--unit", "--name", "--columns", "--ignore-dofs", "--reader", "--plugin"}


def options(name):
    group = typer.main.get_command(app)
    with group.make_context("dovetail", [name]) as context:
        return {option for parameter in group.get_command(context, name).params for option in parameter.opts}


@pytest.mark.parametrize("name", ["identify", "plot", "convert", "explore"])
def test_every_command_that_reads_measurements_has_all_options_for_it(name):
    assert READING | {"--index", "--response", "--force", "--accelerometer-mass"} <= options(name)


@pytest.mark.parametrize(
    ("selects", "words", "reading"),
    [
        ("one", [], Reading({})),
        ("each", [], Reading({})),
        ("none", [], Reading({})),
        ("one", ["--index", "2", "--response", "5+x"], Reading({}, (2,), ("5+x",))),
        ("each", ["--index", "2", "--index", "3"], Reading({}, (2, 3))),
        ("none", ["--name", "values=H1", "--name", "real=a b"], Reading({"names": {"values": "H1", "real": "a b"}})),
        (
            "none",
            ["--columns", "frequency, real", "--unit", "g/N"],
            Reading({"columns": ("frequency", "real"), "unit": "g/N"}),
        ),
        (
            "none",
            ["--accelerometer-mass", "1.2 g", "--ignore-dofs"],
            Reading({"accelerometer_mass": 0.0012, "ignore_dofs": True}),
        ),
    ],
)
def test_options_of_reading_arrive_as_one_value(selects, words, reading):
    arrived = []

    @with_reading(selects)
    def command(reading: Reading, last: int = 1) -> None:
        arrived.append((reading, last))

    made = typer.Typer()
    made.command()(command)
    assert CliRunner().invoke(made, [*words, "--last", "3"]).exit_code == 0
    assert arrived == [(reading, 3)]


def test_bundles_can_be_stacked_and_keep_the_order_of_parameters():
    arrived = []

    @bundled("first", {"a": (int, 1), "b": (str, "x")}, dict)
    @bundled("second", {"c": (bool, False)}, dict)
    def command(word: str, first: object = None, middle: int = 0, second: object = None) -> None:
        """Do it."""
        arrived.append((word, first, middle, second))

    made = typer.Typer()
    made.command()(command)
    (names,) = [[parameter.name for parameter in typer.main.get_command(made).params]]
    assert [name for name in names if "completion" not in name] == ["word", "a", "b", "middle", "c"]
    assert CliRunner().invoke(made, ["w", "--a", "2", "--c"]).exit_code == 0
    assert arrived == [("w", {"a": 2, "b": "x"}, 0, {"c": True})]
