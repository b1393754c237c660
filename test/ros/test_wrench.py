# SPDX-License-Identifier: Apache-2.0
import math
import re

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from hypothesis import given
from hypothesis import strategies as st

import billiards_sim as bs
from billiards_sim.engine.aim import Aim
from billiards_sim.ros.wrench import TORQUE_TOLERANCE, shot_from_wrench, wrench_from_shot

RADIUS = bs.Physics().radius

sizes = st.floats(0.1, 1000.0)
angles = st.floats(-math.pi, math.pi)
offsets = st.floats(-0.02, 0.02)


def message_of(force: tuple, torque: tuple, frame: str = "table") -> WrenchStamped:
    message = WrenchStamped()
    message.header.frame_id = frame
    for vector, values in ((message.wrench.force, force), (message.wrench.torque, torque)):
        vector.x, vector.y, vector.z = (float(value) for value in values)
    return message


def torque_about_centre(force: np.ndarray, side: float, up: float) -> np.ndarray:
    ahead = force / np.linalg.norm(force)
    left = np.cross((0.0, 0.0, 1.0), ahead)
    left /= np.linalg.norm(left)
    behind = math.sqrt(RADIUS**2 - side**2 - up**2)
    return np.cross(-behind * ahead + side * left + up * np.cross(ahead, left), force)


def raised(size: float, angle: float, elevation: float) -> np.ndarray:
    """A force of this size whose cue is raised by the elevation."""
    level = size * math.cos(elevation)
    return np.array((level * math.cos(angle), level * math.sin(angle), -size * math.sin(elevation)))


@given(sizes, angles, offsets, offsets)
def test_torque_of_the_contact_point_gives_its_offset(size: float, angle: float, side: float, up: float) -> None:
    force = np.array((size * math.cos(angle), size * math.sin(angle), 0.0))
    shot = shot_from_wrench(message_of(tuple(force), tuple(torque_about_centre(force, side, up))), "table")
    assert shot.ball == "cue"
    assert shot.force == tuple(force)
    assert shot.offset == pytest.approx((side, up), abs=1e-15)


@given(sizes, angles, offsets, offsets)
def test_wrench_of_a_shot_is_the_torque_of_its_contact_point(size: float, angle: float, side: float, up: float) -> None:
    force = np.array((size * math.cos(angle), size * math.sin(angle), 0.0))
    torque = wrench_from_shot(tuple(force), (side, up)).wrench.torque
    assert (torque.x, torque.y, torque.z) == pytest.approx(torque_about_centre(force, side, up), abs=1e-14 * size)


elevations = st.floats(0.0, math.radians(80.0))


@given(sizes, angles, elevations, offsets, offsets)
def test_torque_under_a_raised_butt_gives_its_offset(
    size: float, angle: float, elevation: float, side: float, up: float
) -> None:
    force = raised(size, angle, elevation)
    shot = shot_from_wrench(message_of(tuple(force), tuple(torque_about_centre(force, side, up))), "table")
    assert shot.force == tuple(force)
    assert shot.offset == pytest.approx((side, up), abs=1e-14)


@given(sizes, angles, elevations, offsets, offsets)
def test_wrench_of_a_raised_shot_is_the_torque_of_its_contact_point(
    size: float, angle: float, elevation: float, side: float, up: float
) -> None:
    force = raised(size, angle, elevation)
    wrench = wrench_from_shot(tuple(force), (side, up)).wrench
    torque = (wrench.torque.x, wrench.torque.y, wrench.torque.z)
    assert (wrench.force.x, wrench.force.y, wrench.force.z) == tuple(force)
    assert torque == pytest.approx(torque_about_centre(force, side, up), abs=1e-14 * size)


@given(sizes, angles, st.sampled_from((0.0, 0.1, 0.8, 1.2)), st.integers(-28, 28), st.integers(-28, 28))
def test_decimal_offsets_come_back_to_the_bit(size: float, angle: float, elevation: float, side: int, up: int) -> None:
    force = tuple(raised(size, angle, elevation).tolist())
    shot = shot_from_wrench(wrench_from_shot(force, (side / 1000, up / 1000)), "table")
    assert shot.offset == (side / 1000, up / 1000)


