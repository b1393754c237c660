# SPDX-License-Identifier: Apache-2.0
"""Learns from nothing to score with one shot from anywhere, and draws how: to pot a ball, or sum to three.

A network says of a position how probable it is to score, for each of some aims and speeds. It is fitted to what came of
shots that were tried, by logistic regression; the more a shot promises, the more often it is tried (Boltzmann
exploration: Sutton and Barto, Reinforcement Learning, 2018). What is learnt is the one that promises most.

A table looks the same in a mirror along each of its axes: the other ball is always taken to lie in the same quarter.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from matplotlib.figure import Figure
from tqdm import tqdm

import billiards_sim as bs
import billiards_sim.gym  # noqa: F401

Array = np.ndarray[Any, np.dtype[Any]]

TABLES = 512
HIDDEN = 128
LEARNING_RATE = 5e-3
"""At first; it falls to 0 on a straight line."""

LAST_ZEAL = 12.0
"""What a probability is multiplied with in the exponent of how often a shot is tried. It grows from 0, where all are
tried as often, until `ZEAL_GROWS` of the updates are made."""
ZEAL_GROWS = 0.7

LOOKS = 30
"""At how well it plays what it takes for best, on the way."""
LOOK_STEPS = 8
"""Of all tables, for one look."""


class Task(NamedTuple):
    """What is learnt, and among which shots."""

    title: str
    environment: str
    options: dict[str, Any]
    aims: int  # so many from one edge of the other ball to the other
    speeds: tuple[float, ...]  # as in actions
    updates: int  # of the network, each after a shot at every table


TASKS = {
    "pot": Task("Pot a ball, 9 ft pool table", "Pool", {"balls": 1}, 41, (0.3,), 6000),
    "sum_to_three": Task("Sum to three", "SumToThree", {"random_start": True}, 15, tuple(np.linspace(-1, 1, 9)), 800),
}


class Network:
    """Two layers of tanh; Adam (Kingma and Ba, 2015) follows the gradient."""

    def __init__(self, inputs: int, outputs: int, random: np.random.Generator) -> None:
        sizes = [inputs, HIDDEN, HIDDEN, outputs]
        self.weights = [self._matrix(random, shape) for shape in zip(sizes, sizes[1:])]
        self.weights[-1] *= 0.1
        self.biases = [np.zeros(size, np.float32) for size in sizes[1:]]
        self._means = [np.zeros_like(part) for part in self.weights + self.biases]
        self._squares = [np.zeros_like(part) for part in self.weights + self.biases]
        self._steps = 0

    def __call__(self, positions: Array) -> Array:
        """(M, outputs): probabilities."""
        self.layers = [positions]
        for weights, biases in zip(self.weights[:-1], self.biases[:-1]):
            self.layers.append(np.tanh(self.layers[-1] @ weights + biases))
        return 1.0 / (1.0 + np.exp(-(self.layers[-1] @ self.weights[-1] + self.biases[-1])))  # type: ignore[no-any-return]

    def climb(self, gradient: Array, rate: float) -> None:
        """Go uphill, with the gradient (M, outputs) by the logits of the last call."""
        by_weights: list[Array] = []
        by_biases: list[Array] = []
        for layer, weights in zip(self.layers[::-1], self.weights[::-1]):
            by_weights.insert(0, layer.T @ gradient)
            by_biases.insert(0, gradient.sum(axis=0))
            gradient = (gradient @ weights.T) * (1.0 - layer**2)
        self._steps += 1
        for part, by, mean, square in zip(
            self.weights + self.biases, by_weights + by_biases, self._means, self._squares, strict=True
        ):
            mean += 0.1 * (by - mean)
            square += 0.01 * (by**2 - square)
            part += rate * (mean / (1.0 - 0.9**self._steps)) / (np.sqrt(square / (1.0 - 0.99**self._steps)) + 1e-8)

    @staticmethod
    def _matrix(random: np.random.Generator, shape: tuple[int, int]) -> Array:
        return (random.standard_normal(shape) / np.sqrt(shape[0])).astype(np.float32)


class Play:
    """Games of one shot at many tables.

    Attributes:
        seen: (TABLES, 6), the observations.
        aims, speeds: what a shot is chosen from, as in actions; a choice is an index into them, flattened.
    """

    def __init__(self, task: Task, seed: int) -> None:
        self._envs = gymnasium.make_vec(
            f"billiards_sim/{task.environment}-v0",
            TABLES,
            max_episode_steps=1,
            autoreset_mode="SameStep",
            **task.options,
        )
        self.seen, _ = self._envs.reset(seed=seed)
        self._envs.action_space.seed(seed)
        self.aims, self.speeds = np.meshgrid(2.0 * (np.arange(task.aims) + 0.5) / task.aims - 1.0, task.speeds)

    def positions(self) -> tuple[Array, Array]:
        """(TABLES, 7) what the network sees, and (TABLES,) -1 where it sees a mirror image, else 1."""
        places = self.seen.reshape(TABLES, 2, 3)[..., :2] * (2.0, 1.0)  # a table is twice as long as it is wide
        mirror = np.where(places[:, 1] < 0.0, -1.0, 1.0)
        cue, other = (places * mirror[:, np.newaxis]).swapaxes(0, 1)
        away = np.linalg.norm(other - cue, axis=1, keepdims=True)
        columns = (cue, 2.0 * other - 1.0, (other - cue) / away, away - 1.0)
        return np.column_stack(columns).astype(np.float32), mirror.prod(axis=1)

    def shoot(self, choices: Array, mirrored: Array) -> Array:
        """(TABLES,) which of these choices, one a table, scored."""
        actions = np.zeros((TABLES, 4))
        actions[:, 0] = self.aims.ravel()[choices] * mirrored
        actions[:, 1] = self.speeds.ravel()[choices]
        return self.act(actions)

    def act(self, actions: Array) -> Array:
        """(TABLES,) which of these actions, one a table, scored."""
        self.seen, rewards, *_ = self._envs.step(actions)
        return np.asarray(rewards > 0.0)

    def by_chance(self) -> float:
        """Share of random actions that score."""
        return float(np.mean([self.act(self._envs.action_space.sample()) for _ in range(LOOK_STEPS)]))

    def by_geometry(self) -> float:
        """Share of shots at the ghost ball that score, at the speed that the network has."""
        scored = []
        for _ in range(LOOK_STEPS):
            actions = np.zeros((TABLES, 4))
            actions[:, 0] = [ghost_ball(seen) for seen in self.seen]
            actions[:, 1] = self.speeds[0, 0]
            scored.append(self.act(actions))
        return float(np.mean(scored))

    def by(self, network: Network) -> float:
        """Share of the network's best shots that score."""
        scored = []
        for _ in range(LOOK_STEPS):
            positions, mirrored = self.positions()
            scored.append(self.shoot(network(positions).argmax(axis=1), mirrored))
        return float(np.mean(scored))


