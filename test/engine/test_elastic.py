# SPDX-License-Identifier: Apache-2.0
"""Elastic contacts against closed forms, conservation laws and their own rigid limit."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from checks import COMPILED

import billiards_sim as bs
from billiards_sim.engine import machine
from billiards_sim.engine.elastic import CONTACT_STEPS, damping, duration_factor, stiffness_of
from billiards_sim.engine.tables import column, set_fields

ICE = 1e-9
"""Friction of the cloth that does nothing while balls press each other."""

SOFT = {"youngs_modulus": 5.8e9, "sliding_friction": ICE, "rolling_friction": ICE}
DIAMETER = 2.0 * bs.Physics().radius
MIDDLE = 0.6358


def row(gaps: list[float], speed: float, **physics: float) -> bs.Simulation:
    """Balls in a line along x, the first one at a speed, m/s; gaps in m."""
    x = 0.8 + np.concatenate([[0.0], np.cumsum(DIAMETER + np.array(gaps))])
    velocities = np.zeros((len(x), 2))
    velocities[0, 0] = speed
    positions = np.column_stack([x, np.full(len(x), MIDDLE)])
    return bs.Simulation(bs.Scene(positions, velocities, physics=bs.Physics(**{**SOFT, **physics})))


def opened_up(simulation: bs.Simulation) -> bs.Simulation:
    """The same a little later, when nothing presses any more."""
    simulation.advance(0.004)
    return simulation


def integrating(simulation: bs.Simulation, steps: float = CONTACT_STEPS) -> bs.Simulation:
    """The same, to which lone pairs are no exception, with so many steps a contact."""
    set_fields(simulation._now.state.constants, 0, integrates_all=True, contact_steps=steps)
    return simulation


def interpreted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have simulations that are made from now on interpreted, so that kernels can be replaced."""
    monkeypatch.setattr(machine, "is_ready", lambda: False)


# Coefficients


@pytest.mark.parametrize(
    ("restitution", "factor"),
    [(1.0, 2.94327518), (0.98, 2.94927854), (0.95, 2.95874159), (0.9, 2.97585172), (0.8, 3.01604774)],
)
def test_contacts_last_as_an_adaptive_integration_says(restitution: float, factor: float) -> None:
    assert duration_factor(restitution) == pytest.approx(factor, rel=1e-6)


def test_without_damping_the_duration_is_the_closed_form() -> None:
    # t_c v/d_max = 2 times the integral of (1 - x^(5/2))^(-1/2) from 0 to 1 = 4 sqrt(pi)/5 Gamma(2/5)/Gamma(9/10)
    exact = 0.8 * math.sqrt(math.pi) * math.gamma(0.4) / math.gamma(0.9)
    assert duration_factor(1.0) == pytest.approx(exact, rel=1e-7)


@pytest.mark.parametrize("restitution", [0.0, 1e-9, 0.01])
def test_slow_spinning_balls_that_hardly_rebound_part_in_time(restitution: float) -> None:
    # Without an end to their contact they would go on with a common speed that is not theirs, and the cloth's friction
    # would feed on it. The last of a contact without rebound is a creep.
    physics = bs.Physics(youngs_modulus=5.8e9, ball_restitution=restitution)
    scene = bs.Scene(
        [[0.5, 0.6], [0.5 + 2.0 * physics.radius, 0.6]],
        [[0.0102, 0.0], [0.0, 0.0]],
        [[0, -1, 0], [1, 1, 0]],
        physics=physics,
    )
    simulation = bs.Simulation(scene)
    energy = simulation.kinetic_energy
    hertz = 8.0 * 1.25**0.4 * (2.0 * stiffness_of(physics)) ** -0.4 * 0.0102**-0.2
    event = next(event for event in simulation.advance(0.1) if event.kind == "ball_ball")
    assert event.time <= 1.01 * hertz
    assert simulation.kinetic_energy < energy


def test_stiffness_is_hertz() -> None:
    physics = bs.Physics(youngs_modulus=5.8e9, poisson_ratio=0.34)
    modulus = 1.0 / (2.0 * (1.0 - 0.34**2) / 5.8e9)
    assert stiffness_of(physics) * physics.mass == pytest.approx(4.0 / 3.0 * modulus * math.sqrt(physics.radius / 2.0))
    assert damping(1.0) == 0.0


# Two and three balls


