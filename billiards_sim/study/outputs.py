# SPDX-License-Identifier: Apache-2.0
"""What options of an executable name to be written: refused before any long computing where that cannot be."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from billiards_sim.command_line import Refusal

PICTURES = (".png", ".svg", ".pdf")

PACKAGES = {"PIL": "pillow", "imageio_ffmpeg": "imageio-ffmpeg"}
"""What pip calls a module, where its name is another."""


@contextmanager
def writing(option: str, path: Path) -> Iterator[None]:
    """Writes, or looks at, what an option names.

    Raises:
        Refusal: that fails.
    """
    try:
        yield
    except OSError as error:
        raise Refusal(f"--{option}: cannot write {str(path)!r}: {error.strerror or error}") from None


def check_places(paths: Mapping[str, Path]) -> None:
    """Whether there can be a file at the path of each option; of a `bag`, a new directory.

    Raises:
        Refusal: there cannot, or two options name the same one.
    """
    for index, (option, path) in enumerate(paths.items()):
        with writing(option, path):
            if option == "bag" and path.exists():
                raise Refusal(f"--bag: {str(path)!r} exists already")
            if path.is_dir():
                raise Refusal(f"--{option}: {str(path)!r} is a directory")
            if not path.parent.is_dir():
                raise Refusal(f"--{option}: cannot write {str(path)!r}: no directory {str(path.parent)!r}")
        if path in list(paths.values())[:index]:
            raise Refusal(f"--{option}: {str(path)!r} is written by another option, too")


def check_ending(option: str, path: Path, known: Sequence[str]) -> str:
    """That of a path, in small letters.

    Raises:
        Refusal: it is none that is known.
    """
    ending = path.suffix.lower()
    if ending not in known:
        raise Refusal(f"--{option}: {str(path)!r} must end in {' or '.join(known)}")
    return ending


def check_installed(option: str, modules: Sequence[str]) -> None:
    """Whether the modules that an option needs are there.

    Raises:
        Refusal: one is not.
    """
    for module in modules:
        try:
            importlib.import_module(module)
        except ImportError:
            package = PACKAGES.get(module, module)
            raise Refusal(f"--{option} needs {package}: pip install 'billiards_sim[plot]'") from None


def check_picture(option: str, path: Path) -> None:
    """Whether a picture can be drawn to a path.

    Raises:
        Refusal: it has another ending, or matplotlib is not there.
    """
    check_ending(option, path, PICTURES)
    check_installed(option, ["matplotlib"])
