"""Runs Dovetail and its peers on the same problems, each in an environment of its own, and writes the page's table.

    python tests/peers/run.py --folder /tmp/peers

makes an environment for each peer (`pip install`), runs `solve_*.py` there, and writes docs/peers/results.json and
the tables of docs/peers.md. Environments that exist are used again. With ``--libraries FOLDER`` packages in this
folder (site-packages) are not downloaded again.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import venv
from datetime import date
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
TABLES = ROOT / "docs" / "peers"
START, END = "<!-- written by tests/peers/run.py -->", "<!-- end of what it wrote -->"
PEERS = {"scipy": "scipy", "emcee": "emcee", "sbi": "sbi", "sdypy": "sdypy-EMA", "pyfbs": "pyFBS"}
NAMES = {
    "dovetail": "Dovetail",
    "scipy": "scipy",
    "emcee": "emcee",
    "sbi": "sbi",
    "sdypy": "sdypy-EMA",
    "pyfbs": "pyFBS",
}


def python_of(name: str, folder: Path, libraries: str) -> str:
    """Return the interpreter of a peer's environment, made if necessary; Dovetail and scipy use this one."""
    if name in ("dovetail", "scipy"):
        return sys.executable
    place = folder / {"sdypy": "ema"}.get(name, name)
    interpreter = place / "bin" / "python"
    if not interpreter.exists():
        venv.create(place, with_pip=False)
        (site,) = (place / "lib").glob("python*/site-packages")
        if libraries:
            (site / "libraries.pth").write_text(libraries)
        wanted = [PEERS[name]] if libraries else [PEERS[name], str(ROOT)]
        subprocess.run(
            [sys.executable, "-m", "pip", "--python", str(interpreter), "install", "-q", *wanted], check=True
        )
    return str(interpreter)


def user_lines(script: Path) -> int:
    """Return how many lines a user writes for the first two problems: between the first marks, without empty ones."""
    blocks = re.findall(r"# begin\n(.*?)# end", script.read_text(encoding="utf-8"), flags=re.S)
    return sum(bool(line.strip()) for line in blocks[0].splitlines())


def results_of(name: str, folder: Path, libraries: str) -> list[dict[str, object]]:
    """Run a script and return its scores."""
    interpreter, script = python_of(name, folder, libraries), HERE / f"solve_{name}.py"
    paths = [str(ROOT / "framework"), str(ROOT / "plugins"), str(HERE)]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(paths)}
    done = subprocess.run([interpreter, str(script)], env=environment, cwd=folder, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{script.name}:\n{done.stderr[-2000:]}")
    package = {"dovetail": "dovetail-frf"}.get(name, PEERS.get(name, name))
    code = f"from importlib.metadata import version; print(version('{package}'))"
    version = subprocess.run([interpreter, "-c", code], capture_output=True, text=True, check=True).stdout.strip()
    lines = [json.loads(line) for line in re.findall(r'\{"problem".*?\}', done.stdout)]
    known = {"program": NAMES[name], "version": version, "date": date.today().isoformat(), "lines": user_lines(script)}
    return [{**known, **line} for line in lines]


def table(rows: list[dict[str, object]]) -> str:
    """Return the page's tables."""

    def cell(row: dict[str, object], key: str, form: str) -> str:
        return form.format(row[key]) if key in row else ""

    days: dict[str, list[str]] = {}
    for row in rows:
        days.setdefault(str(row["date"]), []).append(str(row["program"]).split(",")[0])
    when = "; ".join(f"{day}: {', '.join(dict.fromkeys(names))}" for day, names in sorted(days.items()))
    text = f"\nEach program's own script (`tests/peers/solve_*.py`) ran on {when}.\n"
    named = [(str(row["program"]).split(",")[0], row["version"]) for row in rows]
    versions = dict(reversed(named))  # the first of each: its own script's
    versions = dict.fromkeys(f"{program} {versions[program]}" for program, _ in named)
    text += f"Versions: {', '.join(versions)}.\n"
    for problem in ("one mass", "collet"):
        text += f"\n**{problem.capitalize()}**\n\n| program | cases | median error [% of the range] | "
        text += "coverage of 90 % intervals | CPU time a case [s] | lines | note |\n|---|---|---|---|---|---|---|\n"
        for row in rows:
            if row["problem"] == problem:
                ratio = cell(row, "steps_over_autocorrelation", "{} autocorrelation times")
                note = ratio or cell(row, "simulations", "{} simulations, training included")
                cells = [
                    str(row["program"]),
                    str(row["cases"]),
                    f"{100 * float(row['median_error']):.3g}",
                    cell(row, "coverage", "{:.2f}"),
                    f"{float(row['seconds']):.2f}",
                    str(row["lines"]),
                    note,
                ]
                text += f"| {' | '.join(cells)} |\n"
    text += "\n**Modal parameters**\n\n| program | largest error of a frequency | of a damping ratio | CPU time |\n"
    text += "|---|---|---|---|\n"
    for row in rows:
        if row["problem"] == "modal parameters":
            errors = f"{row['frequency_error_percent']} % | {row['damping_error_percent']} %"
            text += f"| {row['program']} | {errors} | {row['cpu_seconds']} s |\n"
    text += "\n**Virtual point**\n\n| program | median relative error | CPU time |\n|---|---|---|\n"
    for row in rows:
        if row["problem"] == "virtual point":
            text += f"| {row['program']} | {row['relative_error']} | {row['cpu_seconds']} s |\n"
    return text + "\n"


def main() -> None:
    """Run all, or some: the others keep their results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, default=Path("peers"))
    parser.add_argument("--libraries", default="")
    parser.add_argument("--only", nargs="*", default=list(NAMES))
    given = parser.parse_args()
    TABLES.mkdir(exist_ok=True)
    given.folder.mkdir(parents=True, exist_ok=True)
    file = TABLES / "results.json"
    kept = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    for name in given.only:
        kept[name] = results_of(name, given.folder.resolve(), given.libraries)
        file.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    rows = [row for name in NAMES for row in kept.get(name, [])]
    page = ROOT / "docs" / "peers.md"
    before, _, rest = page.read_text(encoding="utf-8").partition(START)
    page.write_text(f"{before}{START}\n{table(rows)}{END}{rest.partition(END)[2]}", encoding="utf-8")


if __name__ == "__main__":
    main()
