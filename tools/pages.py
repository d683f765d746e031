"""Reads the project's Markdown pages: their code blocks, the commands in them, links and paths.

A block's info string may name a file after the language (```` ```python false_color.py ````). In `console` blocks,
commands follow a `$` and output stands below; in `sh` blocks and in those that are merely indented, every line is one.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PICTURES = "docs/pictures"
_FENCE = re.compile(r"^```(\w*)[ \t]*(\S*)[ \t]*\n(.*?)^```[ \t]*$", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"(?<!\\)\[[^\]]*\]\(([^)\s]+)\)|<img[^>]*\bsrc=\"([^\"]+)\"")
_HEADING = re.compile(r"^#+[ \t]+(.*)$", re.MULTILINE)


@dataclass(frozen=True)
class Block:
    """A code block: its language, the file it names (or ""), and its text."""

    language: str
    file: str
    text: str


def pages() -> list[Path]:
    """List the README and all pages of docs."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def blocks(page: Path) -> list[Block]:
    """List the code blocks of a page in order."""
    return [Block(*parts) for parts in _FENCE.findall(page.read_text(encoding="utf-8"))]


def _outside_blocks(page: Path) -> str:
    return _FENCE.sub("", page.read_text(encoding="utf-8"))


def commands(page: Path) -> Iterator[tuple[list[str], str]]:
    """Yield the `deferred-ir` commands of a page as words, each with the output shown on the page ("" if none)."""
    for block in blocks(page):
        if block.language == "sh":
            yield from ((words, "") for line in block.text.splitlines() if (words := _words(line)))
        elif block.language == "console":
            for part in re.split(r"^\$ ", block.text, flags=re.MULTILINE)[1:]:
                line, _, output = part.partition("\n")
                if words := _words(line):
                    yield words, output
    for line in re.findall(r"^ {4}(.+)$", _outside_blocks(page), re.MULTILINE):
        if words := _words(line):
            yield words, ""


def _words(line: str) -> list[str]:
    """Split a `deferred-ir` command line into words, without what follows a pipe. Returns none for others."""
    if not line.startswith("deferred-ir "):
        return []
    words = shlex.split(line, comments=True)
    if "|" in words:
        words = words[: words.index("|")]
    return words


def picture_commands() -> dict[str, list[str]]:
    """Return the command that makes each picture of the docs, by the picture's file name."""
    result = {}
    for page in pages():
        for words, _ in commands(page):
            for flag, value in pairwise(words):
                if flag == "-o" and value.startswith(f"{PICTURES}/"):
                    result[Path(value).name] = words
    return result


def links(page: Path) -> list[str]:
    """List the targets of all links and pictures of a page outside code blocks."""
    return [first or second for first, second in _LINK.findall(_outside_blocks(page))]


def anchors(page: Path) -> set[str]:
    """Return the anchors that `#...` may name on a page: its headings, as GitHub converts them."""
    return {
        re.sub(r"[^\w\- ]", "", heading).strip().lower().replace(" ", "-")
        for heading in _HEADING.findall(_outside_blocks(page))
    }


def paths(page: Path) -> set[str]:
    """Return the code spans of a page that are paths in the repository, such as `passes/vpl.py`."""
    return {span for span in re.findall(r"`([^`\n]+)`", _outside_blocks(page)) if re.fullmatch(r"(\w+/)+[\w.-]*", span)}


def replace_between(page: str, begin: str, end: str, text: str) -> str:
    """Return a page with the text between two markers replaced."""
    before, opened, rest = page.partition(begin)
    _, closed, after = rest.partition(end)
    if not opened or not closed:
        raise SystemExit(f"a page has no markers '{begin}' and '{end}'")
    return f"{before}{begin}\n\n{text}\n{end}{after}"
