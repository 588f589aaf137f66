"""Commands of packages and plugin files: they run, broken ones explain themselves, and no other command suffers."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

import dovetail
from support.waiting import PATIENCE

HOOK = """
import dovetail

@dovetail.hookimpl
def dovetail_commands():
    {body}
"""


def hook(*commands: str) -> str:
    return HOOK.format(body=f"return [{', '.join(commands)}]")


def command(name: str, function: str = "", /, **options: str) -> str:
    """Return the code that declares a command of the module ``NAME_cli``."""
    given = {"function": function or f"{name}_cli:{name}", "summary": f"Do {name}.", **options}
    return f"dovetail.Command(**{given!r})"


PACKAGES = {
    "shout": hook(command("shout", panel="Measure"), command("shout", name="shout-twice", panel="Speak")),
    "unimportable": hook(command("unimportable")),
    "functionless": hook(command("functionless", "shout_cli:whisper", name="functionless")),
    "unannotated": hook(command("unannotated")),
    "faulty": hook(command("faulty")),
    "thief": hook(command("thief", name="identify")),
    "thief_of_bench": hook(command("thief_of_bench", name="calibrate")),
    "second_shout": hook(command("second_shout", name="shout")),
    "raising": HOOK.format(body="raise RuntimeError('no licence')"),
    "returning_none": HOOK.format(body="pass"),
    "returning_text": HOOK.format(body="return 'shout'"),
    "returning_number": hook("3"),
    "placeless": hook("dovetail.Command('shout', 'Shout.')"),
    "odd_name": hook(command("odd_name", name="Shout Loud")),
    "no_summary": hook(command("no_summary", summary=" ")),
    "no_text": hook("dovetail.Command('shout_cli:shout', 3)"),
    "misspelt": hook(command("misspelt")).replace("dovetail_commands", "dovetail_command"),
    "exiting": "raise SystemExit(3)\n",
}
MODULES = {
    "shout_cli": """
import pathlib, os
pathlib.Path(os.environ["IMPORTED"]).touch()
from typing import Annotated
import typer
from dovetail.commands import print_json

def shout(text: Annotated[str, typer.Option("--text", help="What.")] = "hello"):
    \"\"\"Do shout.\"\"\"
    print_json(text.upper())
