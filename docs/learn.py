# SPDX-License-Identifier: Apache-2.0
"""Learns sum to three from nothing, and draws how: REINFORCE with a baseline (Williams, Machine Learning 8, 1992).

A network with two layers says of a position what action is meant, how much is tried around it, and what reward to
expect. What brought more than that becomes more probable.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from matplotlib.figure import Figure
from tqdm import tqdm

import billiards_sim.gym  # noqa: F401

Array = np.ndarray[Any, np.dtype[np.float64]]

TABLES = 512
HIDDEN = 64
ACTIONS = 4
LEAST_SPREAD = 0.03
"""Of actions: below it, little new would be tried."""

LEARNING_RATE = 1e-3
CURIOSITY = 0.01
"""Reward of a spread that grows by e."""

LOOK_EVERY = 20
"""Updates between two looks at how well it plays without trying around."""


class Network:
    """Two layers of tanh; Adam (Kingma and Ba, 2015) follows the gradient."""

    def __init__(self, inputs: int, random: np.random.Generator) -> None:
        sizes = [inputs, HIDDEN, HIDDEN, 2 * ACTIONS + 1]
        self.weights = [random.standard_normal(shape) / np.sqrt(shape[0]) for shape in zip(sizes, sizes[1:])]
        self.weights[-1] *= 0.1
        self.biases = [np.zeros(size) for size in sizes[1:]]
        self._means = [np.zeros_like(part) for part in self.weights + self.biases]
        self._squares = [np.zeros_like(part) for part in self.weights + self.biases]
        self._steps = 0

    def __call__(self, positions: Array) -> tuple[Array, Array, Array]:
        """(M, 4) what is meant, (M, 4) the logarithm of the spread, (M,) what reward is expected."""
        self.layers = [positions]
        for weights, biases in zip(self.weights[:-1], self.biases[:-1]):
            self.layers.append(np.tanh(self.layers[-1] @ weights + biases))
        out = self.layers[-1] @ self.weights[-1] + self.biases[-1]
        spread = np.clip(out[:, ACTIONS:-1] - 1.0, np.log(LEAST_SPREAD), 0.0)
        return np.tanh(out[:, :ACTIONS]), spread, out[:, -1]

    def climb(self, gradient: Array) -> None:
        """Go uphill, with the gradient (M, 9) by the outputs of the last call."""
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
            part += (
                LEARNING_RATE * (mean / (1.0 - 0.9**self._steps)) / (np.sqrt(square / (1.0 - 0.99**self._steps)) + 1e-8)
            )


def learn(updates: int, seed: int) -> tuple[list[int], list[float], float]:
    """Number of shots at each look, share of them that score then, and that of random actions."""
    envs = gymnasium.make_vec(
        "billiards_sim/SumToThree-v0", TABLES, max_episode_steps=1, autoreset_mode="SameStep", random_start=True
    )
    random = np.random.default_rng(seed)
    seen, _ = envs.reset(seed=seed)
    seen, rewards, *_ = envs.step(random.uniform(-1.0, 1.0, (TABLES, ACTIONS)))
    by_chance = float(rewards.mean())
    network = Network(4, random)
    shots, scores = [], []
    for update in tqdm(range(updates + 1), unit="update", disable=None):
        if update % LOOK_EVERY == 0:
            seen, rewards, *_ = envs.step(network(_positions(seen))[0])
            shots.append(update * TABLES)
            scores.append(float(rewards.mean()))
        meant, spread, expected = network(_positions(seen))
        errors = random.standard_normal(meant.shape)
        seen, rewards, *_ = envs.step(np.clip(meant + np.exp(spread) * errors, -1.0, 1.0))
        surprise = rewards - expected
        gain = ((surprise - surprise.mean()) / (surprise.std() + 1e-8))[:, np.newaxis]
        by_meant = gain * errors / np.exp(spread) * (1.0 - meant**2)
        by_spread = gain * (errors**2 - 1.0) + CURIOSITY
        network.climb(np.column_stack((by_meant, by_spread, 2.0 * surprise)) / TABLES)
    return shots, scores, by_chance


def _positions(seen: Array) -> Array:
    # Both balls are always in play, which tells nothing.
    return seen.reshape(TABLES, 2, 3)[..., :2].reshape(TABLES, 4).astype(np.float64)


def draw(shots: list[int], scores: list[float], by_chance: float, path: Path) -> None:
    """The curve."""
    figure = Figure(figsize=(8.0, 4.5), layout="constrained")
    axes = figure.subplots()
    axes.plot(np.array(shots) / 1000.0, scores, color="tab:blue", label="what is learnt")
    axes.axhline(by_chance, color="0.5", linestyle="--", label="random actions")
    axes.set(xlabel="shots (thousands)", ylabel="share that score", ylim=(0.0, 1.0), title="Sum to three, one shot")
    axes.grid(alpha=0.3)
    axes.legend(loc="upper left")
    figure.savefig(path, dpi=110)


def main() -> None:
    """Learn, draw, say how well it went."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--updates", type=int, default=600, help=f"of the network, {TABLES} shots each (600)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--plot", type=Path, default=Path("docs/learn.png"), metavar="F.png")
    options = parser.parse_args()
    shots, scores, by_chance = learn(options.updates, options.seed)
    draw(shots, scores, by_chance, options.plot)
    print(f"random shots score {by_chance:.2f}, those of the network {scores[0]:.2f} at first and ", end="")
    print(f"{np.mean(scores[-5:]):.2f} after {shots[-1]} shots")


if __name__ == "__main__":
    main()
