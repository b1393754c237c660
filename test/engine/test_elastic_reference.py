# SPDX-License-Identifier: Apache-2.0
"""Elastic contacts against solutions by brute force: test/data/elastic.json, which make_elastic.py writes."""

from __future__ import annotations

import importlib.util
import json
import sys
from typing import Any

import numpy as np
import pytest
from checks import COMPILED, DATA
from numpy.typing import NDArray

import billiards_sim as bs
from billiards_sim.engine.elastic import CONTACT_STEPS
from billiards_sim.engine.tables import set_fields

REFERENCE = json.loads((DATA / "elastic.json").read_text(encoding="utf-8"))
CASES = {case["name"]: case for case in REFERENCE["cases"]}
TABLE = bs.Table(length=9.0, width=9.0)
ICE = 1e-9
"""Friction of the cloth, which does nothing in the reference."""

Array = NDArray[np.float64]


def physics(law: dict[str, Any]) -> bs.Physics:
    values = {**REFERENCE["law"], **law}
    friction, slow, decay = values.pop("friction")
    values.update(ball_friction=friction, ball_friction_slow=slow, ball_friction_decay=decay)
    return bs.Physics(sliding_friction=ICE, rolling_friction=ICE, **values)


def played(
    positions: Array,
    velocities: Array,
    spins: Array | None,
    law: dict[str, Any],
    time: float,
    origin: Array = TABLE.centre,
) -> bs.Simulation:
    scene = bs.Scene(positions + origin, velocities, spins, table=TABLE, physics=physics(law))
    simulation = bs.Simulation(scene)
    simulation.run(until=time)
    return simulation


