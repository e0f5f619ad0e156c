"""Code blocks of the project's Markdown pages."""

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])

_BLOCK = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```$', re.DOTALL | re.MULTILINE)


@dataclass(frozen=True)
class Block:
    """A fenced block of code: its language, the file name in its title ("" if it has none), and its text."""

    language: str
    title: str
    text: str


def blocks(markdown: str) -> list[Block]:
    """The fenced blocks of a page, in their order."""
    return [Block(language, title, text) for language, title, text in _BLOCK.findall(markdown)]


def section(markdown: str, heading: str) -> str:
    """The text below a heading, such as "### A metric", up to the next one of the same or a higher level."""
    level = len(heading.split()[0])
    found, inside, in_block = [], False, False
    for line in markdown.splitlines(keepends=True):
        in_block ^= line.startswith("```")
        depth = 0 if in_block else len(line) - len(line.lstrip("#"))
        if inside and 0 < depth <= level:
            break
        if inside:
            found.append(line)
        inside |= line.rstrip() == heading
    if not inside:
        raise ValueError(f"the page has no heading {heading!r}")
    return "".join(found)


def commands(markdown: str) -> list[str]:
    """Every command of a page that runs a study: lines of blocks, and code in tables."""
    in_blocks = [line for block in blocks(markdown) if block.language == "sh" for line in block.text.splitlines()]
    in_tables = re.findall(r"^\|.*?`([^`]+)`", markdown, re.MULTILINE)
    found = [line.partition("#")[0].strip() for line in in_blocks + in_tables]
    return [line[line.index("python -m studies.run") :] for line in found if "python -m studies.run" in line]
