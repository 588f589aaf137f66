"""How many small changes of the code do the tests notice? Mutation testing by mutmut, on a sample of its mutants.

    pip install -c constraints.txt -e ".[test,mutation]"
    python tests/mutation/run.py --package synthesis --sample 200 --seed 1

mutmut changes one operator, number, argument or keyword at a time, and runs the tests that enter the changed function.
docs/mutation_testing.md says what is left out, and gives the results.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
from mutants import Mutant, changed_lines, mutants_of, with_plain_properties

from packages import PACKAGES, Package

ROOT = Path(__file__).resolve().parents[2]
SURVIVED = {0, 5, 33}
"""Exit codes of mutmut: every test passed, or none enters the function. In all others a test failed, the interpreter
crashed, or the tests ran into the time limit."""
CONFIGURATION = """[mutmut]
source_paths = src
only_mutate =
{mutated}
also_copy =
    assemblies
    docs
    README.md
pytest_add_cli_args_test_selection =
{tests}
pytest_add_cli_args =
    -p
    no:cacheprovider
{options}
process_isolation = fork
timeout_constant = 8.0
timeout_multiplier = 3.0
"""
"""A time limit of three times what the tests take, because other work may share the machine."""
CHILD = """import os

if os.environ.get("MUTANT_UNDER_TEST") == "stats":  # mutmut counts only in the process that has its configuration
    os.environ["MUTANT_UNDER_TEST"] = ""
"""
"""What Python runs first in the processes that tests start."""
MUTMUT = """from mutmut.__main__ import cli
from mutmut.runners.harness import BadTestExecutionCommandsException, PytestRunner

forced_fail = PytestRunner.run_forced_fail


def run_forced_fail(self):
    try:
        return forced_fail(self)
    except BadTestExecutionCommandsException:
        return 1


PytestRunner.run_forced_fail = run_forced_fail
cli()
"""
"""mutmut, which makes every mutated function raise once, to see that tests fail then. A conftest that calls one while
it is loaded, as that of tests/description does with `InUnit`, makes pytest end with the exit code of a wrong command
line; the run before, of the same tests without mutants, has shown that there is nothing wrong with it."""


def lay_out(package: Package, root: Path, folder: Path) -> None:
    """Copy a checkout into the layout that mutmut knows, packages under src, and configure it."""
    shutil.rmtree(folder, ignore_errors=True)
    ignored = shutil.ignore_patterns("__pycache__", "_build")
    for source in (
        "framework/dovetail",
        "plugins/dovetail_bench",
        "plugins/dovetail_machining",
        "plugins/dovetail_plugins",
    ):
        shutil.copytree(root / source, folder / "src" / Path(source).name, ignore=ignored)
    importable = folder / "mutants" / "src"
    importable.mkdir(parents=True)  # Python passes over a path that is not there when it starts
    (importable / "sitecustomize.py").write_text(CHILD, encoding="utf-8")
    for name in ("tests", "assemblies", "docs"):
        shutil.copytree(root / name, folder / name, ignore=ignored)
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(root / name, folder)
    for file in package.files(folder / "src"):
        file.write_text(with_plain_properties(file.read_text(encoding="utf-8")), encoding="utf-8")
    tests = [name for name in package.tests if (root / name).exists()]
    options = ["-k", " and ".join(f"not {word}" for word in package.without)] if package.without else []
    lists = {"mutated": [f"src/{pattern}" for pattern in package.mutated], "tests": tests, "options": options}
    indented = {name: "\n".join(f"    {line}" for line in lines) for name, lines in lists.items()}
    (folder / "setup.cfg").write_text(CONFIGURATION.format(**indented), encoding="utf-8")


def drawn(mutants: list[Mutant], count: int, seed: int) -> list[Mutant]:
    """Return a random sample without replacement, all if there are no more."""
    generator = np.random.default_rng(seed)
    chosen = generator.permutation(len(mutants))[:count]
    return [mutants[index] for index in sorted(chosen)]


def run_mutmut(sample: list[Mutant]) -> None:
    """Test each mutant of the sample in a process of its own, one after the other."""
    one_thread = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
    environment = {**os.environ, **one_thread, "PYTHONPATH": str(Path("mutants/src").absolute())}
    command = [sys.executable, "-c", MUTMUT, "run", "--max-children", "1"]
    subprocess.run([*command, *(mutant.name for mutant in sample)], env=environment, check=True)


def exit_codes() -> dict[str, int | None]:
    """Return what became of each mutant, as mutmut stored it."""
    codes: dict[str, int | None] = {}
    for file in Path("mutants").rglob("*.py.meta"):
        codes.update(json.loads(file.read_text(encoding="utf-8"))["exit_code_by_key"])
    return codes


def report(package: str, sample: list[Mutant], population: int) -> dict[str, object]:
    """Return the score with its standard error, and the mutants that no test noticed."""
    codes = exit_codes()
    tested = [mutant for mutant in sample if codes.get(mutant.name) is not None]
    survivors = [mutant for mutant in tested if codes[mutant.name] in SURVIVED]
    score = 1.0 - len(survivors) / max(1, len(tested))
    correction = max(0.0, 1.0 - len(tested) / population)  # of a finite population
    error = (score * (1.0 - score) / max(1, len(tested)) * correction) ** 0.5
    return {
        "package": package,
        "population": population,
        "tested": len(tested),
        "killed": len(tested) - len(survivors),
        "score": round(score, 4),
        "standard_error": round(error, 4),
        "survivors": {
            mutant.name: {"exit_code": codes[mutant.name], "change": changed_lines(mutant)} for mutant in survivors
        },
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--package", choices=sorted(PACKAGES), required=True)
    parser.add_argument("--sample", type=int, default=200, help="mutants to test; 200 by default")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--root", type=Path, default=ROOT, help="the checkout to test; this one by default")
    parser.add_argument("--folder", type=Path, default=ROOT / "build" / "mutation", help="where the work is done")
    parser.add_argument("--report", action="store_true", help="only print what a run in the folder has found so far")
    arguments = parser.parse_args()
    folder = arguments.folder.resolve() / arguments.package
    package = PACKAGES[arguments.package]
    if not arguments.report:
        lay_out(package, arguments.root.resolve(), folder)
    os.chdir(folder)  # where mutmut looks for its configuration and its files
    mutants = [mutant for file in package.files(Path("src")) for mutant in mutants_of(file)]
    sample = drawn(mutants, arguments.sample, arguments.seed)
    if not arguments.report:
        run_mutmut(sample)
    result = json.dumps(report(arguments.package, sample, len(mutants)), indent=2, ensure_ascii=False)
    Path("result.json").write_text(result + "\n", encoding="utf-8")
    print(result)


if __name__ == "__main__":
    main()