def maker() -> Any:
    """The script that makes the reference, for where it lays out racks."""
    spec = importlib.util.spec_from_file_location("make_elastic", DATA / "make_elastic.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def free(count: int, pressed: list[int]) -> NDArray[np.bool_]:
    """Who is not in contact at the end, where places and speeds are conventions."""
    return ~np.isin(np.arange(count), pressed)


@pytest.mark.parametrize("name", [name for name in CASES if name.startswith("rack") or "in line" in name])
def test_groups_go_as_the_reference_says(name: str) -> None:
    case = CASES[name]
    positions = np.array(case["positions"])
    simulation = played(positions, np.array(case["velocities"]), None, case["law"], case["time"])
    those = free(len(positions), case["in_contact"])
    # Damping goes as d^(1/4), whose kink costs more than that of the force.
    speed_error, error = (1e-4, 1e-6) if physics(case["law"]).ball_restitution == 1.0 else (5e-4, 2e-6)
    assert (simulation.velocities - case["final_velocities"])[those] == pytest.approx(0.0, abs=speed_error)
    assert (simulation.positions - TABLE.centre - case["final_positions"])[those] == pytest.approx(0.0, abs=error)


@pytest.mark.parametrize("name", [name for name in CASES if name.startswith("pair")])
def test_pairs_go_as_the_reference_says(name: str) -> None:
    # By themselves they are in closed form: exact head on, else fitted.
    case = CASES[name]
    velocities = np.array(case["velocities"])
    simulation = played(np.array(case["positions"]), velocities, None, case["law"], case["time"])
    error = 1e-9 if name.endswith(" 0 rad") else 1e-5 * np.hypot(*velocities.T).max()
    assert simulation.velocities == pytest.approx(np.array(case["final_velocities"]), abs=error)
    assert simulation.positions - TABLE.centre == pytest.approx(np.array(case["final_positions"]), abs=1e-6)


@pytest.mark.parametrize("name", [name for name in CASES if "rails" in CASES[name]])
def test_balls_at_rails_go_as_the_reference_says(name: str) -> None:
    case = CASES[name]
    assert case["rails"] == [[1.0, 0.0, 0.0]]
    origin = np.array([TABLE.x_min, TABLE.centre[1]])
    simulation = played(
        np.array(case["positions"]), np.array(case["velocities"]), None, case["law"], case["time"], origin
    )
    error = 1e-9 if len(case["positions"]) == 1 else 1e-4  # by itself it is in closed form
    assert simulation.velocities == pytest.approx(np.array(case["final_velocities"]), abs=error)
    assert simulation.positions - origin == pytest.approx(np.array(case["final_positions"]), abs=1e-6)


@pytest.mark.parametrize("name", [name for name in CASES if name.startswith("friction, pair")])
def test_pairs_rub_as_the_reference_says(name: str) -> None:
    case = CASES[name]
    spins = np.array(case["angular_velocities"])
    velocities = np.array(case["velocities"])
    simulation = played(np.array(case["positions"]), velocities, spins, case["law"], case["time"])
    error = case["error"] + 1e-4 * np.hypot(*velocities.T).max()
    assert simulation.velocities == pytest.approx(np.array(case["final_velocities"]), abs=error)
    surface = bs.Physics().radius * simulation.angular_velocities
    assert surface == pytest.approx(bs.Physics().radius * np.array(case["final_angular_velocities"]), abs=error)
    assert simulation.positions - TABLE.centre == pytest.approx(np.array(case["final_positions"]), abs=2e-6)


@pytest.mark.parametrize("name", [name for name in CASES if name.startswith("friction, rack")])
def test_racks_rub_as_the_reference_says(name: str) -> None:
    # Friction acts at the ends of steps: it converges at first order.
    case = CASES[name]
    spins = np.array(case["angular_velocities"])
    simulation = played(np.array(case["positions"]), np.array(case["velocities"]), spins, case["law"], case["time"])
    those = free(len(spins), case["in_contact"])
    assert (simulation.velocities - case["final_velocities"])[those] == pytest.approx(0.0, abs=2e-2)


def test_random_clusters_go_as_the_reference_says() -> None:
    units = REFERENCE["cluster_columns"]
    errors = []
    for row in REFERENCE["clusters"] if COMPILED else REFERENCE["clusters"][:30]:
        time, positions, velocities, final, pressed = row
        starting = np.array(velocities) * units["velocities"]
        simulation = played(np.array(positions) * units["positions"], starting, None, {}, time * units["time"])
        those = free(len(starting), pressed)
        off = np.abs(simulation.velocities - np.array(final) * units["final_velocities"])[those]
        errors.append(off.max(initial=0.0) / np.hypot(*starting.T).max())
    assert np.quantile(errors, 0.99 if COMPILED else 0.9) <= 1e-3  # of 30 clusters one may be among the worst
    assert np.median(errors) <= 1e-4


def test_closed_forms_in_random_clusters_are_what_their_integration_says() -> None:
    units = REFERENCE["cluster_columns"]
    errors = []
    for time, positions, velocities, _, pressed in REFERENCE["clusters"] if COMPILED else REFERENCE["clusters"][:30]:
        starting = np.array(velocities) * units["velocities"]
        places = np.array(positions) * units["positions"] + TABLE.centre
        simulation = bs.Simulation(bs.Scene(places, starting, table=TABLE, physics=physics({})))
        integrated = simulation.copy()
        set_fields(integrated._now.state.constants, 0, integrates_all=True)
        simulation.run(until=time * units["time"])
        integrated.run(until=time * units["time"])
        off = np.abs(simulation.velocities - integrated.velocities)[free(len(starting), pressed)]
        errors.append(off.max(initial=0.0) / np.hypot(*starting.T).max())
    assert max(errors) > 0.0  # there are lone pairs
    assert np.quantile(errors, 0.99 if COMPILED else 0.9) <= 1e-3
    assert np.median(errors) <= 1e-4


def test_finer_steps_keep_the_energy_of_a_rack_to_a_millionth() -> None:
    case = CASES["rack, gaps 0 mm, aim 4 mm"]
    assert case["in_contact"] == []
    scene = bs.Scene(np.array(case["positions"]) + TABLE.centre, case["velocities"], table=TABLE, physics=physics({}))
    for steps, share in ((CONTACT_STEPS, 2e-5), (80.0, 1e-6)):
        simulation = bs.Simulation(scene)
        set_fields(simulation._now.state.constants, 0, contact_steps=steps)
        before = simulation.kinetic_energy
        simulation.run(until=case["time"])
        assert simulation.kinetic_energy == pytest.approx(before, rel=share)


def test_a_rack_changes_with_its_gap_no_faster_than_the_reference() -> None:
    units = REFERENCE["sweep_columns"]
    rows = REFERENCE["sweep"] if COMPILED else REFERENCE["sweep"][:10]
    before: tuple[Array, Array] | None = None
    for gap, time, final, pressed in rows:
        simulation = played(*maker().rack(gap * units["gap"], 4e-3), None, {}, time * units["time"])
        those = free(len(final), pressed)
        exact = np.where(those[:, np.newaxis], np.array(final) * units["final_velocities"], np.nan)
        found = np.where(those[:, np.newaxis], simulation.velocities, np.nan)
        if before is not None:
            jump = np.hypot(*(found - before[0]).T) - np.hypot(*(exact - before[1]).T)
            assert np.nanmax(jump) <= 0.03 * 8.0, gap
        before = found, exact