@pytest.mark.parametrize("speed", [0.02, 0.5, 10.0])
@pytest.mark.parametrize("restitution", [0.8, 0.9, 0.95, 1.0])
def test_a_pair_gives_back_its_restitution_at_every_speed(speed: float, restitution: float) -> None:
    first, second = opened_up(row([0.0], speed, ball_restitution=restitution)).velocities[:, 0]
    assert (second - first) / speed == pytest.approx(restitution, abs=1e-4)
    assert first + second == pytest.approx(speed, abs=1e-9)  # but for the cloth


@pytest.mark.parametrize("speed", [0.02, 0.5, 10.0])
@pytest.mark.parametrize("restitution", [0.8, 0.95, 1.0])
def test_an_integrated_pair_gives_back_its_restitution(speed: float, restitution: float) -> None:
    pair = integrating(row([0.0], speed, ball_restitution=restitution))
    first, second = opened_up(pair).velocities[:, 0]
    assert (second - first) / speed == pytest.approx(restitution, abs=1e-4)


@pytest.mark.parametrize("speed", [0.5, 8.0])
def test_three_balls_in_line_part_as_herrmann_and_seitz_found(speed: float) -> None:
    # American Journal of Physics 50 (1982) 977
    velocities = opened_up(row([0.0, 0.0], speed)).velocities[::-1, 0] / speed
    assert velocities == pytest.approx([0.9945493, 0.0764030, -0.0709523], abs=2e-5)


def test_a_ball_frozen_to_a_rail_is_hit_squarely() -> None:
    radius = bs.Physics().radius
    table = bs.Table()
    x = table.x_max - radius
    positions = [[x - DIAMETER, MIDDLE], [x, MIDDLE]]
    simulation = bs.Simulation(bs.Scene(positions, [[3.0, 0.0], [0.0, 0.0]], physics=bs.Physics(**SOFT)))
    velocities = opened_up(simulation).velocities[:, 0] / 3.0
    assert velocities == pytest.approx([-0.747225, -0.182934], abs=3e-5)


def test_slow_balls_stay_rigid() -> None:
    soft = row([1e-4], 0.009)
    rigid = row([1e-4], 0.009, youngs_modulus=0.0)
    assert list(soft.run(until=0.05)) == list(rigid.run(until=0.05))


# Groups


def rack(gap: float, aim: float = 0.0, **physics: float) -> bs.Simulation:
    """A rack that is about to be hit at 8 m/s."""
    scene = bs.scenes.rack(gap, physics=bs.Physics(**{"youngs_modulus": 5.8e9, **physics}))
    simulation = bs.Simulation(scene)
    force = 8.0 * scene.physics.mass / scene.physics.cue_contact_time
    simulation.strike((force * math.cos(aim), force * math.sin(aim), 0.0))
    return simulation


def test_a_rack_keeps_energy_and_momentum() -> None:
    scene = rack(1e-4, 0.003, sliding_friction=0.0, rolling_friction=0.0)
    until = next(event.time for event in scene.copy().run(until=2.0) if event.kind == "ball_ball") - 1e-3
    scene.run(until=until)
    before, momentum = scene.kinetic_energy, scene.velocities.sum(axis=0)
    scene.advance(0.006)
    assert scene.kinetic_energy == pytest.approx(before, rel=2e-5)
    assert scene.velocities.sum(axis=0) == pytest.approx(momentum, abs=1e-11)


def test_a_break_breaks() -> None:
    simulation = rack(5e-5, 0.001)
    start = simulation.positions
    simulation.run()
    assert np.median(np.hypot(*(simulation.positions - start)[1:].T)) >= 0.4


ROUGH = {"ball_restitution": 0.95, "ball_friction": 0.01, "ball_friction_slow": 0.1, "rail_friction": 0.2}
"""What makes contacts damp and rub."""


@pytest.mark.parametrize("effects", [{}, ROUGH], ids=["smooth", "rough"])
def test_a_symmetric_rack_stays_symmetric_until_rest(effects: dict[str, float]) -> None:
    simulation = rack(0.0, **effects)
    start = simulation.positions
    middle = simulation.start_scene.table.centre[1]
    mirrored = np.column_stack([start[:, 0], 2.0 * middle - start[:, 1]])
    partner = [int(np.argmin(np.hypot(*(mirrored - place).T))) for place in start]
    simulation.run()
    reflected = np.column_stack([simulation.positions[:, 0], 2.0 * middle - simulation.positions[:, 1]])
    assert reflected[partner] == pytest.approx(simulation.positions, abs=1e-9)


