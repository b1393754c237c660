# SPDX-License-Identifier: Apache-2.0
"""Pockets in play: what a ball meets in them, and how it falls. Against an outline and a search of their own."""

from __future__ import annotations

import json
import math
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from checks import COMPILED, DATA
from pocket_checks import (
    POOL,
    TABLES,
    corner_of,
    first_met,
    gap,
    mouth_scene,
    outline,
    path_of,
    pocket_extremes,
    random_shot,
)

import billiards_sim as bs
from billiards_sim.study.pool import FIRST_EVENTS as FILE

POOL_9FT = bs.Table.pool_9ft()
RADIUS = POOL.radius
X_MIN, Y_MIN = POOL_9FT.x_min, POOL_9FT.y_min


def reference(path: Path) -> list[dict[str, Any]]:
    cases: list[dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))["cases"]
    return cases


FIRST_EVENTS = reference(FILE)


def part_named(feature: str) -> str:
    """The name of a part in the file of references, as events have it."""
    words = feature.replace("low_x", "x_min").replace("high_x", "x_max")
    words = words.replace("low_y", "y_min").replace("high_y", "y_max")
    if words.startswith("corner "):
        pocket, _, nose = words[len("corner ") :].partition(" on ")
        return f"{pocket}_jaw_{pocket[6:] if nose == 'x-nose' else pocket[:5]}" if nose else pocket
    if words.startswith("side "):
        return words[len("side ") :]
    return words[-5:] if words.startswith("along x, ") else words[len("along y, ") :]


def pool_scene(position: Any, velocity: Any = (0.0, 0.0), spin: Any = (0.0, 0.0, 0.0), **more: Any) -> bs.Scene:
    """One ball on the 9 ft table, from the corner of the noses."""
    return bs.Scene(
        [[X_MIN + position[0], Y_MIN + position[1]]], [velocity], [spin], table=more.pop("table", POOL_9FT), **more
    )


def rolling(velocity: tuple[float, float]) -> tuple[float, float, float]:
    return -velocity[1] / RADIUS, velocity[0] / RADIUS, 0.0


def collisions(events: Any) -> list[bs.Event]:
    return [event for event in events if event.kind in ("ball_ball", "ball_rail", "pocketed")]


def said(event: bs.Event) -> str:
    """What an event is with."""
    return event.rail or event.pocket or event.balls[-1]


def rest(simulation: bs.Simulation) -> tuple[Any, ...]:
    events = list(simulation.run())
    return events, simulation.time, simulation.positions.tobytes(), simulation.in_play.tolist()


def test_the_parts_of_a_pool_table_are_where_the_reference_has_them() -> None:
    (case,) = reference(DATA / "pocket_geometry.json")
    centre = np.array([0.5 * 2.54, 0.5 * 1.27])
    jaws = sorted(tuple(np.add(end, centre)) for m in POOL_9FT.mouths for e in m.edges for end in (e.start, e.end))
    points = sorted(tuple(np.add(e.point, centre)) for m in POOL_9FT.mouths for e in m.edges)
    captures = sorted(tuple(np.add(m.centre, centre)) for m in POOL_9FT.mouths)
    expected = case["output"]
    assert len(jaws) == 24
    assert np.allclose(jaws, sorted(tuple(jaw[end]) for jaw in expected["jaws"] for end in "ab"), rtol=0.0, atol=1e-14)
    assert np.allclose(points, sorted(tuple(point["c"]) for point in expected["points"]), rtol=0.0, atol=1e-14)
    assert np.allclose(captures, sorted(tuple(c["c"]) for c in expected["captures"]), rtol=0.0, atol=1e-14)
    assert {mouth.name: mouth.pocket.slate_radius for mouth in POOL_9FT.mouths} == {
        part_named(capture["name"]): capture["r"] for capture in expected["captures"]
    }


def test_noses_end_where_points_begin() -> None:
    (case,) = reference(DATA / "pocket_geometry.json")
    for nose in case["output"]["noses"]:
        for end, other in ("ab", "ba"):
            place, along = np.array(nose[end]), np.subtract(nose[other], nose[end])
            along /= np.hypot(*along)
            inward = np.array([0.635 if abs(along[0]) < 0.5 else 0.0, 0.3 if abs(along[0]) > 0.5 else 0.0])
            inward = np.where(place + inward > [2.54, 1.27], -inward, inward)
            for beside, name in ((1e-9, ""), (-1e-9, "_point_")):
                start = place + beside * along + inward
                event = collisions(bs.Simulation(pool_scene(start, -3.0 * inward)).advance(1.0))[0]
                assert event.kind == "ball_rail"
                assert ("point" in said(event)) == bool(name)


