# SPDX-License-Identifier: Apache-2.0
"""A table of the page's own: the engine in this process, without ROS.

What is on the table is a scene at rest. A shot is played out at once, to rest; pages get the whole run in closed form
and show it at their own pace. So the server has nothing to do while balls roll, and a preview and its shot, which
begin from the same scene, have the same bits.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from billiards_sim.command_line import one_line
from billiards_sim.engine.quantity import numbers, shown
from billiards_sim.engine.record import Run
from billiards_sim.engine.recorder import Recorder
from billiards_sim.engine.scene import Scene, index_of
from billiards_sim.engine.scene_file import read_scene, scene_text
from billiards_sim.engine.scenes import BUILT_IN
from billiards_sim.engine.simulation import Simulation, StallError
from billiards_sim.play.backend import Backend, Message
from billiards_sim.play.effects import EFFECTS
from billiards_sim.play.records import PHYSICS, TABLES, run_record, table_record
from billiards_sim.play.shots import aim_of, choice, mapping

MOST_WORK = 2.0
"""s of the wall clock that a shot is played. A break takes 3 ms, some 300 ms where the engine is interpreted."""

MOST_UNDONE = 100
"""Changes that can be undone."""

MOST_BALLS = 100
"""On a table of the page."""


class Outcome(NamedTuple):
    """What became of a shot."""

    run: Run
    after: Scene


class EngineBackend(Backend):
    """Plays on a scene.

    Raises:
        ValueError: a scene whose balls move and do not come to rest.
    """

    def __init__(self, scene: Scene) -> None:
        self.tell = lambda _: None
        self._first = scene
        self._scene = _at_rest(scene)
        self._before: deque[Scene] = deque(maxlen=MOST_UNDONE)
        self._revision = 0

    @property
    def scene(self) -> Scene:
        """What is on the table, at rest."""
        return self._scene

    def greeting(self) -> list[Message]:
        menu = {
            "tell": "menu",
            "live": False,
            "scenes": list(BUILT_IN),
            "tables": list(TABLES),
            "physics": list(PHYSICS),
        }
        return [menu, {"tell": "table", "table": self._table(), "aim": self._first_aim()}]

    async def answer(self, asked: Message) -> Message:
        do = choice("do", asked.get("do"), DOES)
        try:
            return do(self, asked) or {}
        except StallError as error:
            raise ValueError(f"the engine cannot go on: {one_line(error)}") from None

    def attend(self, pages: int) -> None:
        """Nothing goes on here between two requests."""

    def close(self) -> None:
        """There is nothing to end."""

    def _preview(self, asked: Message) -> Message:
        shot = mapping(asked, "shot")
        answer = {"run": self._previewed(self._scene, shot)}
        if asked.get("without") is not None:
            effect = choice("without", asked["without"], EFFECTS)
            answer["without"] = self._previewed(effect.switched(self._scene, not effect.is_on(self._scene)), shot)
        return answer

    @staticmethod
    def _previewed(scene: Scene, shot: Message) -> Message:
        outcome = played(scene, shot)
        return run_record(outcome.run, spins=False)

    def _shoot(self, asked: Message) -> None:
        outcome = played(self._scene, mapping(asked, "shot"))
        self._show(outcome.after, outcome.run)

    def _place(self, asked: Message) -> None:
        balls = mapping(asked, "balls")
        places, in_play = self._scene.positions.copy(), self._scene.in_play.copy()
        spins = self._scene.angular_velocities.copy()
        for name, place in balls.items():
            index = index_of(self._scene.names, name)
            in_play[index], spins[index] = place is not None, 0.0
            places[index] = np.nan if place is None else numbers(f"position of ball {name!r}", place, 2)
        self._show(
            replace(self._scene, positions=places, angular_velocities=spins, in_play=in_play, shot=None),
        )

    def _set(self, asked: Message) -> None:
        # Another game as it begins, or the same on another table, or with other physics.
        name, scene = self._scene.name, self._scene
        if "scene" in asked:
            self._play_from(choice("scene", asked["scene"], BUILT_IN)())
            return
        table = choice("table", asked["table"], TABLES)() if "table" in asked else scene.table
        physics = choice("physics", asked["physics"], PHYSICS)() if "physics" in asked else scene.physics
        stay = table == scene.table
        if stay:
            try:
                self._show(replace(scene, physics=physics, shot=None))
                return
            except ValueError:  # balls of another size overlap where these lay
                if name not in BUILT_IN:
                    raise
        if name not in BUILT_IN:
            moved = scene.positions - scene.table.centre + table.centre
            self._show(replace(scene, positions=moved, table=table, physics=physics, shot=None))
        else:
            self._play_from(BUILT_IN[name](table=table, physics=physics))

    def _effect(self, asked: Message) -> None:
        effect, on = choice("effect", asked.get("effect"), EFFECTS), asked.get("on")
        if not isinstance(on, bool):
            raise ValueError(f"on must be true or false, got {shown(on)}")
        self._show(effect.switched(self._scene, on, asked.get("value")))

    def _load(self, asked: Message) -> None:
        scene = read_file(asked, MOST_BALLS)
        if replace(scene, shot=None) != self._scene:
            self._play_from(scene)

    def _save(self, _: Message) -> Message:
        return written_file(self._scene)

    def _reset(self, _: Message) -> None:
        self._play_from(self._first)

    def _undo(self, _: Message) -> None:
        if not self._before:
            raise ValueError("there is nothing to undo")
        self._scene = self._before.pop()
        self._revision += 1
        self.tell({"tell": "table", "table": self._table()})

    def _play_from(self, scene: Scene) -> None:
        # Its balls may move: they are let go.
        self._first = scene
        if scene.velocities.any() or scene.angular_velocities.any():
            outcome = played(scene, None)
            self._show(outcome.after, outcome.run, self._first_aim())
        else:
            self._show(replace(scene, shot=None), None, self._first_aim())

    def _show(self, scene: Scene, run: Run | None = None, aim: Message | None = None) -> None:
        self._before.append(self._scene)
        self._scene = scene
        self._revision += 1
        told: Message = {"tell": "table", "table": self._table()}
        if aim is not None:
            told["aim"] = aim
        if run is not None:
            told["run"] = run_record(run)
        self.tell(told)

    def _table(self) -> Message:
        return {**table_record(self._scene), "revision": self._revision, "undo": len(self._before)}

    def _first_aim(self) -> Message:
        # The shot that the scene comes with, in the page's words; empty where it has none.
        shot, physics = self._first.shot, self._first.physics
        if shot is None:
            return {}
        along, across, down = shot.force
        size = float(np.hypot(along, across))
        return {
            "ball": shot.ball,
            "speed": size * physics.cue_contact_time / physics.mass,
            "azimuth": float(np.arctan2(across, along)),
            "side": shot.offset[0] / physics.radius,
            "up": shot.offset[1] / physics.radius,
            "elevation": float(np.arctan2(-down, size)),
        }


DOES: dict[str, Any] = {
    "preview": EngineBackend._preview,
    "shoot": EngineBackend._shoot,
    "place": EngineBackend._place,
    "set": EngineBackend._set,
    "effect": EngineBackend._effect,
    "load": EngineBackend._load,
    "save": EngineBackend._save,
    "reset": EngineBackend._reset,
    "undo": EngineBackend._undo,
}
"""What a page can ask for."""


def read_file(asked: Message, most_balls: int) -> Scene:
    """The scene of a file that a page has.

    Raises:
        ValueError: it is none.
    """
    text = asked.get("text")
    if not isinstance(text, str):
        raise ValueError(f"text must be that of a scene file, got {shown(text)}")
    try:
        return read_scene(text, most_balls)
    except ImportError as error:
        raise ValueError(str(error)) from None


def written_file(scene: Scene) -> Message:
    """A scene file, for a page to keep.

    Raises:
        ValueError: it cannot be written, for want of a library.
    """
    try:
        return {"text": scene_text(scene), "name": scene.name or "table"}
    except ImportError as error:
        raise ValueError(str(error)) from None


def played(scene: Scene, shot: Message | None) -> Outcome:
    """Play a shot, in the words of a page, to rest; or let the balls of a scene go.

    Raises:
        ValueError: no shot, or the balls do not come to rest.
        StallError: as `Simulation.run`.
    """
    simulation = Simulation(scene)
    if shot is not None:
        aim, ball = aim_of(shot)
        simulation.shoot(aim.speed, aim.azimuth, aim.side, aim.up, aim.elevation, ball)
    recorder = Recorder(len(scene))
    events = simulation.run(recorder=recorder, budget=MOST_WORK)
    if not simulation.at_rest:
        raise ValueError(f"the balls do not rest after {simulation.time:.6g} s and {len(events)} events")
    run = Run(scene, recorder, events, 0.0, simulation.time)
    return Outcome(run, simulation.scene())


def _at_rest(scene: Scene) -> Scene:
    moving = scene.velocities.any() or scene.angular_velocities.any()
    return played(scene, None).after if moving else replace(scene, shot=None)
