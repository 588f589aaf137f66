"""Malicious or accidentally broken files are refused quickly and in plain words."""

from __future__ import annotations

import os
import time

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from dovetail.description import read_description
from dovetail.documents.yaml_reader import LARGEST_FILE, LARGEST_TREE
from dovetail.errors import DescriptionError

BILLION_LAUGHS = "a0: &a0 lol\n" + "".join(
    f"a{level}: &a{level} [{', '.join([f'*a{level - 1}'] * 10)}]\n" for level in range(1, 10)
)
LIMIT_S = 20
"""Processor time, which other programs do not change: far above what any of these takes, far below what it could."""

EXACT = {
    "empty": (b"", "test.yaml:1:1\n  the file is empty.\n  Accepted: a description, which begins with 'dovetail: 1'"),
    "comments_only": (
        b"# later\n",
        "test.yaml:2:1\n  the file is empty.\n  Accepted: a description, which begins with 'dovetail: 1'",
    ),
    "list": (
        b"- 1\n",
        "test.yaml:1:1\n  the file contains a list.\n  Accepted: a description (YAML); measured files come after it",
    ),
    "scalar": (
        b"hello",
        "test.yaml:1:1\n  the file contains 'hello'.\n  Accepted: a description (YAML); measured files come after it",
    ),
    "not_utf8": (
        b"dovetail: 1\nname: caf\xe9\n",
        "test.yaml:2:10\n  the byte 0xe9 is not UTF-8.\n  Save the file as UTF-8.",
    ),
    "utf16": (
        "dovetail: 1".encode("utf-16"),
        "test.yaml:1:1\n  the byte 0xff is not UTF-8.\n  Save the file as UTF-8.",
    ),
    "nul": (b"dovetail: 1\nname: \0\n", "test.yaml:2:7\n  the character U+0000 is not allowed in a description."),
    "two_megabytes": (
        b"a: " + b"x" * 2_000_000,
        f"test.yaml\n  the file has 2000003 bytes; a description has {LARGEST_FILE} at most.\n"
        "  Accepted: a description (YAML); measured files come after it",
    ),
    "deep_list": (b"a: " + b"[" * 100_000, "test.yaml:1:35\n  this is nested more than 32 levels deep."),
    "deep_mapping": (b"{a: " * 60_000, "test.yaml:1:126\n  this is nested more than 32 levels deep."),
    "deep_dashes": (b"- " * 100_000, "test.yaml:1:65\n  this is nested more than 32 levels deep."),
    "billion_laughs": (
        BILLION_LAUGHS.encode(),
        f"test.yaml:6:25\n  the description has more than {LARGEST_TREE} values, aliases followed.",
    ),
    "aliases_that_nest": (
        b"a0: &a0 [1]\n" + b"".join(b"a%d: &a%d [*a%d]\n" % (n, n, n - 1) for n in range(1, 60)),
        "test.yaml:31:12\n  this is nested more than 32 levels deep.",
    ),
    "many_values": (
        b"a: [" + b"1," * 100_000 + b"]",
        f"test.yaml:1:{2 * LARGEST_TREE - 1}\n  the description has more than {LARGEST_TREE} values, aliases followed.",
    ),
    "endless_version": (
        b"%YAML 1." + b"9" * 5000 + b"\n---\na: 1",
        "test.yaml:1:1\n  this is not YAML: an escape or a directive cannot be read.",
    ),
}


@pytest.mark.parametrize("case", EXACT)
def test_a_hostile_description_has_its_message_in_bounded_time(case, message):
    data, expected = EXACT[case]
    started = time.process_time()
    assert message(data) == expected
    assert time.process_time() - started < LIMIT_S


N = LARGEST_FILE - 100
SLOW = {
    "long_word": "name: " + "x" * N,
    "long_key": "x" * N + ": 1",
    "many_keys": "".join(f"k{index}: 1\n" for index in range(N // 10)),
    "many_duplicates": "k: 1\n" * (N // 5),
    "many_tags": "a: [" + "!x 1," * (N // 6) + "]",
    "many_anchors": "a: [" + "&a 1," * (N // 6) + "]",
    "many_documents": "---\n" * (N // 4),
    "many_substructures": "substructures:\n" + "".join(f"  s{index}: {{model: r}}\n" for index in range(N // 30)),
    "tower_of_powers": "frequency: {start: 1 Hz^9^9^9^9^9, stop: 2 m**9**9**9**9, step: 1 (s^9)^9^9^9}",
    "powers_in_superscripts": "frequency: {start: 1 Hz^9⁹⁹⁹⁹⁹⁹⁹⁹, stop: 2 m⁹⁹⁹⁹⁹⁹⁹⁹⁹**9, step: 1}",
    "long_number": "frequency: {start: " + "9" * (N // 2) + ", stop: " + "9" * (N // 3) + ".0}",
}


@pytest.mark.parametrize("case", SLOW)
def test_hostile_descriptions_are_refused_in_bounded_time(case, message):
    started = time.process_time()
    assert len(message(SLOW[case])) < 300_000
    assert time.process_time() - started < LIMIT_S


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_is_not_waited_for(registry, tmp_path):
    os.mkfifo(tmp_path / "pipe.yaml")
    with pytest.raises(DescriptionError, match="this is not a file"):
        read_description(tmp_path / "pipe.yaml", registry)


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("none.yaml", "none.yaml\n  there is no such file."),
        (".", ".\n  this is a folder.\n  Accepted: a description (YAML); measured files come after it"),
        ("no\0ne.yaml", r"no\u0000ne.yaml" "\n  the file cannot be read: embedded null byte."),
    ],
)
def test_a_description_that_is_not_a_file_is_refused(source, found, registry, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(DescriptionError) as caught:
        read_description(source, registry)
    assert str(caught.value) == found


def test_no_tag_ever_runs_anything(message, broken, tmp_path):
    target = tmp_path / "made"
    for tag in (
        "!!python/object/apply:os.mkdir",
        "!!python/object/new:os.mkdir",
        "!<tag:yaml.org,2002:python/name:os>",
    ):
        assert "is not allowed here" in message(broken({"name: test": f"name: {tag} ['{target}']"}))
    assert not target.exists()


PIECES = [
    "\n",
    " ",
    "  ",
    "\t",
    ":",
    ": ",
    "-",
    "- ",
    "[",
    "]",
    "{",
    "}",
    ",",
    "&a ",
    "*a",
    "!",
    "!!int ",
    "'",
    '"',
    "|",
]
PIECES += [
    ">",
    "#",
    "?",
    "? ",
    "%",
    "@",
    "1e8",
    "-1",
    ".nan",
    "0x",
    "~",
    "true",
    "mm",
    "N m/rad",
    "\\",
    "\x85",
    "é",
    "🔧",
]


@settings(
    max_examples=300,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(
    edits=st.lists(
        st.tuples(st.floats(0, 1), st.integers(0, 12), st.lists(st.sampled_from(PIECES), max_size=3).map("".join)),
        min_size=1,
        max_size=4,
    )
)
@example(edits=[(0.5, 0, "? [")])
def test_a_damaged_file_is_read_or_refused_with_an_explanation(edits, registry, sound, tmp_path):
    text = sound
    for place, removed, inserted in edits:
        start = int(place * len(text))
        text = text[:start] + inserted + text[start + removed :]
    file = tmp_path / "test.yaml"
    file.write_text(text, encoding="utf-8")
    faults = ()
    try:
        read_description(file, registry)
    except DescriptionError as error:
        faults = error.faults
    assert all(fault.where.startswith(str(file)) for fault in faults)
