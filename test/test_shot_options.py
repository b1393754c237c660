# SPDX-License-Identifier: Apache-2.0
"""The options of a shot, which `shoot` and `simulate` share."""

from __future__ import annotations

import argparse
import math
import re

import pytest

import billiards_sim as bs
from billiards_sim.engine.aim import Aim
from billiards_sim.engine.scene import Shot
from billiards_sim.shot_options import add_shot_options, angle, shot_asked_for


def asked(*arguments: str) -> Aim | Shot | None:
    parser = argparse.ArgumentParser()
    add_shot_options(parser)
    return shot_asked_for(parser.parse_args(arguments))


@pytest.mark.parametrize(
    ("text", "value"), [("12deg", math.pi / 15), ("-90deg", -math.pi / 2), ("0.2rad", 0.2), ("-1e-3rad", -1e-3)]
)
def test_an_angle_has_its_unit(text: str, value: float) -> None:
    assert angle(text) == pytest.approx(value, abs=1e-15)


@pytest.mark.parametrize("text", ["12", "deg", "12grad", "nandeg", "infrad", "12 degrees", ""])
def test_an_angle_without_a_unit_is_refused(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="must be an angle with its unit"):
        angle(text)


def test_words_a_force_or_nothing() -> None:
    assert asked("--speed", "3", "--angle", "90deg", "--up", "0.5") == Aim(3.0, 0.5 * math.pi, 0.0, 0.5)
    elevated = asked("--speed", "3", "--angle", "90deg", "--side", "0.1", "--elevation", "30deg")
    assert elevated == Aim(3.0, 0.5 * math.pi, 0.1, elevation=math.radians(30.0))
    assert asked("--force", "80", "1", "--offset", "0.01", "0") == Shot((80.0, 1.0, 0.0), (0.01, 0.0))
    assert asked("--force", "80", "1") == Shot((80.0, 1.0, 0.0))
    assert asked() is None


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("--speed", "3", "--angle", "1deg", "--force", "1", "0"), "--speed does not go with --force"),
        (("--side", "0.1", "--offset", "0", "0"), "--side does not go with --force and --offset"),
        (("--elevation", "5deg", "--force", "1", "0"), "--elevation does not go with --force and --offset"),
        (("--elevation", "5deg"), "--speed and --angle belong together"),
        (
            ("--speed", "3", "--angle", "3deg", "--elevation", "90deg"),
            "elevation must be >= 0 and < pi/2 rad, got 1.57",
        ),
        (("--speed", "3", "--angle", "3deg", "--elevation=-5deg"), "elevation must be >= 0"),
        (("--speed", "3"), "--speed and --angle belong together"),
        (("--angle", "3deg"), "--speed and --angle belong together"),
        (("--up", "0.1"), "--speed and --angle belong together"),
        (("--offset", "0", "0"), "--offset needs --force"),
        (("--speed", "nan", "--angle", "3deg"), "speed must be a finite number"),
        (("--speed", "3", "--angle", "3deg", "--side", "1"), "together < 1 radius"),
    ],
)
def test_half_a_shot_or_two_are_refused(arguments: tuple[str, ...], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        asked(*arguments)


def test_the_help_says_how_fast_a_force_is_on_the_pool_table() -> None:
    parser = argparse.ArgumentParser()
    add_shot_options(parser)
    said = " ".join(parser.format_help().split())
    (found,) = re.findall(r"; (\S+) (\S+) gives (\S+) m/s along x with the physics of pool", said)
    force_x, force_y, speed = map(float, found)
    simulation = bs.Simulation(bs.scenes.eight_ball())
    simulation.strike((force_x, force_y, 0.0))
    assert simulation.velocities[0] == pytest.approx((speed, 0.0), abs=1e-12)
