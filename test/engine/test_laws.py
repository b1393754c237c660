# SPDX-License-Identifier: Apache-2.0
"""Impacts with restitution, friction and a high nose, spin that falls, and the cue: against closed forms, against an
independent solution in vectors, and against the laws of mechanics."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from checks import COMPILED, DATA, POOL, POOL_TABLE
from numpy.typing import NDArray
from soak import cluster
from test_copies import COPIES
from test_orientation import angle_between, quadrature

import billiards_sim as bs
from billiards_sim.engine.kernels import impact
from billiards_sim.engine.kernels.state import Ball, Constants
from billiards_sim.engine.moment import constants_of

Array = NDArray[np.float64]

EXACT: dict[str, Any] = json.loads((DATA / "laws.json").read_text(encoding="utf-8"))

FRICTION = {name: POOL[name] for name in ("ball_friction", "ball_friction_slow", "ball_friction_decay")}
RADIUS = bs.Physics().radius
AT_X_MAX, AT_Y_MAX = POOL_TABLE.x_max - RADIUS, POOL_TABLE.y_max - RADIUS
IMPACTS = 100_000
SOON = 1e-9
"""s, until when an impact at the start has happened."""


def named(cases: list[dict[str, Any]]) -> Any:
    return pytest.mark.parametrize("case", cases, ids=[case["name"] for case in cases])


def on_ice(**physics: float) -> bs.Physics:
    return bs.Physics(sliding_friction=0.0, **physics)


# The closed forms


@named(EXACT["pairs"])
def test_two_balls_rub_as_the_closed_form_says(case: dict[str, Any]) -> None:
    slow, fast, decay = case["friction"][1], case["friction"][0], case["friction"][2]
    physics = on_ice(
        mass=case["mass"],
        radius=case["radius"],
        ball_restitution=case["restitution"],
        ball_friction=fast,
        ball_friction_slow=slow,
        ball_friction_decay=decay,
    )
    place = np.array([1.0, 0.6])
    v1, w1, v2, w2 = case["before"]
    other = place + 2.0 * case["radius"] * np.array(case["direction"])
    simulation = bs.Simulation(bs.Scene([place, other], [v1[:2], v2[:2]], [w1, w2], physics=physics))
    (event,) = simulation.run(until=SOON)
    expected = [np.array(values) for values in case["after"]]
    scale_v, scale_w = (max(np.abs(expected[k]).max() for k in pair) for pair in ((0, 2), (1, 3)))
    assert simulation.velocities == pytest.approx(np.array([expected[0][:2], expected[2][:2]]), abs=1e-12 * scale_v)
    assert simulation.angular_velocities == pytest.approx(np.array([expected[1], expected[3]]), abs=1e-12 * scale_w)
    assert event.impulse == pytest.approx(
        case["mass"] * 0.5 * (1.0 + case["restitution"]) * event.approach_speed, rel=1e-12
    )
    if case["throw_deg"] is not None:
        x, y = simulation.velocities[1]
        assert math.degrees(math.atan2(y, x)) == pytest.approx(case["throw_deg"], abs=1e-9)


@named(EXACT["cushions"])
def test_cushion_gives_back_what_the_closed_form_says(case: dict[str, Any]) -> None:
    radius = case["radius"]
    physics = on_ice(
        mass=case["mass"], radius=radius, rail_restitution=case["restitution"], rail_friction=case["friction"]
    )
    table = bs.Table(nose_height=case["nose_height"] / (2.0 * radius))
    (v, w), (v_after, w_after) = case["before"], case["after"]
    simulation = bs.Simulation(bs.Scene([[1.0, table.y_max - radius]], [v], [w], table=table, physics=physics))
    (event,) = simulation.run(until=SOON)
    assert simulation.velocities[0] == pytest.approx(v_after, abs=1e-12 * np.abs(v_after).max())
    assert simulation.angular_velocities[0] == pytest.approx(w_after, abs=1e-12 * np.abs(w_after).max())
    assert event.rail == "y_max"
    assert event.approach_speed == pytest.approx(v[1], rel=1e-15)
    assert event.impulse == pytest.approx(case["mass"] * (v[1] - v_after[1]), rel=1e-12)


@named(EXACT["spins"])
def test_spin_about_the_vertical_falls_as_the_closed_form_says(case: dict[str, Any]) -> None:
    physics = bs.Physics(radius=case["radius"], gravity=case["gravity"], spin_friction=case["friction"])
    simulation = bs.Simulation(bs.Scene([[1.0, 0.6]], None, [[0.0, 0.0, case["before"]]], physics=physics))
    simulation.advance(case["duration"])
    assert simulation.angular_velocities[0, 2] == pytest.approx(case["after"], rel=1e-12)
    simulation.run()
    assert simulation.time == pytest.approx(case["stop_time"], rel=1e-12)


@named(EXACT["raised_shots"])
def test_raised_butt_curves_the_ball_as_the_closed_form_says(case: dict[str, Any]) -> None:
    physics = bs.Physics(
        mass=case["mass"],
        radius=case["radius"],
        gravity=case["g"],
        sliding_friction=case["mu_s"],
        cue_contact_time=1e-3,
    )
    start, radius, angle = np.array([2.0, 2.0]), case["radius"], math.radians(case["elevation_deg"])
    simulation = bs.Simulation(bs.Scene([start], table=bs.Table(length=5.0, width=4.0), physics=physics))
    force = case["impulse"] / physics.cue_contact_time
    simulation.strike(
        (force * math.cos(angle), 0.0, -force * math.sin(angle)),
        (case["left_over_R"] * radius, case["up_over_R"] * radius),
    )
    struck_at = simulation.positions[0]
    assert struck_at - start == pytest.approx([0.5 * case["v"][0] * physics.cue_contact_time, 0.0], rel=1e-12)
    assert simulation.velocities[0] == pytest.approx(case["v"], rel=1e-12, abs=1e-12)
    assert simulation.angular_velocities[0] == pytest.approx(case["w"], rel=1e-12, abs=1e-12)
    rolled = next(event for event in simulation.run() if event.kind == "rolling")
    assert rolled.time == pytest.approx(case["roll_time"], rel=1e-12)
    assert np.array(rolled.point) - struck_at == pytest.approx(case["roll_at"], rel=1e-12, abs=1e-14)


@named(EXACT["level_shots"])
def test_english_squirts_the_ball_as_the_closed_form_says(case: dict[str, Any]) -> None:
    physics = bs.Physics(mass=case["mass"], radius=case["radius"], cue_end_mass=case["end_mass"])
    simulation = bs.Simulation(bs.Scene([[1.0, 0.6]], physics=physics))
    force = case["mass"] * case["speed"] / physics.cue_contact_time
    simulation.strike((force, 0.0, 0.0), (case["side_over_R"] * case["radius"], 0.0))
    x, y = simulation.velocities[0]
    assert math.hypot(x, y) == pytest.approx(case["speed"], rel=1e-12)
    assert math.degrees(math.atan2(-y, x)) == pytest.approx(case["squirt_deg"], rel=1e-12, abs=1e-12)
    assert simulation.angular_velocities[0, 2] == pytest.approx(-case["spin"], rel=1e-12)


def between_two(speed: float, **physics: float) -> bs.Simulation:
    """A ball that meets two touching ones at once, both 30 degrees off its way, shortly after."""
    aside = [[2.0 * RADIUS * math.cos(math.pi / 6.0), side * RADIUS] for side in (1.0, -1.0)]
    places = np.array([1.0, 0.6]) + [[0.0, 0.0], *aside]
    still = [0.0, 0.0]
    simulation = bs.Simulation(bs.Scene(places, [[speed, 0.0], still, still], physics=on_ice(**physics)))
    simulation.run(until=SOON)
    return simulation


@named(EXACT["clusters"])
def test_cluster_without_friction_is_as_the_closed_form_says(case: dict[str, Any]) -> None:
    assert (case["radius"], case["directions_deg"]) == (RADIUS, [30, -30])
    simulation = between_two(case["speed"], mass=case["mass"], ball_restitution=case["restitution"])
    upper = np.array(case["upper_object_v"])
    assert simulation.velocities == pytest.approx(np.array([case["cue_v"], upper, upper * [1.0, -1.0]]), abs=1e-12)
    assert np.abs(simulation.angular_velocities).max() <= 1e-12


@pytest.mark.parametrize("friction", [0.0, 0.06, 0.1, 0.2, 0.8])
@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.95, 1.0])
def test_ball_between_two_touching_ones_rubs_at_both(restitution: float, friction: float) -> None:
    # J = (1 + e) sqrt(3)/5 v stops and reflects both normals. The ball then has u = v - sqrt(3) J along its way, and
    # slips by u/2 at each of the two. A tangential impulse T at both changes it by (1/2 + 1 + 5/2) T, the first as the
    # ball itself gets T along its way.
    speed = 2.0
    push = (1.0 + restitution) * math.sqrt(3.0) / 5.0 * speed
    ahead = speed - math.sqrt(3.0) * push
    slip = -0.5 * ahead
    rub = math.copysign(min(friction * push, abs(slip) / 4.0), slip)
    simulation = between_two(speed, ball_restitution=restitution, ball_friction=friction)
    normal, tangent = np.array([0.5 * math.sqrt(3.0), 0.5]), np.array([-0.5, 0.5 * math.sqrt(3.0)])
    upper = push * normal + rub * tangent
    expected = np.array([[ahead + rub, 0.0], upper, upper * [1.0, -1.0]])
    assert simulation.velocities == pytest.approx(expected, abs=1e-12)
    turn = -2.5 / RADIUS * rub
    expected = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, turn], [0.0, 0.0, -turn]])
    assert simulation.angular_velocities == pytest.approx(expected, abs=1e-10)


# Many impacts against an independent solution


def random_states(random: np.random.Generator, count: int) -> tuple[Array, Array]:
    """(count, 3) velocities along the table, m/s, and spins, rad/s, over five orders of magnitude."""
    v = random.normal(size=(count, 3)) * 10.0 ** random.uniform(-3.0, 1.0, (count, 1)) * [1.0, 1.0, 0.0]
    w = random.normal(size=(count, 3)) * 10.0 ** random.uniform(-2.0, 2.5, (count, 1))
    return v, w * (random.random((count, 1)) < 0.8)


def directions(random: np.random.Generator, count: int) -> Array:
    """(count, 3) unit, along the table."""
    angles = random.uniform(0.0, 2.0 * math.pi, count)
    return np.column_stack((np.cos(angles), np.sin(angles), np.zeros(count)))


def dot(a: Array, b: Array) -> Array:
    return np.sum(a * b, axis=1, keepdims=True)


def size(a: Array) -> Array:
    return np.linalg.norm(a, axis=1, keepdims=True)


def unit(a: Array) -> Array:
    return np.divide(a, size(a), out=np.zeros_like(a), where=size(a) > 0.0)


LEVEL = np.array([1.0, 1.0, 0.0])


class Impacts:
    """Many impacts: what was before, what the kernels make of it, (count, 3) each, and what it is by vectors."""

    def __init__(self, bodies: int) -> None:
        self.before: list[Array] = []  # velocity, spin of each body
        self.after: list[Array] = [np.empty((IMPACTS, 3)) for _ in range(2 * bodies)]
        self.expected: list[Array] = []
        self.normal = np.empty((IMPACTS, 3))  # from the first body to the other
        self.friction = np.empty((IMPACTS, 1))

    def energy(self, states: list[Array]) -> Array:
        """Twice per mass."""
        return sum(size(v) ** 2 for v in states[::2]) + 0.4 * RADIUS**2 * sum(size(w) ** 2 for w in states[1::2])

    def fastest(self) -> Array:
        """Of anything before, m/s."""
        return sum(size(v) for v in self.before[::2]) + RADIUS * sum(size(w) for w in self.before[1::2])


def ball_of(v: Array, w: Array) -> Ball:
    return Ball(vx=v[0], vy=v[1], wx=w[0], wy=w[1], wz=w[2])


def constants(seed: int) -> Iterator[tuple[Constants, dict[str, float]]]:
    """Without end, as the kernels take them, and as a user gives them."""
    random = np.random.default_rng(seed)
    while True:
        given = {
            "ball_restitution": random.uniform(0.5, 1.0),
            "ball_friction": random.choice([9.951e-3, random.uniform(0.0, 0.2)]),
            "ball_friction_slow": random.choice([0.0, 0.108]),
            "rail_restitution": random.uniform(0.5, 1.0),
            "rail_friction": random.uniform(0.0, 0.2),
            "nose_height": random.uniform(0.4, 0.8),
        }
        physics = bs.Physics(**{name: value for name, value in given.items() if name != "nose_height"})
        scene = bs.Scene([[1.0, 0.6]], physics=physics, table=bs.Table(nose_height=given["nose_height"]))
        yield constants_of(scene), given


SAME = 1000
"""Impacts with the same constants."""


@pytest.fixture(scope="module")
def pairs() -> Impacts:
    """The second ball rests in every other one."""
    random = np.random.default_rng(1)
    impacts = Impacts(2)
    v1, w1 = random_states(random, IMPACTS)
    v2, w2 = random_states(random, IMPACTS)
    v2[::2], w2[::2] = 0.0, 0.0
    normal = directions(random, IMPACTS)
    normal *= np.where(dot(v1 - v2, normal) >= 0.0, 1.0, -1.0)
    impacts.before, impacts.normal = [v1, w1, v2, w2], normal
    mu, restitution = impacts.friction, np.empty((IMPACTS, 1))
    slip = v1 - v2 - dot(v1 - v2, normal) * normal + RADIUS * np.cross(w1 + w2, normal)
    source = constants(2)
    for start in range(0, IMPACTS, SAME):
        known, given = next(source)
        for k in range(start, start + SAME):
            first, second = ball_of(v1[k], w1[k]), ball_of(v2[k], w2[k])
            nx, ny = -normal[k, 0], -normal[k, 1]
            approach = impact.approach_speed(first, second, nx, ny)
            impact.collide_pair(first, second, nx, ny, approach, known)
            for ball, v, w in ((first, *impacts.after[:2]), (second, *impacts.after[2:])):
                v[k] = ball.vx, ball.vy, ball.vz
                w[k] = ball.wx, ball.wy, ball.wz
        part = slice(start, start + SAME)
        mu[part] = given["ball_friction"] + given["ball_friction_slow"] * np.exp(-1.088 * size(slip[part]))
        restitution[part] = given["ball_restitution"]
    push = 0.5 * (1.0 + restitution) * dot(v1 - v2, normal)
    rub = -np.minimum(mu * push, size(slip) / 7.0) * unit(slip)
    turn = 2.5 / RADIUS * np.cross(normal, rub)
    impacts.expected = [(v1 - push * normal + rub) * LEVEL, w1 + turn, (v2 + push * normal - rub) * LEVEL, w2 + turn]
    return impacts


@pytest.fixture(scope="module")
def bounces() -> Impacts:
    """Off noses."""
    random = np.random.default_rng(3)
    impacts = Impacts(1)
    v, w = random_states(random, IMPACTS)
    into = directions(random, IMPACTS)
    into *= np.where(dot(v, into) >= 0.0, 1.0, -1.0)
    impacts.before, impacts.normal = [v, w], into
    expected_v, expected_w = impacts.expected = [np.empty((IMPACTS, 3)), np.empty((IMPACTS, 3))]
    source = constants(4)
    for start in range(0, IMPACTS, SAME):
        known, given = next(source)
        for k in range(start, start + SAME):
            ball = ball_of(v[k], w[k])
            impact.collide_feature(ball, -into[k, 0], -into[k, 1], known)
            impacts.after[0][k] = ball.vx, ball.vy, ball.vz
            impacts.after[1][k] = ball.wx, ball.wy, ball.wz
        part = slice(start, start + SAME)
        sine = 2.0 * given["nose_height"] - 1.0
        at_nose = -math.sqrt(1.0 - sine**2) * into[part] - sine * np.array([0.0, 0.0, 1.0])
        arm = -RADIUS * at_nose
        push = -(1.0 + given["rail_restitution"]) * dot(v[part], at_nose)
        slip = v[part] - dot(v[part], at_nose) * at_nose + np.cross(w[part], arm)
        rub = -np.minimum(given["rail_friction"] * push, 2.0 / 7.0 * size(slip)) * unit(slip)
        expected_v[part] = (v[part] + push * at_nose + rub) * LEVEL
        expected_v[part] -= np.maximum(dot(expected_v[part], into[part]), 0.0) * into[part]
        expected_w[part] = w[part] + np.cross(arm, rub) / (0.4 * RADIUS**2)
    return impacts


@pytest.mark.parametrize("kind", ["pairs", "bounces"])
def test_impacts_are_what_vectors_say(kind: str, request: pytest.FixtureRequest) -> None:
    impacts: Impacts = request.getfixturevalue(kind)
    fastest = impacts.fastest()
    for index, (after, expected) in enumerate(zip(impacts.after, impacts.expected)):
        arm = RADIUS if index % 2 else 1.0
        assert (arm * np.abs(after - expected) / fastest).max() <= 1e-14


@pytest.mark.parametrize("kind", ["pairs", "bounces"])
def test_no_impact_gains_energy(kind: str, request: pytest.FixtureRequest) -> None:
    impacts: Impacts = request.getfixturevalue(kind)
    before, after = impacts.energy(impacts.before), impacts.energy(impacts.after)
    assert (after / before).max() <= 1.0 + 2e-15
    assert np.median(after / before) < 0.999


def test_pairs_keep_their_momentum_and_turn_alike(pairs: Impacts) -> None:
    v1, w1, v2, w2 = pairs.before
    u1, x1, u2, x2 = pairs.after
    scale = pairs.fastest()
    assert (np.abs(u1 + u2 - v1 - v2) / scale).max() <= 1e-15
    assert (RADIUS * np.abs((x1 - w1) - (x2 - w2)) / scale).max() <= 1e-14
    assert np.abs(x2 - w2).max() > 10.0


def test_ball_at_rest_is_never_thrown_by_more_than_friction_allows(pairs: Impacts) -> None:
    thrown = pairs.after[2][::2]
    along = dot(thrown, pairs.normal[::2])
    aside = size(thrown - along * pairs.normal[::2])
    angles = np.arctan2(aside, along)[:, 0]
    assert (angles <= np.arctan(pairs.friction[::2, 0]) + 1e-12).all()
    assert (angles >= 0.99 * np.arctan(pairs.friction[::2, 0])).sum() > 1000


def random_throws(count: int, **physics: float) -> tuple[Array, Array, Array, Array]:
    """A ball at rest on the x axis is met: velocity and spin of the other before, its velocity and spin after."""
    random = np.random.default_rng(6)
    v, w = random_states(random, count)
    v[:, 0] = np.abs(v[:, 0])
    known = constants_of(bs.Scene([[1.0, 0.6]], physics=bs.Physics(**physics)))
    object_v, object_w = np.empty((count, 2)), np.empty((count, 3))
    for k in range(count):
        cue, ball = ball_of(v[k], w[k]), Ball()
        impact.collide_pair(cue, ball, -1.0, 0.0, cue.vx, known)
        object_v[k] = ball.vx, ball.vy
        object_w[k] = ball.wx, ball.wy, ball.wz
    return v, w, object_v, object_w


def test_throw_with_measured_friction_is_at_most_6_73_degrees() -> None:
    v, _, object_v, _ = random_throws(IMPACTS, ball_restitution=1.0, **FRICTION)
    throw = np.degrees(np.arctan2(object_v[:, 1], object_v[:, 0]))
    assert np.abs(throw).max() <= 6.73
    assert np.abs(throw).max() > 6.0
    assert (object_v[:, 0] == v[:, 0]).all()  # with restitution 1


def test_spin_passes_to_the_other_ball_in_the_opposite_sense() -> None:
    random = np.random.default_rng(7)
    known = constants_of(bs.Scene([[1.0, 0.6]], physics=bs.Physics(**POOL)))
    speeds = 10.0 ** random.uniform(-2.0, 1.0, 1000)
    for speed, (side, top) in zip(speeds, random.normal(0.0, 60.0, (1000, 2))):
        cue, ball = Ball(vx=speed, wy=top, wz=side), Ball()
        impact.collide_pair(cue, ball, -1.0, 0.0, speed, known)
        assert ball.wz * side < 0.0
        assert ball.wy * top < 0.0
        assert abs(cue.wz) < abs(side)
        assert abs(cue.wy) < abs(top)


def test_gearing_english_throws_nothing() -> None:
    random = np.random.default_rng(8)
    known = constants_of(bs.Scene([[1.0, 0.6]], physics=bs.Physics(**POOL)))
    for speed, aside in zip(10.0 ** random.uniform(-2, 1, 1000), random.normal(size=1000)):
        cue, ball = Ball(vx=speed, vy=aside, wz=-aside / RADIUS), Ball()
        impact.collide_pair(cue, ball, -1.0, 0.0, speed, known)
        assert abs(ball.vy) <= 1e-15 * (speed + abs(aside))
        assert RADIUS * abs(ball.wz) <= 1e-15 * (speed + abs(aside))


@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.9, 0.95, 0.98, 1.0])
def test_head_on_stun_keeps_half_of_what_restitution_lacks(restitution: float) -> None:
    known = constants_of(bs.Scene([[1.0, 0.6]], physics=bs.Physics(**{**POOL, "ball_restitution": restitution})))
    for speed in 10.0 ** np.random.default_rng(9).uniform(-3, 1, 300):
        cue, ball = Ball(vx=speed), Ball()
        impact.collide_pair(cue, ball, -1.0, 0.0, speed, known)
        assert cue.vx == pytest.approx(0.5 * (1.0 - restitution) * speed, rel=1e-12, abs=1e-15 * speed)
        assert ball.vx == pytest.approx(0.5 * (1.0 + restitution) * speed, rel=1e-15)
        assert (cue.vy, cue.wx, cue.wy, cue.wz) == (0.0, 0.0, 0.0, 0.0)


# Clusters

CLUSTERS = 150 if COMPILED else 20


def cluster_scene(seed: int, rails: bool) -> bs.Scene:
    """2 to 16 touching balls, at a rail or free, with any velocities, spins, restitutions, frictions and noses."""
    random = np.random.default_rng(seed)
    places = np.empty((0, 2))
    table = bs.Table(nose_height=float(random.choice([0.4, 0.5, 0.635, 0.8])))
    low = np.array([table.x_min, table.y_min]) + RADIUS + 1e-9
    high = np.array([table.x_max, table.y_max]) - RADIUS - 1e-9
    while not 2 <= len(places) <= 16 or bool(((places < low) | (places > high)).any()) != rails:
        places = cluster(random)
    v = random.normal(size=places.shape) * random.choice([0.01, 1.0, 5.0])
    v[random.random(len(places)) < 0.3] = 0.0
    w = random.normal(size=(len(places), 3)) * random.choice([0.0, 30.0, 150.0])
    physics = on_ice(
        ball_restitution=float(random.choice([0.5, 0.8, 0.95, 1.0])),
        ball_friction=float(random.choice([0.0, 0.05, 0.1])),
        ball_friction_slow=float(random.choice([0.0, 0.1])),
        rail_restitution=float(random.choice([0.5, 0.7, 0.85, 1.0])),
        rail_friction=float(random.choice([0.0, 0.1, 0.2])),
    )
    return bs.Scene(places, v, w, table=table, physics=physics)


def struck(scene: bs.Scene) -> tuple[bs.Simulation, list[bs.Event]]:
    """After the impacts at the start."""
    simulation = bs.Simulation(scene)
    return simulation, list(simulation.run(until=SOON))


@pytest.mark.parametrize("rails", [False, True], ids=["free", "at rails"])
def test_clusters_gain_no_energy_and_keep_momentum(rails: bool) -> None:
    met = 0
    for seed in range(CLUSTERS):
        scene = cluster_scene(seed, rails)
        before = bs.Simulation(scene)
        after, events = struck(scene)
        met += len(events)
        assert after.kinetic_energy <= before.kinetic_energy * (1.0 + 1e-14), seed
        if not rails:
            assert after.velocities.sum(axis=0) == pytest.approx(before.velocities.sum(axis=0), abs=1e-13), seed
    assert met > 3 * CLUSTERS


@pytest.mark.parametrize("rails", [False, True], ids=["free", "at rails"])
def test_clusters_do_not_depend_on_the_order_of_the_balls(rails: bool) -> None:
    for seed in range(CLUSTERS):
        scene = cluster_scene(seed, rails)
        order = np.random.default_rng(seed).permutation(len(scene))
        shuffled = replace(
            scene,
            positions=scene.positions[order],
            velocities=scene.velocities[order],
            angular_velocities=scene.angular_velocities[order],
            names=[scene.names[k] for k in order],
        )
        one, other = struck(scene)[0], struck(shuffled)[0]
        assert other.velocities == pytest.approx(one.velocities[order], abs=1e-12), seed
        assert RADIUS * other.angular_velocities == pytest.approx(RADIUS * one.angular_velocities[order], abs=1e-12)


def mirrored(scene: bs.Scene, along: int) -> bs.Scene:
    """As seen in a mirror across the middle of the table."""
    signs, spins = np.array([1.0, 1.0]), np.array([-1.0, -1.0, -1.0])
    signs[along], spins[along] = -1.0, 1.0
    centre = np.array(scene.table.centre)
    return replace(
        scene,
        positions=(scene.positions - centre) * signs + centre,
        velocities=scene.velocities * signs,
        angular_velocities=scene.angular_velocities * spins,
    )


def transposed(scene: bs.Scene) -> bs.Scene:
    """As seen in a mirror along the diagonal."""
    table = replace(scene.table, length=scene.table.width, width=scene.table.length)
    velocities, spins = scene.velocities[:, ::-1], -scene.angular_velocities[:, (1, 0, 2)]
    return replace(
        scene, positions=scene.positions[:, ::-1], velocities=velocities, angular_velocities=spins, table=table
    )


MIRRORS = {"x": partial(mirrored, along=0), "y": partial(mirrored, along=1), "xy": transposed}


@pytest.mark.parametrize("rails", [False, True], ids=["free", "at rails"])
@pytest.mark.parametrize("mirror", MIRRORS.values(), ids=MIRRORS)
def test_clusters_keep_mirror_symmetry(mirror: Callable[[bs.Scene], bs.Scene], rails: bool) -> None:
    for seed in range(CLUSTERS):
        scene = cluster_scene(seed, rails)
        seen = mirror(scene)
        expected = mirror(struck(scene)[0].scene())
        got = struck(seen)[0]
        assert got.velocities == pytest.approx(expected.velocities, abs=1e-12), seed
        assert RADIUS * got.angular_velocities == pytest.approx(RADIUS * expected.angular_velocities, abs=1e-12), seed


def test_ball_straight_into_a_corner_comes_straight_back() -> None:
    speed = 1.0
    scene = bs.Scene(
        [[AT_X_MAX, AT_Y_MAX]],
        [[speed, speed]],
        [[-20.0, 20.0, 0.0]],
        table=POOL_TABLE,
        physics=on_ice(rail_restitution=0.85, rail_friction=0.2),
    )
    simulation, events = struck(scene)
    x, y = simulation.velocities[0]
    assert x == pytest.approx(y, rel=1e-14)
    assert x < -0.3 * speed
    assert [event.rail for event in events] == ["x_max", "y_max"]


def test_ball_along_a_rail_meets_the_next_as_if_alone() -> None:
    velocity, spin = [[1.5, 0.0]], [[3.0, 10.0, 40.0]]
    physics = on_ice(rail_restitution=0.85, rail_friction=0.2)
    (along, (met,)), (alone, (expected,)) = (
        struck(bs.Scene([[AT_X_MAX, y]], velocity, spin, table=POOL_TABLE, physics=physics))
        for y in (AT_Y_MAX, AT_Y_MAX - 0.1)
    )
    assert along.velocities == pytest.approx(alone.velocities, rel=1e-13)
    assert along.angular_velocities == pytest.approx(alone.angular_velocities, rel=1e-13)
    assert (met.rail, met.approach_speed) == (expected.rail, expected.approach_speed) == ("x_max", 1.5)
    assert met.impulse == pytest.approx(expected.impulse, rel=1e-13)


# Spin that falls


def spinning(*spins: float, **physics: float) -> bs.Scene:
    """Resting balls that spin about the vertical, 10 rad/s^2 slower a second."""
    friction = 10.0 * 2.0 * RADIUS / (5.0 * 9.81)
    places = [[0.5 + 0.3 * k, 0.6] for k in range(len(spins))]
    known = bs.Physics(**{"spin_friction": friction, **physics})
    return bs.Scene(places, None, [[0.0, 0.0, spin] for spin in spins], physics=known)


def test_table_is_at_rest_when_the_last_spin_has_ended() -> None:
    simulation = bs.Simulation(spinning(30.0, -50.0, 10.0))
    assert not simulation.at_rest
    simulation.advance(4.999999)
    assert not simulation.at_rest
    assert simulation.angular_velocities[:, 2] == pytest.approx([0.0, -1e-5, 0.0], abs=1e-12)
    simulation.advance(0.000002)
    assert simulation.at_rest
    simulation = bs.Simulation(spinning(30.0, -50.0, 10.0))
    assert list(simulation.run()) == []
    assert simulation.time == pytest.approx(5.0, rel=1e-12)
    assert simulation.at_rest
    assert not simulation.angular_velocities.any()
    stopped = simulation.time
    simulation = bs.Simulation(spinning(30.0, -50.0, 10.0))
    simulation.run(until=math.nextafter(stopped, 0.0))
    assert not simulation.at_rest


def test_run_ends_with_the_last_event_where_spin_has_ended_before() -> None:
    scene = replace(spinning(5.0, 0.0), velocities=[[0.0, 0.0], [0.5, 0.0]])
    simulation = bs.Simulation(scene)
    events = simulation.run()
    assert events[-1].kind == "rest"
    assert simulation.time == events[-1].time
    assert simulation.at_rest


def test_run_ends_where_nothing_ever_spins_about_the_vertical() -> None:
    simulation = bs.Simulation(replace(spinning(0.0), velocities=[[0.5, 0.0]]))
    events = simulation.run()
    assert simulation.time == events[-1].time > 0.5


def test_spin_ends_also_on_a_cloth_that_stops_nothing_else() -> None:
    simulation = bs.Simulation(spinning(20.0, sliding_friction=0.0))
    simulation.run()
    assert simulation.time == pytest.approx(2.0, rel=1e-12)


def test_without_friction_a_ball_that_spins_on_the_spot_rests() -> None:
    simulation = bs.Simulation(spinning(20.0, spin_friction=0.0))
    assert simulation.at_rest
    simulation.run()
    assert (simulation.time, simulation.angular_velocities[0, 2]) == (0.0, 20.0)


@pytest.mark.parametrize("wait", [True, False])
def test_spin_that_has_ended_does_not_come_back_with_the_next_shot(wait: bool) -> None:
    simulation = bs.Simulation(spinning(50.0, 0.0, 0.0))
    if wait:
        simulation.advance(7.0)
    else:
        simulation.run()
    simulation.strike((20.0, 0.0, 0.0), ball="2")
    assert not simulation.angular_velocities[:2].any()
    simulation.advance(0.1)
    assert not simulation.angular_velocities[:2].any()


def test_shot_at_one_ball_leaves_the_spin_of_another() -> None:
    simulation = bs.Simulation(spinning(50.0, 0.0, 40.0))
    simulation.advance(1.0)
    simulation.strike((0.0, 8.0, 0.0), (0.3 * RADIUS, 0.0), ball="1")
    struck = simulation.angular_velocities[1, 2]
    assert struck < -10.0
    simulation.advance(0.5)
    assert simulation.angular_velocities[:, 2] == pytest.approx([35.0, struck + 5.0, 25.0], rel=1e-12)


def test_struck_ball_keeps_what_is_left_of_its_spin() -> None:
    offset = 0.3 * RADIUS
    turns = []
    for spin in (0.0, 50.0):
        simulation = bs.Simulation(spinning(spin))
        simulation.advance(2.0)
        simulation.strike((8.0, 0.0, 0.0), (offset, 0.0))
        turns.append(simulation.angular_velocities[0, 2])
    assert turns[1] - turns[0] == pytest.approx(30.0, rel=1e-12)


def test_energy_falls_by_the_work_of_the_drilling_torque() -> None:
    scene = spinning(50.0)
    simulation = bs.Simulation(scene)
    before = simulation.kinetic_energy
    simulation.advance(3.0)
    angle = 50.0 * 3.0 - 0.5 * 10.0 * 3.0**2
    torque = scene.physics.spin_friction * scene.physics.mass * scene.physics.gravity * RADIUS
    assert before - simulation.kinetic_energy == pytest.approx(torque * angle, rel=1e-12)


def test_rolling_does_not_hold_up_spin_about_the_vertical() -> None:
    scene = replace(spinning(50.0), velocities=[[1.0, 0.0]])
    simulation = bs.Simulation(scene)
    for time in (0.05, 0.3, 1.0, 2.0):  # slides, rolls
        simulation.run(until=time)
        assert simulation.angular_velocities[0, 2] == pytest.approx(50.0 - 10.0 * time, rel=1e-12)


def pool_scene(seed: int, count: int = 8) -> bs.Scene:
    """Balls that move and spin, with every effect."""
    base = bs.scenes.random_balls(count, seed)
    spins = np.random.default_rng(seed).normal(0.0, 60.0, (count, 3))
    return replace(base, angular_velocities=spins, physics=bs.Physics(**POOL), table=POOL_TABLE)


@pytest.mark.parametrize("seed", range(6))
def test_pieces_give_the_bits_of_one_run(seed: int) -> None:
    scene = replace(pool_scene(seed), track_orientation=seed % 2 == 0)
    whole, pieces = bs.Simulation(scene), bs.Simulation(scene)
    events = whole.run()
    collected: list[bs.Event] = []
    for duration in np.random.default_rng(seed).exponential(0.1, 40):
        collected += pieces.advance(float(duration))
        assert pieces.at_rest == (pieces.kinetic_energy == 0.0)  # looking changes nothing
    collected += pieces.run()
    assert collected == list(events)
    assert pieces.time == whole.time
    assert pieces.positions.tobytes() == whole.positions.tobytes()
    assert pieces.angular_velocities.tobytes() == whole.angular_velocities.tobytes()
    if scene.track_orientation:
        assert pieces.orientations.tobytes() == whole.orientations.tobytes()


@pytest.mark.parametrize("copied", [bs.Simulation.copy, *COPIES])
@pytest.mark.parametrize(
    "scene, moment", [(pool_scene(3), 0.3), (spinning(400.0, 0.0), 9.0)], ids=["moving", "spinning"]
)
def test_copies_and_snapshots_go_on_with_the_same_spin(
    copied: Callable[[Any], Any], scene: bs.Scene, moment: float
) -> None:
    simulation = bs.Simulation(replace(scene, track_orientation=True))
    simulation.run(until=moment)
    assert np.abs(simulation.angular_velocities[:, 2]).max() > 10.0
    twin, snapshot = copied(simulation), simulation.snapshot()
    if copied in COPIES:
        snapshot = copied(snapshot)

    def end(of: bs.Simulation) -> tuple[Any, ...]:
        of.run()
        return of.time, of.positions.tobytes(), of.angular_velocities.tobytes(), of.orientations.tobytes()

    expected = end(simulation)
    assert end(twin) == expected
    simulation.restore(snapshot)
    assert simulation.time == moment
    assert end(simulation) == expected


@pytest.mark.parametrize("velocity, spin", [([2.0, 0.4], [60.0, -90.0, 12.0]), ([0.0, 0.0], [0.0, 0.0, 12.0])])
def test_orientation_follows_spin_through_its_end(velocity: list[float], spin: list[float]) -> None:
    duration = 0.3
    friction = 2.0 * RADIUS / (5.0 * 9.81) * 60.0  # its end comes after 0.2 s
    scene = bs.Scene([[0.5, 0.6]], [velocity], [spin], physics=bs.Physics(spin_friction=friction))
    simulation = bs.Simulation(replace(scene, track_orientation=True))
    simulation.run(until=duration)
    assert simulation.angular_velocities[0, 2] == 0.0
    coarse, fine = (quadrature(scene, duration, steps) for steps in (3000, 6000))
    assert angle_between(coarse, fine) < 1e-5
    assert angle_between(simulation.orientations, fine) <= angle_between(coarse, fine) / 3.0 + 1e-6 * duration
    alike = bs.Simulation(replace(scene, physics=bs.Physics(), track_orientation=True))
    alike.run(until=duration)
    assert angle_between(simulation.orientations, alike.orientations) > 0.1


def test_ball_that_spins_to_its_end_has_turned_by_half_its_spin_times_the_time() -> None:
    simulation = bs.Simulation(replace(spinning(7.0), track_orientation=True))
    simulation.run()
    half = 0.5 * 0.5 * 7.0 * 0.7
    assert angle_between(simulation.orientations, np.array([[0.0, 0.0, math.sin(half), math.cos(half)]])) <= 1e-14


@pytest.mark.parametrize("seed", range(3))
def test_recording_knows_spin_that_falls(seed: int) -> None:
    scene = replace(pool_scene(seed), track_orientation=True)
    simulation = bs.Simulation(scene)
    simulation.run(until=0.2)
    run = bs.record(simulation)
    assert run.end == simulation.time
    assert simulation.at_rest
    alike = bs.Simulation(scene)
    for time in np.linspace(0.2, run.end, 40):
        alike.run(until=float(time))
        assert run.angular_velocities([time])[0].tobytes() == alike.angular_velocities.tobytes()
        assert run.positions([time])[0].tobytes() == alike.positions.tobytes()
        assert angle_between(run.orientations([time])[0], alike.orientations) <= 1e-7 * time


def test_recording_of_spin_alone_lasts_until_it_has_ended() -> None:
    run = bs.record(bs.Simulation(spinning(50.0, 0.0)))
    assert run.end == pytest.approx(5.0, rel=1e-12)
    assert run.angular_velocities([0.0, 2.0, run.end])[:, 0, 2] == pytest.approx([50.0, 30.0, 0.0], abs=1e-12)


def test_effects_given_as_off_change_no_bit() -> None:
    off = {"ball_restitution": 1.0, "ball_friction": 0.0, "ball_friction_slow": 0.0, "rail_friction": 0.0}
    off |= {"spin_friction": 0.0, "cue_end_mass": 0.0, "miscue_limit": 1.0}
    rack = bs.scenes.rack(0.0)
    explicit = replace(rack, physics=bs.Physics(ball_friction_decay=3.0, **off), table=bs.Table(nose_height=0.5))
    states = []
    for scene in (rack, explicit):
        simulation = bs.Simulation(scene)
        simulation.strike((128.0, 2.0, 0.0), (0.006, 0.004))
        events = simulation.run()
        states.append((list(events), simulation.positions.tobytes(), simulation.angular_velocities.tobytes()))
    assert states[0] == states[1]


# Hard cases


@pytest.mark.parametrize("nose_height", [0.3, 0.4, 0.5, 0.635, 0.8])
@pytest.mark.parametrize("restitution", [0.0, 0.3, 0.85, 1.0])
@pytest.mark.parametrize("friction", [0.0, 0.2, 1.0])
def test_ball_leaves_the_nose_whatever_it_is_like(nose_height: float, restitution: float, friction: float) -> None:
    table = bs.Table(nose_height=nose_height)
    physics = bs.Physics(rail_restitution=restitution, rail_friction=friction, spin_friction=0.01)
    for top in (-1000.0, 0.0, 1000.0):
        scene = bs.Scene([[2.0, 0.6]], [[3.0, 0.4]], [[0.0, top, 100.0]], table=table, physics=physics)
        simulation = bs.Simulation(scene)
        energy = simulation.kinetic_energy
        bounce = next(event for event in simulation.run(until=4.0) if event.kind == "ball_rail")
        simulation = bs.Simulation(scene)
        simulation.run(until=bounce.time)
        assert simulation.velocities[0] @ bounce.normal >= 0.0
        events = simulation.run()
        assert len(events) < 100
        assert simulation.at_rest
        assert simulation.kinetic_energy < energy
        same_instant = [event for event in events if event.time == bounce.time]
        assert len(same_instant) <= 1  # stays there


@pytest.mark.parametrize("spin", [-40.0, 0.0, 15.0, 300.0])
def test_ball_rubs_at_a_rail_that_gives_nothing_back(spin: float) -> None:
    # Much topspin presses it at once. It is stopped by v, and rubs by min(mu v, 2/7 s) against the slip s.
    speed, along = 1.0, 0.6
    top = 15.0 * speed / RADIUS
    physics = bs.Physics(rail_restitution=0.0, rail_friction=0.2)
    scene = bs.Scene([[AT_X_MAX, 0.6]], [[speed, along]], [[0.0, top, spin]], physics=physics)
    simulation, events = struck(scene)
    slip_along, slip_up = along + RADIUS * spin, -RADIUS * top
    slip = math.hypot(slip_along, slip_up)
    part = min(2.0 / 7.0, 0.2 * speed / slip)
    assert [event.kind for event in events] == ["ball_rail"]
    assert simulation.velocities[0] == pytest.approx([0.0, along - part * slip_along], abs=1e-8)
    expected = [0.0, top + 2.5 / RADIUS * part * slip_up, spin - 2.5 / RADIUS * part * slip_along]
    assert simulation.angular_velocities[0] == pytest.approx(expected, abs=1e-5)


def test_nose_at_the_height_of_the_centre_without_friction_is_a_wall() -> None:
    scene = bs.Scene([[2.0, 0.6]], [[3.0, 0.4]], [[0.0, 200.0, 100.0]])
    ends = []
    for friction in (0.0, 1e-15):
        simulation = bs.Simulation(replace(scene, physics=bs.Physics(rail_friction=friction)))
        simulation.run(until=0.5)
        ends.append(simulation.velocities)
    assert ends[0] == pytest.approx(ends[1], abs=1e-13)


@pytest.mark.parametrize("aside", [1e-3, 1e-6, 1e-9, 1e-12])
def test_grazing_impacts_rub_little(aside: float) -> None:
    # The balls miss each other by `aside` diameters less than they would have to: approach v sqrt(2 aside).
    distance = 2.0 * RADIUS * (1.0 - aside)
    physics = on_ice(**{name: POOL[name] for name in (*FRICTION, "ball_restitution")})
    scene = bs.Scene([[1.0, 0.6], [1.2, 0.6 + distance]], [[3.0, 0.0], [0.0, 0.0]], physics=physics)
    simulation = bs.Simulation(scene)
    (event,) = simulation.run(until=0.1)
    approach = 3.0 * math.sqrt(1.0 - (1.0 - aside) ** 2)
    assert event.approach_speed == pytest.approx(approach, rel=1e-4)
    push = 0.5 * 1.95 * event.approach_speed
    assert np.hypot(*simulation.velocities[1]) <= push * math.hypot(1.0, 9.951e-3 + 0.108)
    assert 0.0 < abs(simulation.angular_velocities[1, 2]) <= 2.5 / RADIUS * (9.951e-3 + 0.108) * push


@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.95])
def test_push_of_touching_balls_does_not_depend_on_their_restitution(restitution: float) -> None:
    ends = []
    for e in (1.0, restitution):
        physics = bs.Physics(**{**POOL, "ball_restitution": e})
        scene = bs.Scene([[0.8, 0.6], [0.8 + 2.0 * RADIUS, 0.6]], None, [[0.0, 100.0, 0.0], [0.0] * 3], physics=physics)
        simulation = bs.Simulation(scene)
        simulation.run(until=0.3)
        assert simulation.positions[1, 0] > 0.8 + 2.0 * RADIUS + 0.01
        ends.append(simulation.positions)
    assert ends[0] == pytest.approx(ends[1], abs=1e-9)


@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.9, 0.95, 0.99])
@pytest.mark.parametrize("gap", [0.0, 1e-9, 1e-5, 1e-3])
def test_balls_that_friction_presses_stop_bouncing(restitution: float, gap: float) -> None:
    physics = bs.Physics(**{**POOL, "ball_restitution": restitution})
    scene = bs.Scene(
        [[0.8, 0.6], [0.8 + 2.0 * RADIUS + gap, 0.6]],
        None,
        [[0.0, 200.0, 50.0], [0.0, 0.0, 0.0]],
        physics=physics,
        table=POOL_TABLE,
    )
    simulation = bs.Simulation(scene)
    assert len(simulation.run()) < 300
    assert simulation.at_rest


@pytest.mark.parametrize("speed", [0.5, 8.0])
@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.95])
@pytest.mark.parametrize("gap", [0.0, 1e-4])
def test_break_with_every_effect_ends(gap: float, restitution: float, speed: float) -> None:
    physics = bs.Physics(**{**POOL, "ball_restitution": restitution})
    rack = bs.scenes.rack(gap)
    simulation = bs.Simulation(replace(rack, physics=physics, table=POOL_TABLE))
    simulation.shoot(speed, 0.01, side=0.3, up=0.2)
    energy = simulation.kinetic_energy
    events = simulation.run()
    assert len(events) < 5000
    assert simulation.at_rest
    assert simulation.kinetic_energy < energy
    apart = simulation.positions[:, np.newaxis] - simulation.positions
    one, other = np.triu_indices(16, 1)
    assert np.hypot(apart[..., 0], apart[..., 1])[one, other].min() >= 2.0 * RADIUS - 1e-9


def test_symmetric_break_with_every_effect_stays_symmetric() -> None:
    rack = bs.scenes.rack(0.0)
    axis = rack.table.centre[1]
    mirror = [
        int(np.argmin(np.hypot(rack.positions[:, 0] - x, rack.positions[:, 1] - (2.0 * axis - y))))
        for x, y in rack.positions
    ]
    simulation = bs.Simulation(replace(rack, physics=bs.Physics(**POOL), table=POOL_TABLE))
    simulation.shoot(8.0, 0.0)
    simulation.run(until=0.5)
    assert np.abs(simulation.velocities).max() > 0.5
    reflected = simulation.positions[mirror] * [1.0, -1.0] + [0.0, 2.0 * axis]
    assert simulation.positions == pytest.approx(reflected, abs=1e-9)
    assert simulation.angular_velocities[:, 2] == pytest.approx(-simulation.angular_velocities[mirror, 2], abs=1e-6)