def test_a_raised_shot_over_ros_is_the_one_in_words() -> None:
    physics = bs.Physics.pool()
    shot = Aim(3.0, 0.7, 0.25, -0.3, math.radians(40.0)).shot(physics)
    struck = [bs.Simulation(bs.Scene([[1.0, 0.6]], physics=physics)) for _ in range(2)]
    struck[0].shoot(3.0, 0.7, 0.25, -0.3, math.radians(40.0))
    heard = shot_from_wrench(wrench_from_shot(shot.force, shot.offset), "table")
    struck[1].strike(heard.force, heard.offset)
    assert np.array_equal(struck[0].velocities, struck[1].velocities)
    assert struck[0].angular_velocities == pytest.approx(struck[1].angular_velocities, rel=1e-13)


def test_an_empty_frame_is_the_tables() -> None:
    assert shot_from_wrench(message_of((80, 0, 0), (0, 0, 0), frame=""), "table").offset == (0.0, 0.0)


def test_torque_typed_with_few_decimals_is_taken() -> None:
    force = np.array((69.282, 40.0, 0.0))
    torque = np.round(torque_about_centre(force, 0.0, 0.01), 4)
    assert shot_from_wrench(message_of(tuple(force), tuple(torque)), "table").offset == pytest.approx(
        (0.0, 0.01), abs=1e-6
    )


nan, inf = math.nan, math.inf

BAD = [
    (message_of((80, 0, 0), (0, 0, 0), frame="map"), "'map'"),
    *((message_of((value, 0, 0), (0, 0, 0)), "force must be finite") for value in (nan, inf, -inf)),
    (message_of((80, nan, 0), (0, 0, 0)), "force must be finite"),
    (message_of((80, 0, inf), (0, 0, 0)), "force must be finite"),
    *((message_of((80, 0, 0), torque), "torque must be finite") for torque in ((nan, 0, 0), (0, inf, 0), (0, 0, nan))),
    (message_of((80, 0, 1e-9), (0, 0, 0)), "force z must be <= 0: a cue does not lift the ball; got 1e-09 N"),
    (message_of((0, 0, -5), (0, 0, 0)), "force must not be zero along the table"),
    (message_of((0, 0, 0), (0, 0, 0)), "force must not be zero"),
    (message_of((0, 0, 0), (0, 0.1, 0)), "force must not be zero"),
    (message_of((80, 0, 0), (0.1, 0, 0)), "it is 0.1 N m, allowed up to 0.0008 N m"),
    (message_of((0, 80, 0), (0, -0.1, 0)), "it is -0.1 N m"),
    (message_of((60, 0, -80), (0.06, 0, -0.08)), "it is 0.1 N m, allowed up to 0.001 N m"),
    (message_of((5e-324, 0, 0), (0, 0, 1)), "torque over force must be finite"),
]


@pytest.mark.parametrize(("message", "reason"), BAD)
def test_bad_wrenches_are_refused_with_the_reason(message: WrenchStamped, reason: str) -> None:
    with pytest.raises(ValueError, match=re.escape(reason)):
        shot_from_wrench(message, "table")


def test_a_torque_that_is_along_the_table_may_be_one_of_a_raised_butt() -> None:
    # 3-4-5: z' leans forward by 0.8, so 0.01 m to the left gives 0.8 N m against the way the cue points.
    shot = shot_from_wrench(message_of((60, 0, -80), (-0.8, 0, -0.6)), "table")
    assert shot.offset == pytest.approx((0.01, 0.0), abs=1e-16)


def test_the_tolerance_is_the_bound() -> None:
    shot_from_wrench(message_of((80, 0, 0), (0.99 * 80 * TORQUE_TOLERANCE, 0, 0)), "table")
    with pytest.raises(ValueError, match="torque along the force"):
        shot_from_wrench(message_of((80, 0, 0), (1.01 * 80 * TORQUE_TOLERANCE, 0, 0)), "table")
