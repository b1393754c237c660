# SPDX-License-Identifier: Apache-2.0
"""billiards_sim: a billiards table as a ROS 2 node over an exact, event-driven physics engine.

The names below are the engine; importing them needs NumPy alone. The node is in `billiards_sim.ros`.
"""

from billiards_sim.engine import scenes
from billiards_sim.engine.events import Event
from billiards_sim.engine.physics import Physics
from billiards_sim.engine.record import Run, record
from billiards_sim.engine.scene import Scene, Shot
from billiards_sim.engine.scene_file import load_scene, save_scene
from billiards_sim.engine.simulation import Simulation, StallError
from billiards_sim.engine.table import Table

__all__ = [
    "Event",
    "Physics",
    "Run",
    "Scene",
    "Shot",
    "Simulation",
    "StallError",
    "Table",
    "load_scene",
    "record",
    "save_scene",
    "scenes",
]