@pytest.mark.parametrize("case", FIRST_EVENTS, ids=[case["name"] for case in FIRST_EVENTS])
def test_a_ball_meets_first_what_the_reference_says(case: dict[str, Any]) -> None:
    given, expected = case["input"], case["output"]
    spin = rolling(given["velocity"]) if given["phase"] == "roll" else (0.0, 0.0, 0.0)
    scene = pool_scene(given["position"], given["velocity"], spin)
    event = collisions(bs.Simulation(scene).run())[0]
    assert event.kind == ("pocketed" if expected["kind"] == "capture" else "ball_rail")
    assert said(event) == part_named(expected["feature"])
    assert event.time == pytest.approx(expected["time"], abs=1e-11, rel=0.0)
    centre = np.array(event.point) + RADIUS * np.array(event.normal) - [X_MIN, Y_MIN]
    assert centre == pytest.approx(np.array(expected["centre"]), abs=1e-11, rel=0.0)


@pytest.mark.parametrize("name", TABLES)
def test_first_events_are_those_of_a_search_by_samples(name: str) -> None:
    table, physics = TABLES[name]
    shape, kinds = outline(table), set()
    random = np.random.default_rng(7)
    for _ in range(200 if COMPILED else 30):
        scene = random_shot(random, table, physics)
        start = complex(*scene.positions[0]) - corner_of(table)
        at, end = path_of((start.real, start.imag), scene.velocities[0], scene.angular_velocities[0], physics)
        expected = first_met(shape, at, end, physics.radius)
        found = collisions(bs.Simulation(scene).run())[:1]
        if expected is None:
            assert found == []
            continue
        away = gap(shape, at(np.array([found[0].time])), physics.radius)
        assert abs(found[0].time - expected[1]) <= 1e-11
        said_name = next(key for key in away if key == said(found[0]) or key[:-2] == said(found[0]))
        assert abs(min(value[0] for key, value in away.items() if key.startswith(said(found[0])))) < 1e-11, said_name
        kinds.add(found[0].kind + ("_part" if len(said(found[0])) > 11 else ""))
    assert kinds == {"ball_rail", "ball_rail_part", "pocketed"}


@pytest.mark.parametrize("name", TABLES)
def test_no_ball_leaves_the_table_but_into_a_pocket(name: str) -> None:
    table, physics = TABLES[name]
    shape, random = outline(table), np.random.default_rng(11)
    pocketed = in_mouths = 0
    for _ in range(3500 if COMPILED else 100):
        scene = random_shot(random, table, physics)
        simulation = bs.Simulation(scene)
        events = simulation.run()
        assert simulation.at_rest
        kinds = [event.kind for event in events]
        assert kinds.count("pocketed") == (0 if simulation.in_play[0] else 1)
        place = complex(*simulation.positions[0]) - corner_of(table)
        if not simulation.in_play[0]:
            assert kinds[-1] == "pocketed"
            assert abs(place - shape.captures[events[-1].pocket or ""][0]) < 1e-15
            pocketed += 1
            continue
        assert min(away.min() for away in gap(shape, np.array([place]), physics.radius).values()) > -1e-12
        room = min(place.real, table.length - place.real, place.imag, table.width - place.imag)
        if room < physics.radius - 1e-12:
            assert any(abs(place - centre) < 0.15 for centre, _ in shape.captures.values())
            in_mouths += 1
    assert pocketed > 0
    assert in_mouths > 0 or not COMPILED


@pytest.mark.parametrize("first", range(0, 100, 10))
def test_balls_in_mouths_keep_the_laws_until_rest(first: int) -> None:
    for seed in range(first, first + (10 if COMPILED else 1)):
        worst = pocket_extremes(bs.Simulation(mouth_scene(seed)))
        assert worst.overlap <= 1e-9, seed
        assert worst.outside <= 1e-9, seed
        assert worst.fallen <= 1e-9, seed
        assert worst.energy_rise <= 1e-12, seed
        assert worst.events <= 2000, seed


