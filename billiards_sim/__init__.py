# SPDX-License-Identifier: Apache-2.0
"""billiards_sim: a billiards table as a ROS 2 node over an exact, event-driven physics engine.

The names below are the engine; they need NumPy alone. The node is in `billiards_sim.ros`.

A name is imported when it is first used: an executable must be able to answer signals before NumPy and Numba load,
which takes half a second.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from billiards_sim.engine import goals, scenes
    from billiards_sim.engine.events import Event
    from billiards_sim.engine.machine import compile
    from billiards_sim.engine.noise import ShooterNoise
    from billiards_sim.engine.physics import Physics
    from billiards_sim.engine.pocket import Pocket
    from billiards_sim.engine.record import Run, record
    from billiards_sim.engine.rollout import BadShots, BrokenRollout, Rollout, rollout
    from billiards_sim.engine.scene import Scene, Shot
    from billiards_sim.engine.scene_file import load_scene, save_scene
    from billiards_sim.engine.search import Found, search
    from billiards_sim.engine.shots import Shots
    from billiards_sim.engine.simulation import Simulation, StallError
    from billiards_sim.engine.table import Table

__all__ = [
    "BadShots",
    "BrokenRollout",
    "Event",
    "Found",
    "Physics",
    "Pocket",
    "Rollout",
    "Run",
    "Scene",
    "ShooterNoise",
    "Shot",
    "Shots",
    "Simulation",
    "StallError",
    "Table",
    "compile",
    "goals",
    "load_scene",
    "record",
    "rollout",
    "save_scene",
    "scenes",
    "search",
]

_HOMES = {
    "BadShots": "rollout",
    "BrokenRollout": "rollout",
    "Event": "events",
    "Found": "search",
    "Physics": "physics",
    "Pocket": "pocket",
    "Rollout": "rollout",
    "Run": "record",
    "Scene": "scene",
    "ShooterNoise": "noise",
    "Shot": "scene",
    "Shots": "shots",
    "Simulation": "simulation",
    "StallError": "simulation",
    "Table": "table",
    "compile": "machine",
    "load_scene": "scene_file",
    "record": "record",
    "rollout": "rollout",
    "save_scene": "scene_file",
    "search": "search",
}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home = import_module(f"{__name__}.engine.{_HOMES.get(name, name)}")
    value = home if name not in _HOMES else getattr(home, name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