""",
    "unimportable_cli": "import gone_package\n",
    "unannotated_cli": "from typing import Annotated\nimport typer\n"
    "def unannotated(thing: Annotated[str, typer.Option(), typer.Option()]): ...\n",
    "faulty_cli": "def faulty(): raise AssertionError('bad arithmetic')\n",
}
FAILURES = {
    "thief": "the command 'identify' of thief 1.0 (thief_cli:thief) is refused: "
    f"dovetail-frf {dovetail.__version__} (dovetail.cli.identify:identify) has that name.",
    "thief_of_bench": "the command 'calibrate' of thief_of_bench 1.0 (thief_of_bench_cli:thief_of_bench) is refused: ",
    "shout": "the command 'shout' of shout 1.0 (shout_cli:shout) is refused: "
    "second_shout 1.0 (second_shout_cli:second_shout) has that name.",
    "raising": "its hook 'dovetail_commands' raised RuntimeError: no licence",
    "returning_none": "its hook 'dovetail_commands' returned None, not a list of dovetail.Command.",
    "returning_text": "its hook 'dovetail_commands' returned 'shout', not a list of dovetail.Command.",
    "returning_number": "its hook 'dovetail_commands' returned 3, not a dovetail.Command.",
    "placeless": "a command with the function 'shout', not 'package.module:function'.",
    "odd_name": "a command with the name 'Shout Loud', not small letters and digits with hyphens.",
    "no_summary": "the command 'no-summary' without a summary or without a panel.",
    "no_text": "the command 'shout' without a summary or without a panel.",
    "misspelt": "'dovetail_command' is not a hook of dovetail.",
    "exiting": "SystemExit: 3",
}


def write_package(folder: Path, name: str, code: str) -> None:
    """Write a package as pip would leave it."""
    (folder / f"{name}.py").write_text(code)
    metadata = folder / f"{name}-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(f"[dovetail]\n{name} = {name}\n")


def runner(folder: Path):
    def run(*words: object, code: int = 0) -> subprocess.CompletedProcess[str]:
        path = os.pathsep.join([str(folder), *filter(None, [os.environ.get("PYTHONPATH")])])
        environment = {**os.environ, "PYTHONPATH": path, "IMPORTED": str(folder / "imported"), "COLUMNS": "80"}
        program = [sys.executable, "-m", "dovetail", *map(str, words)]
        done = subprocess.run(program, capture_output=True, text=True, timeout=PATIENCE, env=environment)
        assert done.returncode == code, done.stderr
        return done

    return run


@pytest.fixture(scope="module")
def installed(tmp_path_factory) -> SimpleNamespace:
    """A folder with all packages, and the command line with it on the path."""
    folder = tmp_path_factory.mktemp("site")
    for name, code in PACKAGES.items():
        write_package(folder, name, code)
    for name, code in MODULES.items():
        (folder / f"{name}.py").write_text(code)
    return SimpleNamespace(folder=folder, run=runner(folder))


@pytest.fixture(scope="module")
def help_(installed) -> subprocess.CompletedProcess[str]:
    """What ``dovetail --help`` prints with all packages; no command has been run before."""
    return installed.run("--help")


def test_a_command_is_listed_under_its_panel_and_not_imported(help_, installed):
    measure = help_.stdout.partition("\nMeasure:\n")[2].partition("\n\n")[0]
    assert "  plot " in measure
    assert "shout-twice  Do shout." in help_.stdout.partition("\nSpeak:\n")[2].partition("\n\n")[0]
    assert "unimportable" in help_.stdout.partition("\nCommands of packages:\n")[2]
    assert not (installed.folder / "imported").exists()


def test_a_command_runs_with_its_options(help_, installed):
    assert installed.run("shout-twice").stdout == '"HELLO"\n'
    assert installed.run("shout-twice", "--text", "hey", "-q").stdout == '"HEY"\n'
    assert "--text " in installed.run("shout-twice", "--help").stdout
    assert "No such option" in installed.run("shout-twice", "--txt", "hey", code=2).stderr


@pytest.mark.sweep(keep=3)
@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("unimportable", "unimportable_cli:unimportable cannot be loaded: ModuleNotFoundError: No module named 'gone_"),
        ("functionless", "shout_cli:whisper cannot be loaded: AttributeError: "),
        ("unannotated", "unannotated_cli:unannotated cannot be loaded: "),
    ],
)
@pytest.mark.parametrize("words", [[], ["--any", "option"], ["--help"]])
def test_a_broken_command_explains_itself_whatever_follows_it(installed, name, reason, words):
    done = installed.run(name, *words, code=1)
    assert done.stdout == ""
    assert done.stderr.startswith(f"{name} 1.0: command '{name}'\n  {reason}")
    assert "Traceback" not in done.stderr


def test_an_error_in_a_command_of_a_package_is_reported_as_a_bug_of_that_package(installed):
    said = installed.run("faulty", code=1).stderr
    assert "AssertionError: bad arithmetic" in said
    assert f"This is a bug in dovetail {dovetail.__version__} or in faulty 1.0, not a fault of yours" in said
    assert said.count("  File ") == 1


@pytest.mark.parametrize("name", FAILURES)
def test_help_and_the_list_of_plugins_say_what_is_refused(help_, installed, name):
    assert f"Not loaded: {name} 1.0: " in help_.stderr
    assert FAILURES[name] in help_.stderr


def test_the_list_of_plugins_has_the_commands_and_each_failure_once(installed):
    listed = json.loads(installed.run("plugins", "--json").stdout)
    failures = [(entry["source"], entry["reason"]) for entry in listed["failures"]]
    assert len(failures) == len(set(failures)) == len(FAILURES)
    for source, reason in failures:
        assert FAILURES[source.split()[0]] in reason
    commands = {entry["name"]: entry["source"] for entry in listed["commands"]}
    assert commands["shout-twice"] == "shout 1.0"
    assert commands["calibrate"] == f"dovetail-frf {dovetail.__version__}"
    assert "identify" not in commands


def test_the_own_commands_go_on_working(installed, assemblies):
    done = installed.run("check", assemblies / "sdof.yaml")
    assert done.stderr == ""
    assert "Not loaded" not in installed.run("calibrate", "--help").stderr


def test_an_unknown_command_names_the_nearest_and_what_was_not_loaded(installed):
    said = installed.run("shout-twic", code=2).stderr
    assert "No such command 'shout-twic'. Did you mean 'shout-twice'?" in " ".join(said.split())
    assert "(Not loaded: raising 1.0: its hook 'dovetail_commands' raised RuntimeError: no licence" in " ".join(
        said.split()
    )


FILE = """
import dovetail

def whisper(text: str = "hello"):
    \"\"\"Whisper.\"\"\"
    print(text.lower())

@dovetail.hookimpl
def dovetail_commands():
    return [dovetail.Command(whisper, "Whisper.", name="{name}")]
"""


def test_a_plugin_file_adds_a_command(tmp_path):
    (tmp_path / "quiet.py").write_text(FILE.format(name="whisper"))
    run = runner(tmp_path)
    assert run("--plugin", tmp_path / "quiet.py", "whisper", "--text", "HEY").stdout == "hey\n"
    assert "whisper  Whisper." in run("--plugin", tmp_path / "quiet.py", "--help").stdout
    said = " ".join(run("whisper", "--plugin", tmp_path / "quiet.py", code=2).stderr.split())
    assert "A command of a plugin file needs '--plugin FILE.py' before it." in said


@pytest.mark.sweep(keep=3)
@pytest.mark.parametrize("words", [["whisper"], ["--help"]])
@pytest.mark.parametrize(
    ("code", "message"),
    [
        (FILE.format(name="identify"), "the command 'identify' of "),
        ("import gone_package\n", "ModuleNotFoundError: No module named 'gone_package'"),
        (hook("3"), "its hook 'dovetail_commands' returned 3, not a dovetail.Command."),
    ],
)
def test_a_plugin_file_with_a_broken_command_is_an_error(tmp_path, code, message, words):
    (tmp_path / "quiet.py").write_text(code)
    done = runner(tmp_path)("--plugin", tmp_path / "quiet.py", *words, code=1)
    assert message in done.stderr
    assert "Traceback" not in done.stderr
