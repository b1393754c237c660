# SPDX-License-Identifier: Apache-2.0
"""Physics of real games: against rules, measurements and formulas; and when a table with them rests."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import billiards_sim as bs
from billiards_sim.engine.physics import PRESETS
from billiards_sim.engine.quantity import quantities

GRAM = 1e-3
OUNCE = 28.349523125 * GRAM
INCH = 0.0254


def test_pool_is_as_published() -> None:
    pool = bs.Physics.pool()
    # Alciatore, TP A.14 and "Physical properties"; WPA for the ball.
    assert (pool.ball_friction, pool.ball_friction_slow, pool.ball_friction_decay) == (9.951e-3, 0.108, 1.088)
    assert (pool.ball_restitution, pool.rail_restitution, pool.rail_friction) == (0.95, 0.85, 0.2)
    assert (pool.spin_friction, pool.cue_end_mass, pool.miscue_limit) == (0.01165, 5.7e-3, 0.5)
    assert (pool.cue_contact_time, pool.sliding_friction, pool.rolling_friction) == (0.001, 0.2, 0.01)
    assert 2.0 * pool.radius == pytest.approx(2.25 * INCH, abs=1e-12)
    assert 5.5 * OUNCE <= pool.mass <= 6.0 * OUNCE


def test_snooker_is_as_published() -> None:
    snooker = bs.Physics.snooker()
    assert 2.0 * snooker.radius == 0.0525  # WPBSA
    # Mathavan, Jackson and Parkin
    assert (snooker.mass, snooker.rail_restitution, snooker.rail_friction) == (0.1406, 0.98, 0.14)
    assert snooker.sliding_friction == 0.212


def test_carom_is_as_published() -> None:
    carom = bs.Physics.carom()
    assert 0.061 <= 2.0 * carom.radius <= 0.0615  # UMB
    assert 0.205 <= carom.mass <= 0.22

    def restitution(speed: float) -> float:  # Han 2005
        return 0.39 + 0.257 * speed - 0.044 * speed**2

    assert restitution(4.0) < carom.rail_restitution < restitution(3.0)
    assert carom.rail_friction == pytest.approx(0.471 - 0.241 * 0.25 * math.pi, abs=5e-3)
    assert 0.005 <= carom.rolling_friction <= 0.015  # Alciatore


@pytest.mark.parametrize("name", PRESETS)
def test_presets_have_every_effect_within_what_was_measured(name: str) -> None:
    physics = PRESETS[name]()
    assert physics.spin_deceleration == pytest.approx(10.0, rel=1e-3)  # Alciatore: 5 to 15 rad/s^2
    assert physics.spin_deceleration == 2.5 * physics.spin_friction * physics.gravity / physics.radius
    assert 0.92 <= physics.ball_restitution <= 0.98
    assert physics.ball_friction + physics.ball_friction_slow == pytest.approx(math.tan(math.radians(6.73)), abs=1e-4)
    assert physics.cue_end_mass > 0.0
    assert physics.miscue_limit == 0.5


@pytest.mark.parametrize("name", PRESETS)
def test_keywords_replace_single_figures_of_a_preset(name: str) -> None:
    assert getattr(bs.Physics, name)() == PRESETS[name]()
    preset = PRESETS[name]()
    for field in quantities(bs.Physics):
        value = 0.5 * getattr(preset, field)
        assert PRESETS[name](**{field: value}) == replace(preset, **{field: value})
    with pytest.raises(ValueError, match="physics.ball_restitution must be a number >= 0, <= 1 .*got 2"):
        PRESETS[name](ball_restitution=2)
    with pytest.raises(TypeError, match="'slickness'"):
        PRESETS[name](slickness=1)


def pool_table(**changed: float) -> bs.Simulation:
    scene = bs.Scene([[0.5, 0.6], [1.5, 0.5]], physics=bs.Physics.pool(**changed))
    return bs.Simulation(scene)


def test_a_table_rests_once_the_last_spin_has_ended() -> None:
    simulation = pool_table(spin_friction=0.004)  # else a ball that meets nothing rolls for longer than it spins
    simulation.shoot(0.5, 0.3, side=0.4)
    spin = -simulation.angular_velocities[0, 2]
    events = simulation.run()
    assert spin == pytest.approx(2.5 * 0.5 * 0.4 / simulation.start_scene.physics.radius)
    last = spin / simulation.start_scene.physics.spin_deceleration
    assert [event.kind for event in events] == ["shot", "rolling", "rest"]
    assert events[-1].time < last - 0.1
    assert simulation.time == pytest.approx(last, rel=1e-14)
    assert simulation.at_rest
    assert simulation.kinetic_energy == 0.0


def test_a_ball_that_still_spins_where_it_lies_is_not_at_rest() -> None:
    simulation = pool_table(spin_friction=0.004)  # else a ball that meets nothing rolls for longer than it spins
    simulation.shoot(0.5, 0.3, side=0.4)
    end = simulation.copy().run()[-1].time
    simulation.run(until=end + 0.05)
    assert not simulation.velocities.any()
    assert not simulation.at_rest
    assert simulation.kinetic_energy > 0.0
    assert list(simulation.run()) == []
    assert simulation.at_rest
    forever = pool_table(spin_friction=0.0)
    forever.shoot(0.5, 0.3, side=0.4)
    forever.run()
    assert forever.at_rest
    assert forever.angular_velocities[0, 2] < -10.0


def test_a_table_without_any_spin_rests_at_its_last_event() -> None:
    simulation = pool_table()
    simulation.shoot(0.5, 0.3)
    events = simulation.run()
    assert simulation.time == events[-1].time
    assert simulation.at_rest


def test_a_spin_ends_where_a_motion_would_not() -> None:
    scene = bs.Scene([[0.5, 0.6]], None, [[0.0, 0.0, 20.0]], physics=bs.Physics.pool(rolling_friction=0.0))
    simulation = bs.Simulation(scene)
    assert list(simulation.run()) == []
    assert simulation.time == pytest.approx(20.0 / scene.physics.spin_deceleration, rel=1e-14)
    simulation.shoot(1.0, 0.0)
    with pytest.raises(ValueError, match="rolling_friction 0: give a time"):
        simulation.run()


def test_english_leaves_the_line_of_the_cue_by_the_squirt_and_away_from_its_side() -> None:
    for side, name in ((0.5, "pool"), (-0.25, "snooker")):
        simulation = bs.Simulation(bs.Scene([[1.0, 0.6]], physics=PRESETS[name]()))
        simulation.shoot(2.0, 0.7, side=side)
        physics, rest = simulation.start_scene.physics, 1.0 - side * side
        tangent = 2.5 * side * math.sqrt(rest) / (1.0 + physics.mass / physics.cue_end_mass + 2.5 * rest)
        vx, vy = simulation.velocities[0]
        assert math.atan2(vy, vx) == pytest.approx(0.7 - math.atan(tangent), abs=1e-14)
        assert math.hypot(vx, vy) == pytest.approx(2.0, rel=1e-14)


def test_a_tip_beyond_the_miscue_limit_is_refused_with_figure_and_bound() -> None:
    simulation = pool_table()
    simulation.shoot(2.0, 0.7, side=0.3, up=0.4)  # at the limit
    simulation = pool_table()
    with pytest.raises(ValueError, match=r"offset 0\.0145\d* m .* the miscue limit is 0\.5 radii, 0\.0142875 m"):
        simulation.shoot(2.0, 0.7, side=0.51)
    assert simulation.at_rest
    assert list(simulation.run()) == []


def test_a_raised_butt_bends_the_path_as_coriolis_says() -> None:
    """The last direction is that from where the ball lies on the cloth to where the line of the cue meets it."""
    physics = bs.Physics.pool(cue_end_mass=0.0, rolling_friction=0.0)
    table = bs.Table(length=20.0, width=20.0)
    simulation = bs.Simulation(bs.Scene([table.centre], table=table, physics=physics))
    side, up, elevation = 0.3, -0.2, math.radians(30.0)
    simulation.shoot(2.0, 0.0, side=side, up=up, elevation=elevation)
    simulation.run(until=3.0)
    ahead = np.array([math.cos(elevation), 0.0, -math.sin(elevation)])
    across = np.array([math.sin(elevation), 0.0, math.cos(elevation)])
    tip = side * np.array([0.0, 1.0, 0.0]) + up * across  # radii from the centre
    on_cloth = tip + (tip[2] + 1.0) / -ahead[2] * ahead
    vx, vy = simulation.velocities[0]
    assert math.atan2(vy, vx) == pytest.approx(math.atan2(on_cloth[1], on_cloth[0]), abs=1e-12)


def test_a_simulation_can_begin_at_any_time_with_the_same_bits() -> None:
    scene = bs.Scene([[0.5, 0.6], [1.5, 0.5]], None, [[0.0, 0.0, 20.0], [0.0, 0.0, 0.0]], physics=bs.Physics.pool())
    early, late = bs.Simulation(scene), bs.Simulation(scene, 1e6)
    assert late.time == 1e6
    assert late.angular_velocities[0, 2] == 20.0
    early.advance(0.5)
    late.advance(0.5)
    assert late.time == 1e6 + 0.5
    assert np.array_equal(early.angular_velocities, late.angular_velocities)
    for time in (-1.0, math.nan, math.inf, "now", True):
        with pytest.raises(ValueError, match="time must be a finite number >= 0"):
            bs.Simulation(scene, time)  # type: ignore[arg-type]
