# SPDX-License-Identifier: Apache-2.0
"""Nothing that a user may ask for stops the ticks, or what else the node has to hear."""

import signal
from collections.abc import Callable

import pytest
from conftest import Site

from billiards_sim.engine.scene import Shot
from billiards_sim.engine.simulation import Simulation
from billiards_sim.ros import preview
from billiards_sim.ros.table_node import TableNode
from billiards_sim.ros.wrench import wrench_from_shot

WITHOUT_END = (
    "scene:=rack",
    "physics.rail_restitution:=1.0",
    "physics.sliding_friction:=0.0",
    "physics.rolling_friction:=0.0",
)
FASTEST = (3.2e9, 1e8, 0.0)
"""N: 2e8 m/s, some 1e9 events a second."""


def test_a_shot_without_end_stops_nothing(site: Site) -> None:
    table = site.table(*WITHOUT_END)
    client = site.client()
    message = wrench_from_shot(FASTEST, (0.0, 0.0))
    foreseen = client.preview(message)
    assert (foreseen["accepted"], foreseen["complete"], len(foreseen["events"])) == (True, False, preview.MOST_EVENTS)
    assert client.shoot(message)["accepted"]
    client.spin_until(lambda: len(client.collisions) > 1000)
    client.ignore("collisions", "markers")  # hundreds of events a tick may be more than this process has the time for
    client.fresh_poses(20)
    table.wait_for("the table does not keep up: stamps fall")
    assert "every ball must rest before a preview" in client.preview(message)["reason"]
    assert client.reset().success
    client.spin_until(lambda: client.at_rest[-1])
    assert client.shoot(message)["accepted"]
    client.fresh_poses(5)
    table.signal(signal.SIGINT)
    assert table.wait() == 0


def test_a_tick_gives_way_and_counts_what_it_owes(make_node: Callable[..., TableNode]) -> None:
    node = make_node(*WITHOUT_END)
    node.start()
    node.simulation.strike(FASTEST)
    node.advance(1.0)
    assert 0.0 < node.simulation.time < 0.1
    assert node._lost_time == pytest.approx(1.0 - node.simulation.time)
    reached = node.simulation.time
    node.advance(1.0)
    assert node.simulation.time > reached


@pytest.mark.parametrize("bound", ["MOST_EVENTS", "MOST_WORK"])
def test_a_preview_ends_at_its_bounds_within_a_slice(
    make_node: Callable[..., TableNode], monkeypatch: pytest.MonkeyPatch, bound: str
) -> None:
    node = make_node(*WITHOUT_END)
    node.start()
    monkeypatch.setattr(preview, bound, {"MOST_EVENTS": 500, "MOST_WORK": 1e-9}[bound])
    runs = []
    run = Simulation.run
    monkeypatch.setattr(Simulation, "run", lambda *given, **options: runs.append(1) or run(*given, **options))
    found = preview.predict(node.simulation, Shot(FASTEST))
    assert found.complete is False
    assert found.events[-1].time <= found.end < preview.SLICE
    assert [path[-1][0] <= found.end for path in found.paths.values()] == [True] * 16
    if bound == "MOST_EVENTS":
        assert len(found.events) == 500
    else:
        assert len(runs) == 2  # a piece, after the one that begins
