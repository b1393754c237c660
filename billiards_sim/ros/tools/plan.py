# SPDX-License-Identifier: Apache-2.0
"""`plan --ros`: the best shots for the balls that lie on a running table, and the best one shot there."""

from __future__ import annotations

import argparse

import numpy as np
from sensor_msgs.msg import MultiDOFJointState

from billiards_sim.command_line import FAILED, Refusal, say
from billiards_sim.engine.scene import Scene
from billiards_sim.ros import parameters
from billiards_sim.ros.process import own_arguments, ros
from billiards_sim.ros.tools.shoot import LONGEST_REST, NoAnswer, Shooter
from billiards_sim.ros.wrench import wrench_from_shot
from billiards_sim.study.plan import TIMEOUT, check_outputs, parser, plan, write


def plan_and_shoot(arguments: list[str]) -> int:
    """Plan once for the running table; returns the exit code.

    Raises:
        Ending: it came to another end.
    """
    options = parser().parse_args(own_arguments("plan", arguments))
    if options.scene is not None:
        raise Refusal(f"--ros plans for the balls on the running table: leave out {options.scene!r}")
    check_outputs(options)
    with ros("plan", arguments):
        return _play(options)


def _play(options: argparse.Namespace) -> int:
    table = Shooter(options.timeout or TIMEOUT, "plan")
    table.wait_for_rest(LONGEST_REST)
    scene = _scene(table)
    made = plan(scene, options)
    write(made, options)
    if not options.shoot:
        return 0
    table.begin_anew()
    if _places(table.states()) != dict(zip(scene.names, scene.positions.tolist())):
        raise NoAnswer("somebody moved the balls while the plan was made: plan again")
    answer = table.shoot(wrench_from_shot(made.best.force, made.best.offset))
    if not answer["accepted"]:
        say(f"plan: refused: {answer['reason']}")
        return FAILED
    say(f"plan: shot 1 accepted at {answer['time']:.3f} s of the table's time")
    return 0


def _scene(table: Shooter) -> Scene:
    # The balls in play, as they lie; one that is off the table changes nothing.
    values = table.parameters(*parameters.GROUP_QUANTITIES)
    places = _places(table.states())
    try:
        groups = parameters.read_groups(dict(zip(parameters.GROUP_QUANTITIES, values)))
        return Scene(np.array(list(places.values())).reshape(-1, 2), names=tuple(places), **groups)
    except ValueError as error:
        raise NoAnswer(f"what listens on cue_shot is not a table to plan for: {error}") from None


def _places(message: MultiDOFJointState) -> dict[str, list[float]]:
    places = (transform.translation for transform in message.transforms)
    return {name: [place.x, place.y] for name, place in zip(message.joint_names, places)}
