# SPDX-License-Identifier: Apache-2.0
"""What the page can switch on and off: an effect of real pool, with its figure."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from billiards_sim.engine.physics import Physics
from billiards_sim.engine.quantity import number, quantities
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.scenes import POOL_PHYSICS, POOL_TABLE


@dataclass(frozen=True)
class Effect:
    """One switch.

    Attributes:
        key: its name in messages.
        label, help: for people.
        field: of `Physics` or `Table`, whose figure is shown.
        off: that figure without the effect: the paper's model, or no loss.
        unit: that the figure is shown in.
        scale: of it, to SI.
        also: fields that are switched together with it, with the figures of pool.
    """

    key: str
    label: str
    help: str
    field: str
    off: float
    unit: str = ""
    scale: float = 1.0
    also: tuple[str, ...] = ()

    @property
    def usual(self) -> float:
        """What it is in pool."""
        return float(getattr(POOL_PHYSICS if self._of_physics else POOL_TABLE, self.field))

    @property
    def _of_physics(self) -> bool:
        return self.field in quantities(Physics)

    def value(self, scene: Scene) -> float:
        """Its figure in a scene, SI."""
        return float(getattr(scene.physics if self._of_physics else scene.table, self.field))

    def is_on(self, scene: Scene) -> bool:
        """Whether a scene has it."""
        return self.value(scene) != self.off or any(getattr(scene.physics, name) != 0.0 for name in self.also)

    def switched(self, scene: Scene, on: bool, value: Any = None) -> Scene:
        """A scene with it or without it; with the figure of pool where none is given, SI.

        Raises:
            ValueError: a figure out of bounds.
        """
        figure = (self.usual if value is None else number(self.label, value)) if on else self.off
        changed: dict[str, Any] = {self.field: figure}
        if not self._of_physics:
            return replace(scene, table=replace(scene.table, **changed), shot=None)
        if on != self.is_on(scene):
            changed |= {name: getattr(POOL_PHYSICS, name) if on else 0.0 for name in self.also}
        return replace(scene, physics=replace(scene.physics, **changed), shot=None)


EFFECTS = {
    effect.key: effect
    for effect in (
        Effect(
            "elastic",
            "Elastic contacts",
            "Balls stay in touch for some 0.3 ms, so that a rack breaks as real ones do; off: rigid.",
            "youngs_modulus",
            0.0,
            "GPa",
            1e9,
        ),
        Effect(
            "ball_friction",
            "Ball friction",
            "The object ball is thrown off the line of centres, and spin passes over.",
            "ball_friction_slow",
            0.0,
            also=("ball_friction",),
        ),
        Effect(
            "ball_restitution",
            "Ball loss",
            "The share of speed that two balls give back; off: all of it.",
            "ball_restitution",
            1.0,
        ),
        Effect(
            "rail_friction",
            "Cushion friction",
            "Side spin changes how a ball leaves a cushion.",
            "rail_friction",
            0.0,
        ),
        Effect(
            "rail_restitution",
            "Cushion loss",
            "The share of speed that a cushion gives back; off: all of it.",
            "rail_restitution",
            1.0,
        ),
        Effect(
            "nose_height",
            "Cushion nose",
            "They meet a ball above its middle: height in diameters of a ball; off: upright walls.",
            "nose_height",
            0.5,
            "D",
        ),
        Effect(
            "spin_friction",
            "Spin decay",
            "The cloth slows the spin about the vertical; off: it stays.",
            "spin_friction",
            0.0,
        ),
        Effect(
            "squirt",
            "Squirt",
            "English pushes the cue ball off the line of the cue, by the mass at the cue's end.",
            "cue_end_mass",
            0.0,
            "g",
            1e-3,
        ),
    )
}
"""By key, in the order in which they are shown."""