def ghost_ball(seen: Array) -> float:
    """Where an action has to aim to pot a ball, by geometry alone: to come to where the ghost ball is, two radii behind
    the ball on the line to the pocket that forgives most. Full, where there is no way."""
    table, physics = bs.Table.pool_9ft(), bs.Physics.pool()
    reach = 0.5 * np.array([table.length, table.width]) + table.jaw_depth
    places = np.array(table.centre) + seen.reshape(2, 3)[:, :2] * reach
    scene = bs.Scene(places, names=("cue", "1"), table=table, physics=physics)
    ways = bs.goals.pocket(scene).directions(scene)
    if not ways:
        return 0.0
    x, y = places[1] - places[0]
    return float(np.clip(np.sin(ways[0].azimuth - np.arctan2(y, x)) * np.hypot(x, y) / (2.0 * physics.radius), -1, 1))


def learn(task: Task, updates: int, seed: int) -> tuple[list[int], list[float], dict[str, float]]:
    """Number of shots at each look, share that score then, and what others score."""
    random, play = np.random.default_rng(seed), Play(task, seed)
    others = {"random actions": play.by_chance()}
    if task.environment == "Pool":
        others["ghost ball"] = play.by_geometry()
    positions, _ = play.positions()
    network = Network(positions.shape[1], play.aims.size, random)
    rows = np.arange(TABLES)
    shots, scores = [0], [play.by(network)]
    for update in tqdm(range(updates), unit="update", disable=None):
        positions, mirrored = play.positions()
        promised = network(positions)
        zeal = LAST_ZEAL * min(update / (ZEAL_GROWS * updates), 1.0)
        tried = np.exp(zeal * promised).cumsum(axis=1)
        choices = (tried < tried[:, -1:] * random.random((TABLES, 1))).sum(axis=1)
        gradient = np.zeros_like(promised)
        gradient[rows, choices] = (play.shoot(choices, mirrored) - promised[rows, choices]) / TABLES
        network.climb(gradient, LEARNING_RATE * (1.0 - update / updates))
        if (update + 1) * LOOKS // updates > update * LOOKS // updates:
            shots.append((update + 1) * TABLES)
            scores.append(play.by(network))
    return shots, scores, others


def draw(title: str, shots: list[int], scores: list[float], others: dict[str, float], path: Path) -> None:
    """The curve."""
    figure = Figure(figsize=(8.0, 4.5), layout="constrained")
    axes = figure.subplots()
    axes.plot(np.array(shots) / 1e6, scores, color="tab:blue", label="what is learnt")
    for (name, score), style in zip(others.items(), ("--", ":")):
        axes.axhline(score, color="0.4", linestyle=style, label=name)
    axes.set(xlabel="shots (millions)", ylabel="share that score", ylim=(0.0, 1.0), title=title)
    axes.grid(alpha=0.3)
    figure.legend(loc="outside lower center", ncols=3)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Learn, draw, say how well it went."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("task", choices=TASKS, nargs="?", default="pot")
    parser.add_argument("--updates", type=int, help=f"of the network, {TABLES} shots each")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--plot", type=Path, metavar="F.png", help="default: docs/learn_TASK.png")
    options = parser.parse_args()
    task = TASKS[options.task]
    shots, scores, others = learn(task, options.updates or task.updates, options.seed)
    draw(task.title, shots, scores, others, options.plot or Path(f"docs/learn_{options.task}.png"))
    for name, score in others.items():
        print(f"{name}: {score:.2f} score")
    print(f"the network: {scores[0]:.2f} at first, {np.mean(scores[-5:]):.2f} after {shots[-1]} shots")


if __name__ == "__main__":
    main()
