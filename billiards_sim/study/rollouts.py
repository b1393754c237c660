# SPDX-License-Identifier: Apache-2.0
"""How many shots a second a rollout plays: beside what the kernel alone allows, on one thread and on every core."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np

from billiards_sim.engine import machine, scenes
from billiards_sim.engine.player import Job, Player
from billiards_sim.engine.rollout import cores, rollout
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.shots import Shots, blows
from billiards_sim.study import peers
from billiards_sim.study.measure import ChildError, Task, in_child, installed, seconds, spread, version
from billiards_sim.study.speed import AIM

RUNS, QUICK_RUNS = 9, 3
"""Of each kind, in turn: a busy machine is as busy for all."""

QUICK_SHARE = 4
"""Times fewer shots in a quick study."""

PEER = "pooltool"
PEER_RUNS = 5


def cases() -> dict[str, tuple[Scene, Shots]]:
    """What is played: a scene and shots, by name."""
    random = np.random.default_rng(1)
    two = Scene([(0.6, 0.6), (1.2, 0.62)])
    return {
        "break on the paper's table": (scenes.rack(), Shots(8.0, random.uniform(-AIM, AIM, 2_000))),
        "eight-ball break, everything on": (scenes.eight_ball(), Shots(8.0, random.uniform(-AIM, AIM, 400))),
        "two balls on the paper's table": (two, Shots(2.0, random.uniform(-0.1, 0.15, 20_000))),
    }


def kernel_seconds(scene: Scene, shots: Shots) -> float:
    """What shots take the kernel alone, s."""
    strokes = blows(shots.columns(), scene.physics)
    player = Player(Job(scene, "cue", None, None, 1, 0, False, False))
    return math.fsum(seconds(play) for play in player.kernel_calls(strokes))


def rollout_seconds(scene: Scene, shots: Shots, threads: int | None) -> float:
    """What a rollout takes with so many threads, or as it is, s."""
    if threads is None:
        return seconds(lambda: rollout(scene, shots))
    with ThreadPoolExecutor(threads) as executor:
        return seconds(lambda: rollout(scene, shots, executor=executor))


def measure(name: str, runs: int, share: int) -> dict[str, Any]:
    """Shots a second of a case: "kernel", "one" thread, "all" cores, as `spread`; "events" of a shot, the mean."""
    scene, shots = cases()[name]
    shots = shots[: len(shots) // share]
    result = rollout(scene, shots)  # warm
    ways: dict[str, Callable[[Scene, Shots], float]] = {
        "kernel": kernel_seconds,
        "one": partial(rollout_seconds, threads=1),
        "all": partial(rollout_seconds, threads=None),
    }
    found: dict[str, list[float]] = {way: [] for way in ways}
    for _ in range(runs):
        for way, action in ways.items():
            found[way].append(len(shots) / action(scene, shots))
    return {
        "name": name,
        "shots": len(shots),
        "events": float(result.event_count.mean()),
        "threads": cores() if machine.is_ready() else 1,
        **{way: spread(rates) for way, rates in found.items()},
    }


def measure_peer(runs: int) -> dict[str, Any]:
    """Breaks a second of another engine, from the start to t = 5 s; "absent" if it is not installed."""
    result: dict[str, Any] = {"name": PEER, "version": version(peers.PEERS[PEER].distribution)}
    if not installed(PEER):
        return result | {"absent": True}
    with tempfile.TemporaryDirectory(prefix="billiards_sim_peer_") as home:
        try:
            wall = in_child(peers.measure, {"HOME": home}, peer=PEER, scene="break", runs=runs)["wall"]
        except ChildError as error:
            return result | {"absent": False, "failure": str(error)}
    return result | {"absent": False, "rate": 1.0 / wall["median"]}


def tasks(quick: bool) -> Iterator[Task]:
    """The pieces of this part."""
    for name in cases():
        runs, share = (QUICK_RUNS, QUICK_SHARE) if quick else (RUNS, 1)
        yield name, partial(_add, name=name, runs=runs, share=share)
    yield f"{PEER}, break", partial(_add_peer, runs=1 if quick else PEER_RUNS)


def _add(study: dict[str, Any], name: str, runs: int, share: int) -> None:
    study.setdefault("cases", []).append(measure(name, runs, share))


def _add_peer(study: dict[str, Any], runs: int) -> None:
    study["peer"] = measure_peer(runs)