def test_breaks_keep_the_laws_until_rest() -> None:
    pocketed = 0
    for seed in range(12 if COMPILED else 1):
        simulation = bs.Simulation(bs.scenes.rack(0.0, table=POOL_9FT, physics=POOL))
        simulation.shoot(7.0 + 0.25 * seed, 0.0025 * seed, side=0.2)
        worst = pocket_extremes(simulation)
        assert worst.overlap <= 1e-9, seed
        assert worst.outside <= 1e-9, seed
        assert worst.fallen <= 1e-9, seed
        assert worst.energy_rise <= 1e-12, seed
        pocketed += int((~simulation.in_play).sum())
    assert pocketed > 0 or not COMPILED


MIRRORED = {"x_min": "x_max", "x_max": "x_min", "y_min": "y_max", "y_max": "y_min"}


def mirrored_name(name: str | None, axis: int) -> str | None:
    if name is None:
        return None
    letter = "xy"[axis]
    return name.replace(f"{letter}_min", "*").replace(f"{letter}_max", f"{letter}_min").replace("*", f"{letter}_max")


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("speed", [6.0, 10.0])
def test_mirrored_shots_end_mirrored(axis: int, speed: float) -> None:
    # On a table whose middle is at the origin but for the thickness of the rails, which shifts it by a power of two.
    table = replace(POOL_9FT, length=2.5, width=1.25, rail_thickness=0.03125)
    scene = bs.scenes.rack(table=table, physics=POOL)
    scene = replace(scene, positions=np.round(scene.positions * 2.0**40) / 2.0**40)  # mirrored without rounding
    sign = np.array([-1.0 if axis == 0 else 1.0, -1.0 if axis == 1 else 1.0])
    centre = np.array(table.centre)
    mirrored = replace(scene, positions=centre + sign * (scene.positions - centre))
    angle = 0.01
    one, other = bs.Simulation(scene), bs.Simulation(mirrored)
    force = np.array([math.cos(angle), math.sin(angle)]) * POOL.mass * speed / POOL.cue_contact_time
    offset = (0.3 * RADIUS, 0.2 * RADIUS)
    one.strike((*force.tolist(), 0.0), offset)
    other.strike((*(sign * force).tolist(), 0.0), (-offset[0], offset[1]))
    events, others = list(one.run()), list(other.run())
    assert len(events) == len(others)
    assert any(event.kind == "pocketed" for event in events)
    for event, twin in zip(events, others, strict=True):
        assert (twin.time, twin.kind) == (event.time, event.kind)
        assert (twin.rail, twin.pocket) == (mirrored_name(event.rail, axis), mirrored_name(event.pocket, axis))
    assert other.in_play.tolist() == one.in_play.tolist()
    assert np.allclose(other.positions - centre, sign * (one.positions - centre), rtol=0.0, atol=1e-12)


def broken() -> bs.Simulation:
    simulation = bs.Simulation(bs.scenes.rack(table=POOL_9FT, physics=POOL))
    simulation.shoot(9.0, 0.01, side=0.2)
    return simulation


def test_ticks_copies_snapshots_and_pickles_give_the_same_bits_with_pocketed_balls() -> None:
    expected = rest(broken())
    assert False in expected[3]
    simulation = broken()
    events: list[bs.Event] = []
    snapshot = simulation.snapshot()
    for tick in range(1500 if COMPILED else 150):
        events += simulation.advance(0.01)
        if tick % 50 == 20:
            simulation = pickle.loads(pickle.dumps(simulation)) if tick % 100 == 20 else simulation.copy()
        if tick % 50 == 30:
            snapshot = simulation.snapshot()
            simulation.advance(0.05)
            simulation.restore(snapshot)
    last = simulation.run()
    assert [*events, *last] == expected[0]
    assert simulation.positions.tobytes() == expected[2]
    assert simulation.in_play.tolist() == expected[3]


