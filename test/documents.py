# SPDX-License-Identifier: Apache-2.0
"""What the documents show: blocks of code, and every command line in them."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

REPOSITORY = Path(__file__).parents[1]
DOCUMENTS = sorted([*REPOSITORY.glob("*.md"), *(REPOSITORY / "docs").rglob("*.md")])

PROGRAMS = "make|pip|python|python3|pytest|ros2|rviz2|colcon|rosdep|rosdoc2|shoot|simulate"
"""What a command line between the words of a sentence begins with; alone, these are names."""

PLACEHOLDER = re.compile(r"[A-Z]+|\.\.\.|<.*>")
"""A word for the reader to replace."""


def blocks(document: Path, language: str) -> list[str]:
    """The fenced blocks of a language in a document."""
    text = document.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def command_lines(*beginning: str) -> list[tuple[str, ...]]:
    """The words of every command line in the documents that begins with these, each once, in order."""
    found: dict[tuple[str, ...], None] = {}
    for document in DOCUMENTS:
        lines = [line for block in blocks(document, "sh") for line in block.replace("\\\n", " ").splitlines()]
        prose = re.sub(r"^```.*?^```$", "", document.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
        inline = (" ".join(code.split()) for code in re.findall(r"`([^`]+)`", prose))
        lines += [code for code in inline if re.match(rf"(\S*/)?({PROGRAMS}) ", code)]
        for line in lines:
            for command in re.split(r"&&|&$", re.sub(r"<[^>]*>", "<>", line)):
                words = tuple(shlex.split(command, comments=True))
                if words[: len(beginning)] == beginning:
                    found[words] = None
    return [words for words in found if words]


def complete(lines: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Those in which the reader has nothing to replace."""
    return [words for words in lines if not any(PLACEHOLDER.fullmatch(word) for word in words)]
