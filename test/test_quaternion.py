# SPDX-License-Identifier: Apache-2.0
"""Quaternions against rotation matrices, which compose by their own rule."""

import math

import numpy as np
import pytest

from billiards_sim.quaternion import IDENTITY, product, rotation_matrices, turned


def some(count: int, seed: int) -> np.ndarray:
    quaternions = np.random.default_rng(seed).normal(size=(count, 4))
    return quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)


def test_the_product_turns_as_the_matrices_one_after_the_other() -> None:
    later, earlier = some(100, 1), some(100, 2)
    expected = rotation_matrices(later) @ rotation_matrices(earlier)
    np.testing.assert_allclose(rotation_matrices(product(later, earlier)), expected, rtol=0.0, atol=1e-14)


def test_one_quaternion_multiplies_many() -> None:
    many, one = some(5, 3), some(1, 4)
    np.testing.assert_array_equal(product(many, one), product(many, np.tile(one, (5, 1))))


def test_a_quarter_turn_about_z_takes_x_to_y() -> None:
    level = np.array([IDENTITY])
    (matrix,) = rotation_matrices(turned(level, np.array([[0.0, 0.0, 0.5 * math.pi]]), 1.0))
    np.testing.assert_allclose(matrix @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], rtol=0.0, atol=1e-15)


@pytest.mark.parametrize("axis", range(3))
def test_angular_velocity_is_in_the_frame_of_the_table(axis: int) -> None:
    """A ball that is turned already turns on about an axis of the table, not one of its own."""
    before, spin = some(1, 5), 0.7 * np.eye(3)[[axis]]
    about = rotation_matrices(turned(np.array([IDENTITY]), spin, 2.0))
    np.testing.assert_allclose(
        rotation_matrices(turned(before, spin, 2.0)), about @ rotation_matrices(before), rtol=0.0, atol=1e-14
    )