def test_a_pocketed_ball_lies_in_its_pocket_and_takes_part_in_nothing() -> None:
    simulation = bs.Simulation(pool_scene((1.27, 0.3), (0.0, -3.0)))
    event = simulation.run()[-1]
    assert (event.kind, event.balls, event.rail, event.pocket, event.normal) == (
        "pocketed",
        ("cue",),
        None,
        "y_min",
        (0.0, 0.0),
    )
    assert event.approach_speed == pytest.approx(3.0 - 0.2 * 9.81 * event.time, rel=1e-12)
    assert event.point == pytest.approx((X_MIN + 1.27, Y_MIN - 0.1875 * 0.0254), abs=1e-14)
    assert simulation.in_play.tolist() == [False]
    assert simulation.positions[0] == pytest.approx((X_MIN + 1.27, Y_MIN - 0.0692625), abs=1e-14)
    assert simulation.kinetic_energy == 0.0
    assert simulation.at_rest
    assert list(simulation.advance(3.0)) == []
    with pytest.raises(ValueError, match="ball 'cue' is not in play"):
        simulation.strike((80.0, 0.0, 0.0))


def test_balls_roll_over_where_another_has_fallen() -> None:
    # The second one comes where the first has fallen, and falls too; a third passes the mouth.
    scene = bs.Scene(
        [[X_MIN + 1.27, Y_MIN + 0.2], [X_MIN + 1.27, Y_MIN + 0.4], [X_MIN + 0.9, Y_MIN + 0.1]],
        [[0.0, -2.0], [0.0, -2.0], [1.5, 0.0]],
        table=POOL_9FT,
    )
    simulation = bs.Simulation(scene)
    events = collisions(simulation.run(until=0.5))
    assert [(event.kind, event.balls) for event in events] == [("pocketed", ("cue",)), ("pocketed", ("1",))]
    assert simulation.in_play.tolist() == [False, False, True]


def test_a_ball_that_rests_on_the_shelf_hangs_until_it_is_knocked_in() -> None:
    place = (0.02, 0.02)  # in the mouth of a corner: 11.2 mm from the corner along both is the slate's cut
    simulation = bs.Simulation(pool_scene(place))
    assert list(simulation.advance(10.0)) == []
    assert simulation.in_play.all()
    scene = bs.Scene(
        [[X_MIN + 0.5, Y_MIN + 0.5], [X_MIN + place[0], Y_MIN + place[1]]], [[-1.0, -1.0], [0.0, 0.0]], table=POOL_9FT
    )
    events = collisions(bs.Simulation(scene).run())
    assert [(event.kind, event.balls) for event in events[:2]] == [("ball_ball", ("cue", "1")), ("pocketed", ("1",))]


def test_a_ball_along_the_nose_of_a_rail_passes_the_points_of_a_side_pocket() -> None:
    scene = pool_scene((0.6, RADIUS), (1.2, 0.0), rolling((1.2, 0.0)))
    assert said(collisions(bs.Simulation(scene).run())[0]) == "x_max_y_min_jaw_x_max"
    scene = pool_scene((1.9, RADIUS), (-1.2, 0.0), physics=bs.Physics(sliding_friction=0.0, rolling_friction=0.0))
    assert said(collisions(bs.Simulation(scene).run(until=5.0))[0]) == "x_min_y_min_jaw_x_min"


def spun_along_the_nose(v: float, w: float, x: float) -> bs.Scene:
    """A ball at the nose beside a side pocket that rolls along it, and spins onto it."""
    return pool_scene((x, RADIUS), (v, 0.0), (w, v / RADIUS, 0.0), physics=bs.Physics(rail_restitution=0.0))


def followed(v: float, w: float, x: float) -> tuple[float, complex]:
    """When, s, and where such a ball comes off the point: the motion on nose and point in small steps (RK4).

    It slides on the cloth, which pulls it by mu g against its slip; the rubber pushes as hard as it takes to stay.
    """
    shape = outline(POOL_9FT)
    centre, rho = shape.discs["y_min_point_x_min"]
    pull, reach = 0.2 * 9.81, rho + RADIUS

    def slip(state: Any) -> complex:
        return complex(state[1]) + RADIUS * state[2]

    def rates(state: Any) -> Any:
        place, velocity, _ = state
        friction = -pull * slip(state) / abs(slip(state))
        normal = 1j if place.real < centre.real else (place - centre) / abs(place - centre)
        curved = 0.0 if place.real < centre.real else abs(velocity) ** 2 / reach
        inward = (friction * normal.conjugate()).real
        push = max(-inward - curved, 0.0)
        # The spin as i w: it changes by 5/2 a/R for the friction alone.
        return np.array([velocity, friction + push * normal, 2.5 * friction / RADIUS])

    state = np.array([complex(x, RADIUS), complex(v, 0.0), complex(-v / RADIUS, w)])
    state[2] = complex(-v / RADIUS, w)
    step, time = 2e-5, 0.0
    while True:
        place = complex(state[0])
        if place.real > centre.real:
            normal = (place - centre) / abs(place - centre)
            friction = -pull * slip(state) / abs(slip(state))
            if (friction * normal.conjugate()).real + abs(state[1]) ** 2 / reach >= 0.0:
                return time, place
        one = rates(state)
        two = rates(state + 0.5 * step * one)
        three = rates(state + 0.5 * step * two)
        four = rates(state + step * three)
        state = state + step / 6.0 * (one + 2.0 * two + 2.0 * three + four)
        time += step


