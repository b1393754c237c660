# SPDX-License-Identifier: Apache-2.0
"""Files and directories are written whole or not at all."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def written(path: str | Path) -> Iterator[Path]:
    """Write a file beside its place, and put it there when the block ends.

    Yields the path to write to, whose ending is that of `path`. Where the block fails or is interrupted, nothing is
    left of it, and what was at `path` stays. A device or a pipe is written to directly.

    Raises:
        OSError: it cannot be written; the one that names `path`, if it is known before the block.
    """
    final = Path(os.path.realpath(path))  # a link stays a link
    if final.exists() and not final.is_file():
        yield final
        return
    beside = final.with_name(f".{final.stem[:100]}.{os.getpid()}{final.suffix}")
    try:
        beside.open("wb").close()  # fails here, if it does, and with the mode that a new file has
    except OSError as error:
        raise type(error)(error.errno, error.strerror, str(path)) from None
    try:
        yield beside
        if final.exists():
            shutil.copymode(final, beside)
        beside.replace(final)
    finally:
        beside.unlink(missing_ok=True)


@contextmanager
def written_directory(path: str | Path) -> Iterator[Path]:
    """Write a directory beside its place, and put it there when the block ends.

    Yields the directory to write in, a new one. Where the block fails or is interrupted, nothing is left of it. At
    `path` there may be an empty directory, and nothing else.

    Raises:
        OSError: it cannot be written, or something is at `path`; the one that names `path`, if it is known before the
            block.
    """
    final = Path(os.path.realpath(path))
    beside = final.with_name(f".{final.name[:100]}.{os.getpid()}")
    try:
        beside.mkdir()
    except OSError as error:
        raise type(error)(error.errno, error.strerror, str(path)) from None
    try:
        yield beside
        beside.replace(final)
    finally:
        shutil.rmtree(beside, ignore_errors=True)
