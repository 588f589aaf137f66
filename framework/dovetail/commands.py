"""What commands of packages are made of: shared options, reading of files, printing, files of results, exit codes.

A command is a function as Typer wants it. An error that Dovetail explains, a `DovetailError`, ends it with one block of
text and code 1, `typer.BadParameter` with code 2.
"""

from __future__ import annotations

from dovetail.atomic_files import write_whole
from dovetail.cli.commands import INTERRUPTED, exit_if_failed, exit_unless_trustworthy, say_warning
from dovetail.cli.model_cache import trained_model
from dovetail.cli.options import (
    AsJson,
    AssemblyFile,
    Overwrite,
    PluginFiles,
    Scheduler,
    assembly_or_model,
    chosen_method,
    load_assembly,
    one_of,
    part,
    quantity_in,
)
from dovetail.cli.output_files import check_new_files, writing
from dovetail.cli.reading import NOTHING_SET, Reading, warnings_as_notes, with_reading
from dovetail.cli.terminal import (
    heading,
    note,
    print_json,
    print_table,
    progress_bars,
    say,
    say_on_stderr,
    table,
    title,
)
from dovetail.report.result_files import csv_text, json_text, prepare_folder, write_texts

__all__ = [
    "INTERRUPTED",
    "NOTHING_SET",
    "AsJson",
    "AssemblyFile",
    "Overwrite",
    "PluginFiles",
    "Reading",
    "Scheduler",
    "assembly_or_model",
    "check_new_files",
    "chosen_method",
    "csv_text",
    "exit_if_failed",
    "exit_unless_trustworthy",
    "heading",
    "json_text",
    "load_assembly",
    "note",
    "one_of",
    "part",
    "prepare_folder",
    "print_json",
    "print_table",
    "progress_bars",
    "quantity_in",
    "say",
    "say_on_stderr",
    "say_warning",
    "table",
    "title",
    "trained_model",
    "warnings_as_notes",
    "with_reading",
    "write_texts",
    "write_whole",
    "writing",
]