@pytest.mark.parametrize("v, w, x", [(0.05, 60.0, 1.2), (0.1, 100.0, 1.19), (0.15, 120.0, 1.17)])
def test_spin_takes_a_ball_along_a_nose_and_round_the_point(v: float, w: float, x: float) -> None:
    expected_time, expected_place = followed(v, w, x)
    simulation = bs.Simulation(spun_along_the_nose(v, w, x))
    run = bs.record(simulation)
    times = np.linspace(0.0, expected_time, 400)
    places = run.positions(times)[:, 0, 0] + 1j * run.positions(times)[:, 0, 1] - corner_of(POOL_9FT)
    away = gap(outline(POOL_9FT), places, RADIUS)
    rubber = np.min([away["y_min_0"], away["y_min_point_x_min"]], axis=0)
    assert rubber.min() > -1e-9
    assert rubber.max() < 1e-7  # where nose and point begin it takes some bounces to stay
    assert abs(places[-1] - expected_place) < 2e-5
    met = [said(event) for event in run.events if event.kind == "ball_rail"]
    assert met[:2] == ["y_min", "y_min_point_x_min"]
    later = min(expected_time + 0.01, run.end)
    place = complex(*run.positions([later])[0, 0]) - corner_of(POOL_9FT)
    assert gap(outline(POOL_9FT), np.array([place]), RADIUS)["y_min_point_x_min"][0] > 1e-9


def test_spin_holds_a_ball_at_a_jaw_until_it_falls() -> None:
    mouth = POOL_9FT.mouths[0]
    edge = mouth.edges[1]
    along = np.subtract(edge.end, edge.start) / math.dist(edge.start, edge.end)
    normal = np.array(edge.normal)
    start = np.array(edge.start) + 0.002 * along + RADIUS * normal + POOL_9FT.centre
    aim = 40.0 * (along - normal)  # rolls down the jaw and onto it
    scene = bs.Scene([start], [[0.0, 0.0]], [[-aim[1], aim[0], 0.0]], table=POOL_9FT)
    run = bs.record(bs.Simulation(scene))
    assert [said(event) for event in collisions(run.events)] == ["x_min_y_min_jaw_y_min", "x_min_y_min"]
    times = np.linspace(0.0, run.end, 200)[:-1]
    away = run.positions(times)[:, 0] - POOL_9FT.centre - np.array(edge.start)
    assert np.abs(away @ normal - RADIUS).max() < 1e-9
    # Constant friction mu g at 45 degrees to the jaw, of which the part along it is left. The slip turns towards the
    # normal, where nothing gives way: not by more than a tenth here.
    distance = float(away[-1] @ along - 0.002)
    assert 0.5 * 1.0 * run.end**2 < distance < 0.5 * 0.2 * 9.81 * math.sqrt(0.5) * run.end**2


def with_side_pockets(
    mouth: float, cut_angle: float, point_radius: float, shelf: float = 0.03, slate_radius: float = 0.05
) -> bs.Table:
    pocket = bs.Pocket(mouth, math.radians(cut_angle), shelf, point_radius, slate_radius)
    return bs.Table(length=2.0, width=1.0, rail_thickness=0.0, side_pocket=pocket)


