# SPDX-License-Identifier: Apache-2.0
"""The same scenes in other engines, where they are installed; each in a process of its own.

Every engine is set up for the model of this package as far as it goes: table, masses, friction, elastic and
frictionless balls, rails with restitution 0.7. Errors are against the solutions to 20 digits.

The extra `peers` installs pymunk and MuJoCo. pooltool 0.6.0 asks for a development version of panda3d that the package
index may not have; docs/benchmark says how to install it without.
"""

from __future__ import annotations

import itertools
import math
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from billiards_sim.engine.scene import Scene
from billiards_sim.engine.simulation import Simulation
from billiards_sim.study import pool
from billiards_sim.study.measure import ChildError, Task, in_child, installed, spread, version
from billiards_sim.study.truth import truths

SCENES = ("head_on", "break")
TIMES = ("0.5", "1", "2", "5")
"""s, at which positions are compared; a run ends with the last."""
RUNS = 5
POOL_RUNS = 4
"""Times as many breaks on the pool table: one takes a fifth."""

Array = NDArray[np.float64]


class Run(Protocol):
    """Plays a scene; returns (N, 2) m, the positions at each of some times, s."""

    def __call__(self, scene: Scene, times: list[float]) -> list[Array]: ...


def billiards_sim(scene: Scene, times: list[float]) -> list[Array]:
    """This package, for comparison."""
    simulation = Simulation(scene)
    positions = []
    for until in times:
        simulation.run(until=until)
        positions.append(simulation.positions)
    return positions


def pooltool(scene: Scene, times: list[float]) -> list[Array]:
    """pooltool, event-driven, with its simplest models of collisions: elastic balls, rails that reflect.

    Its table lies along y, so everything is turned by a quarter.
    """
    import pooltool as pt
    from pooltool import constants
    from pooltool.evolution.continuous import interpolate_ball_states
    from pooltool.physics.resolve import Resolver
    from pooltool.physics.resolve.ball_ball.frictionless_elastic import FrictionlessElastic
    from pooltool.physics.resolve.ball_cushion.unrealistic import UnrealisticCircular, UnrealisticLinear
    from pooltool.physics.resolve.ball_pocket import CanonicalBallPocket
    from pooltool.physics.resolve.stick_ball.instantaneous_point import InstantaneousPoint
    from pooltool.physics.resolve.transition import CanonicalTransition

    table, physics = scene.table, scene.physics
    radius = physics.radius
    resolver = Resolver(
        ball_ball=FrictionlessElastic(),
        ball_linear_cushion=UnrealisticLinear(restitution=True),
        ball_circular_cushion=UnrealisticCircular(restitution=True),
        ball_pocket=CanonicalBallPocket(),
        stick_ball=InstantaneousPoint(),
        transition=CanonicalTransition(),
    )
    parameters = pt.BallParams(
        m=physics.mass,
        R=radius,
        u_s=physics.sliding_friction,
        u_r=physics.rolling_friction,
        e_c=physics.rail_restitution,
        g=physics.gravity,
    )
    balls = {}
    for name, (x, y), (vx, vy), (wx, wy, wz) in zip(
        scene.names, scene.positions.tolist(), scene.velocities.tolist(), scene.angular_velocities.tolist()
    ):
        ball = pt.Ball(name, params=parameters)
        turned = (table.y_max - y, x - table.x_min, radius), (-vy, vx, 0.0), (-wy, wx, wz)
        ball.state.rvw = np.array(turned)
        ball.state.s = constants.sliding if vx or vy or wx or wy else constants.stationary
        balls[name] = ball
    specs = pt.objects.BilliardTableSpecs(l=table.length, w=table.width)
    system = pt.System(
        cue=pt.Cue.default(),
        table=pt.Table.from_table_specs(specs),
        balls=balls,
    )
    pt.simulate(system, engine=pt.physics.PhysicsEngine(resolver=resolver), inplace=True)
    positions = np.empty((len(times), len(scene), 2))
    for number, ball in enumerate(system.balls.values()):
        for index, state in enumerate(interpolate_ball_states(ball, times, extrapolate=True)):
            x, y, _ = state.rvw[0]
            positions[index, number] = table.x_min + y, table.y_max - x
    return list(positions)