@pytest.mark.parametrize("effects", [{}, ROUGH], ids=["smooth", "rough"])
@pytest.mark.parametrize("aim", [0.0, 0.005])
def test_the_order_of_the_balls_of_a_touching_rack_does_not_matter_until_rest(
    aim: float, effects: dict[str, float]
) -> None:
    simulation = rack(0.0, aim, **effects)
    order = np.random.default_rng(2).permutation(16)
    velocities = simulation.velocities[order]
    scene = simulation.start_scene
    other = bs.Simulation(bs.Scene(simulation.positions[order], velocities, physics=scene.physics))
    simulation.run()
    other.run()
    assert other.positions == pytest.approx(simulation.positions[order], abs=1e-9)


def test_each_contact_is_logged_once_with_its_whole_impulse() -> None:
    simulation = rack(1e-4, 0.002, sliding_friction=ICE, rolling_friction=ICE)
    start = simulation.velocities[0]
    events = [event for event in simulation.run(until=0.16) if event.kind == "ball_ball"]
    assert len(events) > 15
    gained = {name: np.zeros(2) for name in simulation.start_scene.names}
    for event in events:
        assert event.approach_speed > 0.0
        gained[event.balls[0]] += np.array(event.normal) * event.impulse
        gained[event.balls[1]] -= np.array(event.normal) * event.impulse
    mass = simulation.start_scene.physics.mass
    found = np.array([gained[name] for name in simulation.start_scene.names]) / mass
    found[0] += start
    assert found == pytest.approx(simulation.velocities, abs=1e-7)  # but for the cloth


@pytest.mark.parametrize(
    ("azimuth", "side", "up"),
    [
        (0.04660455096995052, -0.2764628976961739, -0.2597495675842461),
        (0.04544198675394673, -0.29179908205278565, -0.22133849911143988),
    ],
)
def test_a_ball_that_just_touches_those_that_press_each_other_does_not_hold_them_up(
    azimuth: float, side: float, up: float
) -> None:
    simulation = bs.Simulation(bs.scenes.rack(physics=bs.Physics.pool()))
    simulation.shoot(8.0, azimuth, side=side, up=up)
    simulation.advance(0.16)  # the cue ball meets the rack at 0.152 s
    assert column(simulation._now.state.clock, "passes")[0] < 2000


def test_balls_rest_apart_after_all() -> None:
    for gap in (0.0, 3e-4):
        simulation = rack(gap, 0.004, ball_restitution=0.95, ball_friction=0.05, rail_friction=0.2)
        simulation.run()
        assert simulation.at_rest
        distances = np.hypot(*np.moveaxis(simulation.positions[:, np.newaxis] - simulation.positions, 2, 0))
        assert distances[np.triu_indices(16, 1)].min() >= DIAMETER - 1e-9


def lone_pair(seed: int, **physics: float) -> bs.Simulation:
    """A ball that is about to meet another, at any angle."""
    random = np.random.default_rng(seed)
    angle = random.uniform(-1.55, 1.55)
    speed = 10.0 ** random.uniform(-1.0, 1.0)
    target = np.array([0.9, MIDDLE]) + (DIAMETER + 1e-6) * np.array([math.cos(angle), math.sin(angle)])
    scene = bs.Scene([[0.9, MIDDLE], target], [[speed, 0.0], [0.0, 0.0]], physics=bs.Physics(**{**SOFT, **physics}))
    return bs.Simulation(scene)


@pytest.mark.parametrize("restitution", [0.8, 0.95, 1.0])
@pytest.mark.parametrize("seed", range(10))
def test_a_lone_pair_in_closed_form_is_what_its_integration_says(seed: int, restitution: float) -> None:
    lone = lone_pair(seed, ball_restitution=restitution)
    integrated = integrating(lone.copy(), 200.0)
    speed = lone.velocities[0, 0]
    opened_up(lone), opened_up(integrated)
    assert lone.velocities == pytest.approx(integrated.velocities, abs=5e-5 * speed)
    assert lone.positions == pytest.approx(integrated.positions, abs=1e-6)