@pytest.mark.parametrize(
    "mouth, cut_angle, point_radius, part", [(0.06, 120.0, 0.01, "jaw"), (0.0575, 92.0, 0.03, "point")]
)
@pytest.mark.parametrize("physics", [bs.Physics(), POOL], ids=["paper", "pool"])
def test_a_ball_that_meets_both_edges_at_once_stays_in_the_middle(
    mouth: float, cut_angle: float, point_radius: float, part: str, physics: bs.Physics
) -> None:
    table = with_side_pockets(mouth, cut_angle, point_radius)  # so narrow that it cannot pass
    scene = bs.Scene([[1.0, 0.5]], [[0.0, -1.0]], [[1.0 / RADIUS, 0.0, 0.0]], table=table, physics=physics)
    simulation = bs.Simulation(scene)
    while not (events := collisions(simulation.advance(0.01))):
        assert simulation.time < 0.8
    assert [said(event) for event in events[:2]] == [f"y_min_{part}_x_min", f"y_min_{part}_x_max"]
    assert events[0].time == events[1].time
    assert events[0].impulse == pytest.approx(events[1].impulse, rel=1e-12)
    assert simulation.positions[0, 0] == pytest.approx(1.0, abs=1e-12)
    assert simulation.velocities[0, 1] > 0.0
    if physics == bs.Physics():  # e of the approach comes back: along the middle, as the parts along the normals do
        approach = -(events[0].normal[1] * -events[0].approach_speed)
        speed = events[0].approach_speed / events[0].normal[1]
        assert events[0].impulse * events[0].normal[1] * 2.0 == pytest.approx(0.16 * 1.7 * speed, rel=1e-12)
        assert approach > 0.0


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_ball_that_presses_a_jaw_across_the_cut_of_the_slate_falls_whichever_way_it_leaves(side: float) -> None:
    # For 2 ms at 9 m/s: further than the middle of so small a circle.
    pocket = bs.Pocket(0.04, 2.38, 0.033, 0.0217, 0.0108)
    table = bs.Table(length=2.1, width=1.2, corner_pocket=pocket, jaw_depth=0.034)
    physics = bs.Physics(radius=0.0151, rail_restitution=0.04, youngs_modulus=5.8e9)
    aside, angle = side * 0.00025 * math.sqrt(0.5), math.radians(225.0) - side * 0.01
    place = (table.x_min + 0.3 + aside, table.y_min + 0.3 - aside)
    scene = bs.Scene([place], [(9.0 * math.cos(angle), 9.0 * math.sin(angle))], table=table, physics=physics)
    met = collisions(bs.Simulation(scene).run())
    assert [said(event) for event in met] == [f"x_min_y_min_jaw_{'x_min' if side > 0.0 else 'y_min'}", "x_min_y_min"]


def test_two_balls_and_a_jaw_are_solved_together() -> None:
    # The second ball lies at a jaw, and the first hits it straight at the jaw: as two balls and a rail.
    table = with_side_pockets(0.3, 120.0, 0.01, 0.0, 0.16)
    edge = table.mouths[0].edges[0]
    normal, along = np.array(edge.normal), np.subtract(edge.end, edge.start) / math.dist(edge.start, edge.end)
    lying = np.array(edge.start) + 0.004 * along + RADIUS * normal
    at_jaw = bs.Scene(
        np.array([lying + 3.0 * RADIUS * normal, lying]) + table.centre, [(-normal).tolist(), [0.0, 0.0]], table=table
    )
    at_rail = bs.Scene([[0.5, 4.0 * RADIUS], [0.5, RADIUS]], [[0.0, -1.0], [0.0, 0.0]], table=table)
    results = []
    for scene, across in ((at_jaw, normal), (at_rail, np.array([0.0, 1.0]))):
        simulation = bs.Simulation(scene)
        events = collisions(simulation.advance(0.1))
        results.append(([(event.kind, event.impulse) for event in events], simulation.velocities @ across))
    assert [kind for kind, _ in results[0][0]] == [kind for kind, _ in results[1][0]]
    assert {kind for kind, _ in results[0][0]} == {"ball_ball", "ball_rail"}
    assert [value for _, value in results[0][0]] == pytest.approx([value for _, value in results[1][0]], rel=1e-9)
    assert results[0][1] == pytest.approx(results[1][1], abs=1e-9)