def pymunk(scene: Scene, times: list[float]) -> list[Array]:
    """pymunk, a two-dimensional engine with time steps of 1 ms; friction of the cloth and spin are added to it."""
    import pymunk as pm

    table, physics = scene.table, scene.physics
    radius, step = physics.radius, 0.001
    space = pm.Space()
    space.collision_slop = 1e-5  # m; its default is for pixels
    space.iterations = 20
    corners = [(table.x_min, table.y_min), (table.x_max, table.y_min), (table.x_max, table.y_max)]
    corners.append((table.x_min, table.y_max))
    for one, other in zip(corners, corners[1:] + corners[:1]):
        rail = pm.Segment(space.static_body, one, other, 0.0)
        rail.elasticity = physics.rail_restitution
        space.add(rail)
    spins = [[wx, wy] for wx, wy, _ in scene.angular_velocities.tolist()]
    slide, roll = physics.sliding_friction * physics.gravity, physics.rolling_friction * physics.gravity

    def cloth(body: Any, spin: list[float], dt: float) -> None:
        vx, vy = body.velocity
        ux, uy = vx - radius * spin[1], vy + radius * spin[0]
        slip = math.hypot(ux, uy)
        share = min(slide * dt / slip, 2.0 / 7.0) if slip > 0.0 else 0.0
        vx, vy = vx - share * ux, vy - share * uy
        spin[0] -= 2.5 / radius * share * uy
        spin[1] += 2.5 / radius * share * ux
        if slip <= 3.5 * slide * dt:
            speed = math.hypot(vx, vy)
            left = max(1.0 - roll * dt / speed, 0.0) if speed > 0.0 else 0.0
            vx, vy = left * vx, left * vy
            spin[:] = -vy / radius, vx / radius
        body.velocity = vx, vy

    bodies = []
    for position, velocity, spin in zip(scene.positions.tolist(), scene.velocities.tolist(), spins):
        body = pm.Body(physics.mass, math.inf)
        body.position, body.velocity = tuple(position), tuple(velocity)
        body.velocity_func = lambda body, gravity, damping, dt, spin=spin: cloth(body, spin, dt)
        shape = pm.Circle(body, radius)
        shape.elasticity, shape.friction = 1.0, 0.0
        space.add(body, shape)
        bodies.append(body)
    positions = []
    done = 0
    for until in times:
        for _ in range(done, round(until / step)):
            space.step(step)
        done = round(until / step)
        positions.append(np.array([tuple(body.position) for body in bodies]))
    return positions


def mujoco(scene: Scene, times: list[float]) -> list[Array]:
    """MuJoCo, soft contacts with time steps of 0.1 ms: stiff springs that last 2 ms, damped at the rails only."""
    import mujoco as mj

    step = 1e-4
    model = mj.MjModel.from_xml_string(_mujoco_model(scene, step))
    data = mj.MjData(model)
    for index, (velocity, spin) in enumerate(zip(scene.velocities, scene.angular_velocities)):
        data.qvel[6 * index : 6 * index + 2] = velocity
        data.qvel[6 * index + 3 : 6 * index + 6] = spin
    positions = []
    done = 0
    for until in times:
        mj.mj_step(model, data, nstep=round(until / step) - done)
        done = round(until / step)
        positions.append(data.qpos.reshape(-1, 7)[:, 0:2].copy())
    return positions