@pytest.mark.parametrize("seed", range(10))
def test_a_lone_pair_keeps_energy_and_angular_momentum(seed: int) -> None:
    lone = lone_pair(seed)
    before, energy = lone.velocities, lone.kinetic_energy
    turning = angular_momentum(lone)
    opened_up(lone)
    assert lone.kinetic_energy == pytest.approx(energy, rel=1e-7)  # but for the cloth
    assert lone.velocities.sum(axis=0) == pytest.approx(before.sum(axis=0), abs=1e-8)
    assert angular_momentum(lone) == pytest.approx(turning, rel=1e-7, abs=1e-9)


def angular_momentum(pair: bs.Simulation) -> float:
    """Of two balls about their middle, per mass/2, m^2/s."""
    (dx, dy), (du, dv) = pair.positions[1] - pair.positions[0], pair.velocities[1] - pair.velocities[0]
    return float(dx * dv - dy * du)


# Cuts and speeds


def test_time_may_be_cut_anywhere() -> None:
    whole = rack(5e-5, 0.001, ball_restitution=0.95, ball_friction=0.03)
    pieces = whole.copy()
    random = np.random.default_rng(5)
    expected = list(whole.run(until=0.2))
    events: list[bs.Event] = []
    while pieces.time < 0.2:
        events += pieces.run(until=min(pieces.time + random.exponential(2e-4), 0.2))
        if len(events) % 7 == 3:
            pieces = pickle.loads(pickle.dumps(pieces.copy()))
    assert events == expected
    assert pieces.positions.tobytes() == whole.positions.tobytes()
    assert pieces.angular_velocities.tobytes() == whole.angular_velocities.tobytes()


def test_ticks_of_a_node_lead_to_the_same_bits() -> None:
    whole = rack(5e-5, 0.001, ball_restitution=0.95, ball_friction=0.03)
    ticked = whole.copy()
    expected = list(whole.run(until=0.2))
    events: list[bs.Event] = []
    for _ in range(200):
        events += ticked.advance(0.001)
    ticked.run(until=0.2)  # 200 times 0.001 is not 0.2 to the bit
    assert events == expected
    assert ticked.positions.tobytes() == whole.positions.tobytes()


def test_a_snapshot_in_mid_contact_leads_to_the_same_bits() -> None:
    whole = rack(5e-5, 0.001, ball_restitution=0.95, ball_friction=0.03)
    hit = next(event.time for event in whole.copy().run() if event.kind == "ball_ball")
    other = whole.copy()
    other.run(until=hit + 2e-4)
    assert other.kinetic_energy < 0.9 * whole.kinetic_energy  # the rest is in the balls
    snapshot = other.snapshot()
    expected = list(other.run())
    other.restore(snapshot)
    whole.run(until=hit + 2e-4)
    assert list(other.run()) == expected == list(whole.run())
    assert other.positions.tobytes() == whole.positions.tobytes()


@pytest.mark.skipif(not COMPILED, reason="needs Numba, switched on")
@pytest.mark.parametrize("begin", [lambda: rack(5e-5, 0.002, ball_restitution=0.95, ball_friction=0.03)])
def test_interpreted_and_compiled_give_the_same_bits(
    begin: Callable[[], bs.Simulation], monkeypatch: pytest.MonkeyPatch
) -> None:
    compiled = begin()
    expected = list(compiled.run(until=0.3))
    interpreted(monkeypatch)
    simulation = begin()
    assert list(simulation.run(until=0.3)) == expected
    assert simulation.velocities.tobytes() == compiled.velocities.tobytes()


def test_rigid_scenes_have_no_room_for_elastic_contacts() -> None:
    moment = bs.Simulation(bs.scenes.head_on()).snapshot().moment
    assert len(moment.state.touches) == 0
    assert len(moment.state.stages) == 0


# In the middle of a contact


def in_mid_contact() -> bs.Simulation:
    """Two balls have touched each other and not parted yet, a third one stands by."""
    scene = bs.Scene([[0.5, 0.6], [0.6, 0.6], [1.5, 0.3]], physics=bs.Physics.pool())
    simulation = bs.Simulation(scene)
    simulation.shoot(8.0, 0.0)
    touch = next(event for event in simulation.copy().run() if event.kind == "ball_ball").time
    simulation.advance(touch - 1e-4)
    return simulation


def test_a_scene_holds_no_balls_in_mid_contact() -> None:
    simulation = in_mid_contact()
    with pytest.raises(
        ValueError, match="balls cue, 1 are in the middle of an elastic contact, which a scene cannot hold"
    ):
        simulation.scene()
    simulation.advance(1e-3)
    assert len(simulation.scene()) == 3