def test_impacts_of_the_same_instant_come_before_a_fall() -> None:
    # A ball comes to the slate's cut at the very instant at which a faster one hits it from behind. All numbers are
    # whole multiples of powers of two.
    physics = bs.Physics(radius=2.0**-5, sliding_friction=0.0, rolling_friction=0.0)
    pocket = bs.Pocket(0.125, 2.0, 2.0**-6, 2.0**-7, 2.0**-4)
    table = bs.Table(length=2.0, width=1.0, rail_thickness=0.0, side_pocket=pocket)
    first = -(2.0**-6) + 0.5
    for order in ([0, 1], [1, 0]):
        positions = np.array([[1.0, first], [1.0, first + 2.0**-4 + 0.25]])
        velocities = np.array([[0.0, -0.5], [0.0, -0.75]])
        scene = bs.Scene(positions[order], velocities[order], table=table, physics=physics)
        events = list(bs.Simulation(scene).run(until=1.0))
        assert [(event.kind, event.time) for event in events] == [("ball_ball", 1.0), ("pocketed", 1.0)]
        assert events[1].balls == (scene.names[order.index(0)],)
        assert events[1].approach_speed == 0.75


def test_a_ball_that_falls_lets_go_of_what_it_pressed() -> None:
    # A row that spin presses down a side pocket: when the first one falls the others go on without it.
    line = X_MIN + 1.27
    scene = bs.Scene(
        [[line, Y_MIN + 0.01], [line, Y_MIN + 0.01 + 2.0 * RADIUS], [line, Y_MIN + 0.01 + 4.0 * RADIUS]],
        angular_velocities=[[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [40.0, 0.0, 0.0]],
        table=POOL_9FT,
    )
    simulation = bs.Simulation(scene)
    events = list(simulation.run())
    falls = [event.balls[0] for event in events if event.kind == "pocketed"]
    assert falls[0] == "cue"
    assert simulation.at_rest
    assert [name for name, on in zip(scene.names, simulation.in_play, strict=True) if not on] == falls
    after = [event for event in events if event.time > next(e.time for e in events if e.kind == "pocketed")]
    assert all("cue" not in event.balls for event in after)


def test_a_recording_shows_a_pocketed_ball_in_its_pocket() -> None:
    simulation = broken()
    run = bs.record(simulation)
    falls = [event for event in run.events if event.kind == "pocketed"]
    assert falls
    for event in falls:
        index = run.scene.names.index(event.balls[0])
        centre = next(mouth.centre for mouth in POOL_9FT.mouths if mouth.name == event.pocket)
        middle = np.add(centre, POOL_9FT.centre)
        assert run.positions([event.time, run.end])[:, index] == pytest.approx(np.array([middle, middle]), abs=1e-14)
        before = run.positions([math.nextafter(event.time, 0.0)])[0, index]
        assert np.hypot(*(before - event.point)) < 1e-9
        assert run.path(event.balls[0])[-1, 1:] == pytest.approx(middle, abs=1e-14)
    assert np.array_equal(run.positions([run.end])[0], simulation.positions)


def test_orientation_is_kept_with_balls_in_pockets() -> None:
    scene = replace(bs.scenes.rack(table=POOL_9FT, physics=POOL), track_orientation=True)
    plain, tracked = broken(), bs.Simulation(scene)
    tracked.shoot(9.0, 0.01, side=0.2)
    assert rest(tracked) == rest(plain)
    turned = tracked.orientations
    assert np.hypot.reduce(turned, axis=1) == pytest.approx(np.ones(len(scene)))


def test_the_next_shot_leaves_pocketed_balls_where_they_are() -> None:
    simulation = broken()
    simulation.run()
    before, off = simulation.positions, ~simulation.in_play
    simulation.shoot(2.0, 0.4)
    events = simulation.run()
    gone = {name for name, is_off in zip(simulation.start_scene.names, off, strict=True) if is_off}
    assert gone
    assert len(collisions(events)) > 1
    assert not any(gone.intersection(event.balls) for event in events)
    assert np.array_equal(simulation.positions[off], before[off])


def test_pockets_in_many_cells_are_those_of_one() -> None:
    # More than 32 balls are looked for by cells.
    few = pool_scene((1.2, 0.3), (0.3, -2.0), (20.0, 5.0, 9.0))
    grid = [[X_MIN + 0.1 + 0.07 * k, Y_MIN + 1.2] for k in range(34)]
    many = bs.Scene(
        np.concatenate((few.positions, grid)),
        np.concatenate((few.velocities, np.zeros((34, 2)))),
        np.concatenate((few.angular_velocities, np.zeros((34, 3)))),
        table=POOL_9FT,
    )
    one, other = bs.Simulation(few).run(until=0.5), bs.Simulation(many).run(until=0.5)
    assert [said(event) for event in one if event.kind != "rolling"][-1] == "y_min"
    assert list(one) == list(other)
