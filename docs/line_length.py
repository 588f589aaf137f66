"""Lines of pages shorter than 120 characters; the scripts that write pages use it."""

import re

LONGEST = 119
WORD = re.compile(r"(?:`[^`]*`|\$[^$]+\$|\]\([^)]*\)|\S)+(?: %\S*)?")
"""What stays on one line: a word, code, a formula, the address of a link, a number and its per cent."""


def wrapped(text: str) -> str:
    """Return Markdown with broken paragraphs and list items; rows of tables, headings and code are unchanged."""
    lines, code = [], False
    for line in text.split("\n"):
        code ^= line.startswith("```")
        lines += [line] if code or len(line) <= LONGEST or line[0] in "|#<`" else _broken(line)
    return "\n".join(lines)


def _broken(line: str) -> list[str]:
    indent = " " * len(re.match(r"\s*(?:[-*] |\d+\. )?", line)[0])
    lines = [""]
    for word in WORD.findall(line):
        longer = f"{lines[-1]} {word}" if lines[-1].strip() else f"{lines[-1]}{word}"
        if len(longer) <= LONGEST:
            lines[-1] = longer
        else:
            lines.append(indent + word)
    return lines
