# SPDX-License-Identifier: Apache-2.0
"""Environments to learn in, for Gymnasium: importing this module registers `billiards_sim/Pool-v0` and
`billiards_sim/SumToThree-v0`."""

from __future__ import annotations

try:
    from gymnasium.envs.registration import register, registry
except ImportError:
    raise ImportError("billiards_sim.gym needs Gymnasium: pip install 'billiards_sim[gym]'") from None

from billiards_sim.gym.environments import PoolEnv, SumToThreeEnv
from billiards_sim.gym.vector import PoolVectorEnv, SumToThreeVectorEnv

__all__ = ["PoolEnv", "PoolVectorEnv", "SumToThreeEnv", "SumToThreeVectorEnv"]

SHOTS = 10
"""Of an episode, after which it is truncated."""

for _name in ("Pool", "SumToThree"):
    if f"billiards_sim/{_name}-v0" not in registry:  # a module may be loaded anew
        register(
            id=f"billiards_sim/{_name}-v0",
            entry_point=f"billiards_sim.gym.environments:{_name}Env",
            vector_entry_point=f"billiards_sim.gym.vector:{_name}VectorEnv",
            max_episode_steps=SHOTS,
        )