def _mujoco_model(scene: Scene, step: float) -> str:
    table, physics = scene.table, scene.physics
    contact_time, restitution = 2e-3, physics.rail_restitution
    stiffness = (math.pi / contact_time) ** 2
    # A damped spring gives back exp(-z pi / sqrt(1 - z^2)) of the speed.
    loss = -math.log(restitution) / math.pi
    damping = 2.0 * loss / math.sqrt(1.0 + loss**2) * math.pi / contact_time
    hard = 'solimp="0.9999 0.9999 0.001"'
    # Rolling resistance as a torque per load, m: it brakes a rolling ball at 5/7 of torque / (m R).
    resistance = 1.4 * physics.rolling_friction * physics.radius
    cloth = f'condim="6" friction="{physics.sliding_friction} {physics.sliding_friction} 0 {resistance} {resistance}"'
    rails = {
        "left": (table.x_min, 0.0, "0 1 0 0 0 1"),
        "right": (table.x_max, 0.0, "0 0 1 0 1 0"),
        "low": (0.0, table.y_min, "0 0 1 1 0 0"),
        "high": (0.0, table.y_max, "1 0 0 0 0 1"),
    }
    world = ['<geom name="cloth" type="plane" size="5 5 1"/>']
    # A plane's normal is the cross product of its axes x and y; each of these points into the table.
    world += [
        f'<geom name="{name}" type="plane" size="5 5 1" pos="{x} {y} 0" xyaxes="{axes}"/>'
        for name, (x, y, axes) in rails.items()
    ]
    pairs = []
    for number, (x, y) in enumerate(scene.positions.tolist()):
        world.append(
            f'<body pos="{x!r} {y!r} {physics.radius}"><freejoint/>'
            f'<geom name="{number}" type="sphere" size="{physics.radius}" mass="{physics.mass}"/></body>'
        )
        pairs.append(f'<pair geom1="cloth" geom2="{number}" {cloth}/>')
        bounce = f'condim="1" solref="{-stiffness} {-damping}" {hard}'
        pairs += [f'<pair geom1="{name}" geom2="{number}" {bounce}/>' for name in rails]
    for one, other in itertools.combinations(range(len(scene)), 2):
        pairs.append(f'<pair geom1="{one}" geom2="{other}" condim="1" solref="{-stiffness} 0" {hard}/>')
    return f"""
        <mujoco>
          <option timestep="{step}" gravity="0 0 {-physics.gravity}" cone="elliptic" impratio="10"/>
          <default><geom contype="0" conaffinity="0"/></default>
          <worldbody>{"".join(world)}</worldbody>
          <contact>{"".join(pairs)}</contact>
        </mujoco>"""


@dataclass(frozen=True)
class Peer:
    """An engine: how it plays a scene, and under which name pip has it."""

    run: Run
    distribution: str
    kind: str


PEERS = {
    "billiards_sim": Peer(billiards_sim, "billiards_sim", "event-driven"),
    "pooltool": Peer(pooltool, "pooltool-billiards", "event-driven"),
    "pymunk": Peer(pymunk, "pymunk", "steps of 1 ms, cloth friction added"),
    "mujoco": Peer(mujoco, "mujoco", "steps of 0.1 ms, soft contacts"),
}


def measure(peer: str, scene: str, runs: int) -> dict[str, Any]:
    """Play a scene some times in this process.

    Returns:
        "first": s, of the first run, import included; "wall": s, of a run from the scene to t = 5 s, set-up included;
        "position": m, the largest distance of a ball from where it should be, by time.
    """
    truth, run = truths()[scene], PEERS[peer].run
    times = [truth.states[name].time for name in TIMES]
    walls = []
    for _ in range(1 + runs):
        start = time.perf_counter()
        positions = run(truth.scene, times)
        walls.append(time.perf_counter() - start)
    errors = [float(np.hypot(*(there - truth.states[name].positions).T).max()) for name, there in zip(TIMES, positions)]
    return {"first": walls[0], "wall": spread(walls[1:]), "position": dict(zip(TIMES, errors))}


def compare(peer: str, runs: int) -> dict[str, Any]:
    """All scenes in a peer, each in a process of its own; "absent" if it is not installed."""
    result: dict[str, Any] = {"kind": PEERS[peer].kind, "version": version(PEERS[peer].distribution), "scenes": {}}
    if not installed(peer):
        return result | {"absent": True}
    # A home of its own: pooltool reads and writes settings there that change its physics.
    with tempfile.TemporaryDirectory(prefix="billiards_sim_peer_") as home:
        for scene in SCENES:
            result["scenes"][scene] = _tried(measure, home, peer=peer, scene=scene, runs=runs)
        if peer in pool.PLAYERS:
            result["pool"] = _tried(pool.measure, home, peer=peer, runs=POOL_RUNS * runs)
    return result | {"absent": False}


def _tried(function: Callable[..., dict[str, Any]], home: str, **arguments: Any) -> dict[str, Any]:
    # This engine keeps its machine code at home.
    environment = {} if arguments["peer"] == "billiards_sim" else {"HOME": home}
    try:
        found: dict[str, Any] = in_child(function, environment, **arguments)
    except ChildError as error:
        return {"failure": str(error)}
    return found


def tasks(quick: bool) -> Iterator[Task]:
    """The pieces of this part."""
    for peer in PEERS:
        yield peer, partial(_add, peer=peer, runs=1 if quick else RUNS)


def _add(study: dict[str, Any], peer: str, runs: int) -> None:
    study[peer] = compare(peer, runs)
