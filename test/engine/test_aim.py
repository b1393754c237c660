# SPDX-License-Identifier: Apache-2.0
"""Shots in people's words, as an `Aim` and with `Simulation.shoot`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import billiards_sim as bs
from billiards_sim.engine.aim import Aim

PHYSICS = bs.Physics(mass=0.17, radius=0.03, cue_contact_time=0.002)


def table() -> bs.Simulation:
    return bs.Simulation(bs.Scene([[1.0, 0.6], [2.0, 0.6]], physics=PHYSICS))


def test_a_shot_in_words_gives_the_ball_its_speed_direction_and_spin() -> None:
    simulation = table()
    simulation.shoot(speed=3.0, azimuth=math.radians(120.0), side=0.3, up=-0.2)
    assert simulation.velocities[0] == pytest.approx([-1.5, 1.5 * math.sqrt(3.0)], abs=1e-12)
    # w = 5 v b / (2 R^2) for a tip b off the centre: to the left it turns the ball clockwise
    assert simulation.angular_velocities[0, 2] == pytest.approx(-2.5 * 3.0 * 0.3 / 0.03)
    # hit below its centre the ball turns backwards about the axis to the left of the shot, (-sin, cos)
    back = -2.5 * 3.0 * 0.2 / 0.03
    axis = np.array([-math.sin(math.radians(120.0)), math.cos(math.radians(120.0))])
    assert simulation.angular_velocities[0, :2] == pytest.approx(back * axis)
    assert simulation.velocities[1].tolist() == [0.0, 0.0]
    shot, *_ = simulation.advance(0.0)
    assert (shot.kind, shot.balls, shot.impulse) == ("shot", ("cue",), pytest.approx(0.17 * 3.0))


def test_any_ball_can_be_shot() -> None:
    simulation = table()
    simulation.shoot(2.0, -0.5 * math.pi, ball="1")
    assert simulation.velocities == pytest.approx(np.array([[0.0, 0.0], [0.0, -2.0]]), abs=1e-12)
    with pytest.raises(ValueError, match="no ball is named '7'"):
        simulation.shoot(2.0, 0.0, ball="7")


def test_an_elevated_cue_gives_the_speed_along_the_table_and_presses_down() -> None:
    level, steep = Aim(3.0, 0.7).shot(PHYSICS), Aim(3.0, 0.7, elevation=math.radians(30.0)).shot(PHYSICS)
    assert level.force[2] == 0.0
    assert steep.force[:2] == level.force[:2]
    along = math.hypot(*steep.force[:2])
    assert along == pytest.approx(0.17 * 3.0 / 0.002)
    assert steep.force[2] == pytest.approx(-along / math.sqrt(3.0))


def test_a_shot_that_strike_refuses_changes_nothing() -> None:
    simulation = table()
    with pytest.raises(ValueError, match="force must give the ball a speed <= 2.9979"):
        simulation.shoot(3e8 * 0.9, 0.0, elevation=1.0)
    assert simulation.at_rest
    simulation.shoot(3.0, 0.0, elevation=0.1)
    with pytest.raises(ValueError, match="ball 'cue' must rest"):
        simulation.shoot(3.0, 0.0)


@pytest.mark.parametrize("speed", [0.0, -1.0, 1e9, 1e308])
def test_a_speed_out_of_bounds_is_refused(speed: float) -> None:
    with pytest.raises(ValueError, match="speed must be > 0 and <= 2.99792e"):
        table().shoot(speed, 0.0)


@pytest.mark.parametrize("bad", [math.nan, math.inf, "3", None, True, 1j, [1.0]])
@pytest.mark.parametrize("name", ["speed", "azimuth", "side", "up", "elevation"])
def test_what_is_no_finite_number_is_refused(name: str, bad: Any) -> None:
    words: dict[str, Any] = {"speed": 3.0, "azimuth": 0.0, name: bad}
    with pytest.raises(ValueError, match=f"{name} must be a finite number, got"):
        table().shoot(**words)


@pytest.mark.parametrize("tip", [(1.0, 0.0), (0.8, -0.6), (0.0, -1.1)])
def test_a_tip_off_the_ball_is_refused(tip: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="together < 1 radius, got"):
        table().shoot(3.0, 0.0, *tip)


@pytest.mark.parametrize("elevation", [-0.1, 0.5 * math.pi, 4.0])
def test_a_cue_from_below_or_beyond_upright_is_refused(elevation: float) -> None:
    with pytest.raises(ValueError, match="elevation must be >= 0 and < pi/2 rad, got"):
        table().shoot(3.0, 0.0, elevation=elevation)
