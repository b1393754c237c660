# SPDX-License-Identifier: Apache-2.0
"""Pictures of the table in the browser, with the preview of a break: python test/picture_play.py docs

Writes play.png, on a desk, and play_phone.png. Needs a browser, playwright and Pillow.
"""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Any

from browser import Page, Server, launched
from PIL import Image

BREAK = {"speed": 9.0, "azimuth": 0.014}
"""m/s, rad: the 1 and the 14 fall."""

DESK: dict[str, Any] = {"viewport": {"width": 1280, "height": 800}}
PHONE: dict[str, Any] = {
    "viewport": {"width": 390, "height": 844},
    "device_scale_factor": 1,
    "has_touch": True,
    "is_mobile": True,
}
COLOURS = 256
"""Of a picture: enough for what the page draws, at a sixth of the size."""


def picture(browser: Any, address: str, screen: dict[str, Any], path: Path) -> None:
    """What a page shows before a break."""
    context = browser.new_context(**screen)
    page = Page(context.new_page()).open(address)
    page.preview()
    page("(aim) => billiards.aim.setAll(aim)", BREAK)
    page.preview()
    page.page.wait_for_timeout(500)  # until it is drawn
    image = Image.open(io.BytesIO(page.page.screenshot()))
    few = image.convert("RGB").quantize(COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=4, dither=Image.Dither.NONE)
    few.save(path, optimize=True)
    context.close()


def main() -> None:
    (directory,) = map(Path, sys.argv[1:])
    server = Server("eight_ball")
    try:
        with launched() as browser:
            picture(browser, server.address, DESK, directory / "play.png")
            picture(browser, server.address, PHONE, directory / "play_phone.png")
    finally:
        server.stop()


if __name__ == "__main__":
    main()
