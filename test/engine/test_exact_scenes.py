# SPDX-License-Identifier: Apache-2.0
"""Against solutions to 20 digits of independent multiprecision programs (test/data)."""

from __future__ import annotations

import numpy as np
import pytest
from checks import EXACT_KINDS, EXACT_RAILS, EXACT_SCENES, exact_array, exact_scene, tolerance

import billiards_sim as bs


def assert_state(simulation: bs.Simulation, exact: list, atol: float) -> None:
    radius = simulation.start_scene.physics.radius
    np.testing.assert_allclose(simulation.positions, exact_array(exact, "position"), rtol=0, atol=atol)
    np.testing.assert_allclose(simulation.velocities, exact_array(exact, "velocity"), rtol=0, atol=atol)
    spins = exact_array(exact, "angular_velocity")
    np.testing.assert_allclose(radius * simulation.angular_velocities, radius * spins, rtol=0, atol=atol)


@pytest.mark.parametrize("name", EXACT_SCENES)
def test_states_at_snapshots_and_at_rest(name: str) -> None:
    simulation = bs.Simulation(exact_scene(name))
    for time, exact in EXACT_SCENES[name]["snapshots"].items():
        simulation.run(until=float(time))
        assert_state(simulation, exact, tolerance(name))
    simulation.run()
    assert_state(simulation, EXACT_SCENES[name]["state_at_rest"], tolerance(name))


@pytest.mark.parametrize("name", EXACT_SCENES)
def test_events_in_order_and_on_time(name: str) -> None:
    scene = exact_scene(name)
    events = bs.Simulation(scene).run()
    exact_events = EXACT_SCENES[name]["events"]
    assert [event.kind for event in events] == [EXACT_KINDS[exact["type"]] for exact in exact_events]
    for event, exact in zip(events, exact_events, strict=True):
        assert event.time == pytest.approx(float(exact["t"]), rel=0, abs=tolerance(name))
        assert [scene.names.index(ball) for ball in event.balls] == exact["balls"]
        assert event.rail == EXACT_RAILS.get(exact.get("rail"))
        speed = exact.get("normal_approach_speed", exact.get("normal_speed_in", "0"))
        assert event.approach_speed == pytest.approx(float(speed), rel=0, abs=tolerance(name))


@pytest.mark.parametrize("built_in, name", [("head_on", "scene1_headon"), ("glancing", "scene2_glancing")])
def test_built_in_scenes_are_the_papers(built_in: str, name: str) -> None:
    scene, exact = bs.scenes.BUILT_IN[built_in](), exact_scene(name)
    assert np.array_equal(scene.positions, exact.positions)
    assert np.array_equal(scene.velocities, exact.velocities)
    assert not scene.angular_velocities.any()