def test_balls_are_laid_down_beside_others_in_mid_contact() -> None:
    simulation, undisturbed = in_mid_contact(), in_mid_contact()
    simulation.place({"2": (1.6, 0.3)})
    place = simulation.positions[1] + [0.0, 2.0 * simulation.start_scene.physics.radius - 1e-4]
    with pytest.raises(ValueError, match="balls '2' and '1' overlap by 0.0001 m"):
        simulation.place({"2": place})
    undisturbed.run()
    simulation.run()
    assert np.array_equal(simulation.positions[:2], undisturbed.positions[:2])
    assert simulation.positions[2].tolist() == [1.6, 0.3]


def test_a_ball_that_is_taken_out_of_a_contact_leaves_the_impulse_so_far() -> None:
    simulation = in_mid_contact()
    simulation.place({"1": (1.5, 0.9)})
    left = simulation.velocities[0, 0]
    (event,) = [event for event in simulation.run() if event.kind == "ball_ball"]
    mass = simulation.start_scene.physics.mass
    assert event.impulse == pytest.approx(mass * (event.approach_speed - left), rel=1e-4)  # the cloth took the rest
    assert 0.0 < left < event.approach_speed
    assert simulation.positions[1] == pytest.approx([1.5, 0.9], abs=1e-15)


# Pockets


def at_rubber(part: str, speed: float, restitution: float) -> tuple[bs.Simulation, np.ndarray, np.ndarray]:
    """A ball alone 1 mm off a jaw or a point of a corner pocket, and the place and the normal of what it will meet."""
    table = replace(bs.Table.pool_9ft(), nose_height=0.5)
    edge = table.mouths[0].edges[0]
    radius = bs.Physics().radius
    if part == "jaw":
        normal = np.array(edge.normal)
        place = 0.5 * (np.array(edge.start) + edge.end)
        reach = radius
    else:
        normal = np.array(edge.middle)
        place = np.array(edge.point)
        reach = radius + table.mouths[0].pocket.point_radius
    across = np.array([-normal[1], normal[0]])
    position = place + (reach + 1e-3) * normal + table.centre
    velocity = speed * (0.5 * across - 0.75**0.5 * normal)
    physics = bs.Physics(**SOFT, rail_restitution=restitution)
    return bs.Simulation(bs.Scene([position], [velocity], table=table, physics=physics)), place + table.centre, normal


@pytest.mark.parametrize("speed", [0.1, 1.0, 5.0])
@pytest.mark.parametrize("restitution", [0.7, 1.0])
def test_a_jaw_gives_back_its_restitution_and_the_speed_along_it(speed: float, restitution: float) -> None:
    simulation, _, normal = at_rubber("jaw", speed, restitution)
    across = np.array([-normal[1], normal[0]])
    (event,) = simulation.run(until=0.003 / speed + 1e-3)
    assert event.rail is not None and "_jaw_" in event.rail
    assert simulation.velocities[0] @ normal == pytest.approx(0.75**0.5 * restitution * speed, abs=1e-6)
    assert simulation.velocities[0] @ across == pytest.approx(0.5 * speed, abs=1e-6)


@pytest.mark.parametrize("speed", [0.1, 1.0, 5.0])
@pytest.mark.parametrize("restitution", [0.7, 1.0])
def test_a_point_keeps_angular_momentum_and_gives_back_energy(speed: float, restitution: float) -> None:
    # A central force; head on its restitution is exact, and the more the ball turns about the point, the more of that.
    simulation, place, normal = at_rubber("point", speed, restitution)
    before = simulation.velocities[0]

    def turning() -> float:
        (x, y), (u, v) = simulation.positions[0] - place, simulation.velocities[0]
        return float(x * v - y * u)

    momentum = turning()
    energy = simulation.kinetic_energy
    (event,) = simulation.run(until=0.003 / speed + 1e-3)
    assert event.rail is not None and "_point_" in event.rail
    assert turning() == pytest.approx(momentum, rel=2e-5)
    if restitution == 1.0:
        assert simulation.kinetic_energy == pytest.approx(energy, rel=2e-5)
    else:
        assert 0.25 + 0.75 * restitution**2 - 1e-4 < simulation.kinetic_energy / energy < 0.25 + 0.75 * 0.75**2
    gained = event.impulse * np.array(event.normal) / simulation.start_scene.physics.mass
    assert simulation.velocities[0] - before == pytest.approx(gained, abs=1e-6 * max(speed, 1.0))
