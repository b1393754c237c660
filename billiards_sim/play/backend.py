# SPDX-License-Identifier: Apache-2.0
"""What stands behind the page: a table that is asked, and that tells what becomes of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

Message = dict[str, Any]


class Backend(ABC):
    """A table to play on.

    Attributes:
        tell: takes what every page is to know, see docs/play.md; set by the server before the first page comes.
    """

    tell: Callable[[Message], None]

    @abstractmethod
    def greeting(self) -> list[Message]:
        """What a new page is told: what it may ask for, and what is on the table."""

    @abstractmethod
    async def answer(self, asked: Message) -> Message:
        """Do what a page asks for; returns the answer.

        Raises:
            ValueError: it cannot be done; one line for people. Nothing changes then.
        """

    @abstractmethod
    def attend(self, pages: int) -> None:
        """So many pages are open now. Without one, a table that runs elsewhere is not listened to."""

    @abstractmethod
    def close(self) -> None:
        """The server ends."""
