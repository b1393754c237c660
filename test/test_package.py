# SPDX-License-Identifier: Apache-2.0
"""What a package of its kind is expected to have."""

from __future__ import annotations

from pathlib import Path

REPOSITORY = Path(__file__).parents[1]
SPDX = "# SPDX-License-Identifier: Apache-2.0"
SUFFIXES = (".py", ".yaml", ".toml", ".cfg", ".sh")


def sources() -> list[Path]:
    """Every file of ours that can hold a comment with `#`, relative to the repository."""
    files = [path for path in REPOSITORY.iterdir() if path.is_file()]
    for directory in ("billiards_sim", "config", "launch", "test"):
        files += (REPOSITORY / directory).rglob("*")
    files = [path for path in files if path.suffix in SUFFIXES or path.name == "Makefile"]
    return sorted(path.relative_to(REPOSITORY) for path in files)


def test_every_source_file_names_its_licence_at_the_top() -> None:
    found = sources()
    assert Path(__file__).relative_to(REPOSITORY) in found
    heads = {str(path): (REPOSITORY / path).read_text(encoding="utf-8").splitlines()[:2] for path in found}
    assert [path for path, head in heads.items() if SPDX not in head] == []
