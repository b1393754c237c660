# SPDX-License-Identifier: Apache-2.0
"""What an environment looks like: pictures of the table from above, as movies have them, and a window for them."""

from __future__ import annotations

import sys
import time
from functools import cache
from typing import Any

import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from billiards_sim.engine.scene import Scene
from billiards_sim.quaternion import IDENTITY

try:
    from billiards_sim.study.falls import falls
    from billiards_sim.study.movie import Painter
    from billiards_sim.study.recording import Pose, record, ticks
except ImportError as error:
    raise DependencyNotInstalled(
        f"rendering needs Pillow and tqdm ({error}): pip install 'billiards_sim[gym]'"
    ) from None

LONGEST = 800
"""Pixels of the longer side."""

DOTS = 100
"""Pixels an inch of the window."""

Picture = NDArray[np.uint8]


class Pictures:
    """Of tables at rest."""

    def picture(self, scene: Scene, at: float) -> Picture:
        """(height, width, 3) of a scene as it begins; `at`, s, is what the clock says."""
        pose = Pose(at, scene.positions, np.tile(IDENTITY, (len(scene), 1)))
        return Painter(scene, LONGEST).frame(pose)

    def close(self) -> None:
        """Nothing is open."""


class Window(Pictures):
    """Shows tables in a window of matplotlib.

    Where there is no display, it says so once and shows nothing: what learns goes on.
    """

    def __init__(self, frame_rate: int) -> None:
        try:
            from matplotlib import pyplot
        except ImportError as error:
            raise DependencyNotInstalled(f"render_mode 'human' needs matplotlib ({error})") from None
        self._pyplot = pyplot
        self._interval = 1.0 / frame_rate  # s
        self._image: Any = None
        self._figure = pyplot.figure(dpi=DOTS)
        self._there = self._figure.canvas.required_interactive_framework is not None
        if not self._there:
            _tell_once(f"no display: nothing is shown (matplotlib's backend is {pyplot.get_backend()})")

    def hold(self, scene: Scene, at: float) -> None:
        """Show a scene as it begins."""
        if self._there:
            self._show(self.picture(scene, at), self._interval)

    def play(self, scene: Scene, at: float) -> None:
        """Show a scene's shot in its own time; the clock begins with `at`, s."""
        if not self._there:
            return
        run = record(scene)
        painter = Painter(scene, LONGEST, falls(scene, run.events))
        began = time.monotonic()
        for pose in run.poses(ticks(run.start.time, run.end.time, self._interval)):
            wait = began + pose.time - time.monotonic()
            if wait > -self._interval or pose.time == run.end.time:  # else too late to be shown
                self._show(painter.frame(pose._replace(time=at + pose.time)), max(wait, 1e-3))

    def close(self) -> None:
        self._pyplot.close(self._figure)

    def _show(self, picture: Picture, duration: float) -> None:
        if self._image is None:
            height, width, _ = picture.shape
            self._figure.set_size_inches(width / DOTS, height / DOTS)
            axes = self._figure.add_axes((0.0, 0.0, 1.0, 1.0), frame_on=False)
            axes.set_axis_off()
            self._image = axes.imshow(picture)
            self._figure.show()
        self._image.set_data(picture)
        self._figure.canvas.draw_idle()
        self._figure.canvas.start_event_loop(duration)


@cache
def _tell_once(what: str) -> None:
    print(f"billiards_sim: {what}", file=sys.stderr)
