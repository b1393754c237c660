# SPDX-License-Identifier: Apache-2.0
"""Orientation against closed forms and against a fine quadrature of the angular velocity."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from checks import random_scene
from numpy.typing import NDArray

import billiards_sim as bs

RADIUS = bs.Physics().radius


def tracked(scene: bs.Scene) -> bs.Scene:
    return replace(scene, track_orientation=True)


def product(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of quaternions (N, 4), x y z w."""
    v, w = one[:, :3], one[:, 3:]
    u, c = other[:, :3], other[:, 3:]
    return np.hstack((w * u + c * v + np.cross(v, u), w * c - np.sum(v * u, axis=1, keepdims=True)))


def angle_between(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Largest angle of the rotations that take one orientation to the other, rad."""
    apart = product(one, other * [-1.0, -1.0, -1.0, 1.0])
    return float(np.max(2.0 * np.arctan2(np.linalg.norm(apart[:, :3], axis=1), np.abs(apart[:, 3]))))


def quadrature(scene: bs.Scene, duration: float, steps: int) -> NDArray[np.float64]:
    """(N, 4) turned by the angular velocity at the middle of each of many small steps, second order."""
    simulation = bs.Simulation(scene)
    turned = np.tile([0.0, 0.0, 0.0, 1.0], (len(scene), 1))
    h = duration / steps
    for step in range(steps):
        simulation.run(until=(step + 0.5) * h)
        w = simulation.angular_velocities
        rate = np.linalg.norm(w, axis=1, keepdims=True)
        axis = np.divide(w, rate, out=np.zeros_like(w), where=rate > 0.0)
        turned = product(np.hstack((axis * np.sin(0.5 * h * rate), np.cos(0.5 * h * rate))), turned)
    return turned


def test_rolling_ball_turns_by_its_way_over_its_radius() -> None:
    scene = bs.Scene([[0.5, 0.6]], [[1.0, 0.0]], [[0.0, 1.0 / RADIUS, 0.0]], track_orientation=True)
    simulation = bs.Simulation(scene)
    simulation.run(until=1.3)
    angle = (simulation.positions[0, 0] - 0.5) / RADIUS
    assert angle > 40.0
    expected = np.array([[0.0, math.sin(0.5 * angle), 0.0, math.cos(0.5 * angle)]])
    assert angle_between(simulation.orientations, expected) <= 1e-12


def test_spin_about_the_vertical_turns_a_resting_ball() -> None:
    scene = bs.Scene([[0.5, 0.6]], None, [[0.0, 0.0, 7.0]], track_orientation=True)
    simulation = bs.Simulation(scene)
    simulation.advance(2.0)
    assert angle_between(simulation.orientations, np.array([[0.0, 0.0, math.sin(7.0), math.cos(7.0)]])) <= 1e-14


@pytest.mark.parametrize("spin", [[60.0, -90.0, 120.0], [-30.0, 10.0, 0.0], [0.0, 150.0, -200.0]])
def test_sliding_ball_turns_as_a_fine_quadrature_says(spin: list[float]) -> None:
    scene = bs.Scene([[0.5, 0.6]], [[2.0, 0.4]], [spin])
    duration = 0.3
    simulation = bs.Simulation(tracked(scene))
    simulation.run(until=duration)
    coarse, fine = (quadrature(scene, duration, steps) for steps in (3000, 6000))
    assert angle_between(coarse, fine) < 4e-6  # second order: the fine one is good to a third of that
    assert angle_between(simulation.orientations, fine) <= angle_between(coarse, fine) / 3.0 + 1e-6 * duration


def test_orientation_follows_through_collisions() -> None:
    scene = random_scene(11)
    duration = 1.0
    simulation = bs.Simulation(tracked(scene))
    assert sum(event.impulse > 0.0 for event in simulation.run(until=duration)) > 3
    # Steps that hold an event are wrong by up to the change of the angular velocity times a step.
    assert angle_between(simulation.orientations, quadrature(scene, duration, 10_000)) < 0.05


def test_orientation_of_a_resting_ball_changes_with_the_shot() -> None:
    base = bs.scenes.head_on()
    scene = bs.Scene(base.positions, names=("cue", "1"), track_orientation=True)
    simulation = bs.Simulation(scene)
    simulation.advance(1.0)
    assert simulation.orientations.tolist() == [[0.0, 0.0, 0.0, 1.0]] * 2
    simulation.strike((20.0, 0.0, 0.0))
    simulation.advance(0.2)
    turned = simulation.orientations
    assert angle_between(turned[:1], np.array([[0.0, 0.0, 0.0, 1.0]])) > 0.1
    assert turned[1].tolist() == [0.0, 0.0, 0.0, 1.0]


def test_tracking_changes_nothing_else() -> None:
    plain, turning = (bs.Simulation(scene) for scene in (random_scene(3), tracked(random_scene(3))))
    assert list(plain.run()) == list(turning.run())
    assert np.array_equal(plain.positions, turning.positions)


def test_pieces_and_snapshots_give_the_orientation_of_one_run() -> None:
    whole, pieces = (bs.Simulation(tracked(random_scene(5))) for _ in range(2))
    whole.run(until=1.0)
    pieces.advance(0.25)
    start = pieces.snapshot()
    pieces.advance(0.5)
    pieces.restore(start)
    for _ in range(75):
        pieces.advance(0.01)
    assert np.array_equal(pieces.positions, whole.positions)
    assert np.array_equal(pieces.orientations, whole.orientations)
    assert np.array_equal(pieces.copy().orientations, whole.orientations)


def test_orientation_is_there_only_where_the_scene_asks() -> None:
    with pytest.raises(ValueError, match="track_orientation=True"):
        _ = bs.Simulation(bs.scenes.head_on()).orientations
