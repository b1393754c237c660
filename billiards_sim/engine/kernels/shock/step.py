# SPDX-License-Identifier: Apache-2.0
"""A step of an island: the forces of its touches, integrated by the classical Runge-Kutta method of fourth order.

The cloth's friction is what it is at the start of the step. Each ball gets the parabola that has its place and its
velocity at the end. Friction between bodies acts there, with the normal impulse of the step.
"""

from __future__ import annotations

import math

from ..feature import normal_of, overlap_with
from ..kernel import kernel
from ..law.cushion import rub_at_cushion
from ..law.hertz import push_of
from ..law.throw import rub_pair
from ..motion import begin_motion, phase_of
from ..state import SLIDING, Ball, Constants, Stage, State, Touch
from .touch import direction_of, friction_of

KINK = 0.4 / (2.0 / 3.0 * 0.5**1.5 + 1.0 / 6.0)
KINK_DAMPING = 0.8 / (2.0 / 3.0 * 0.5**0.25 + 1.0 / 6.0) / KINK
"""What the forces of a contact are multiplied by where a step begins or ends with it. They grow as t^(3/2) and t^(1/4)
from there, which the method's nodes 0, 1/2, 1/2, 1 with weights 1/6, 1/3, 1/3, 1/6 do not integrate to 2/5 and 4/5."""


@kernel
def set_out(state: State, constants: Constants, i: int) -> None:
    """Begin a step of a ball: what it is at its start, and what the cloth does to it."""
    ball, stage = state.balls[i], state.stages[i]
    begin_motion(ball, phase_of(ball, constants), constants)
    stage.start_vx = ball.vx
    stage.start_vy = ball.vy
    stage.cloth_x = ball.ax
    stage.cloth_y = ball.ay
    ball.phase = SLIDING  # it moves, whatever it did


@kernel
def integrate(state: State, constants: Constants, touches: int, count: int, step: float) -> None:
    """Integrate over a step from the anchors on; the balls get parabolas that end where they are then, and as fast."""
    for c in range(touches):
        state.touches[c].step_x = 0.0
        state.touches[c].step_y = 0.0
    for k in range(count):
        stage = state.stages[state.members[k].ball]
        stage.dx = 0.0
        stage.dy = 0.0
        stage.ux = stage.start_vx
        stage.uy = stage.start_vy
    evaluate(state, constants, touches, count, step / 6.0)
    for k in range(count):
        stage = state.stages[state.members[k].ball]
        stage.before_x, stage.before_y = stage.fx, stage.fy
        stage.place_x, stage.place_y = stage.fx, stage.fy
        stage.speed_x, stage.speed_y = stage.fx, stage.fy
        stage.dx = 0.5 * step * stage.start_vx
        stage.dy = 0.5 * step * stage.start_vy
        stage.ux = stage.start_vx + 0.5 * step * stage.fx
        stage.uy = stage.start_vy + 0.5 * step * stage.fy
    evaluate(state, constants, touches, count, step / 3.0)
    for k in range(count):
        stage = state.stages[state.members[k].ball]
        _sum(stage, 2.0)
        stage.dx = 0.5 * step * (stage.start_vx + 0.5 * step * stage.before_x)
        stage.dy = 0.5 * step * (stage.start_vy + 0.5 * step * stage.before_y)
        stage.ux = stage.start_vx + 0.5 * step * stage.fx
        stage.uy = stage.start_vy + 0.5 * step * stage.fy
        stage.before_x, stage.before_y = stage.fx, stage.fy
    evaluate(state, constants, touches, count, step / 3.0)
    for k in range(count):
        stage = state.stages[state.members[k].ball]
        _sum(stage, 2.0)
        stage.dx = step * (stage.start_vx + 0.5 * step * stage.before_x)
        stage.dy = step * (stage.start_vy + 0.5 * step * stage.before_y)
        stage.ux = stage.start_vx + step * stage.fx
        stage.uy = stage.start_vy + step * stage.fy
    evaluate(state, constants, touches, count, step / 6.0)
    for k in range(count):
        i = state.members[k].ball
        _bend(state.balls[i], state.stages[i], step)


@kernel
def evaluate(state: State, constants: Constants, touches: int, count: int, weight: float) -> None:
    """Accelerations of an island's balls at a stage; the impulses of its touches grow by theirs, weighted."""
    state.clock[0].work += touches
    for k in range(count):
        stage = state.stages[state.members[k].ball]
        stage.fx = stage.cloth_x
        stage.fy = stage.cloth_y
    for c in range(touches):
        touch = state.touches[c]
        first, one = state.balls[touch.first], state.stages[touch.first]
        if touch.second < 0:
            nx, ny = normal_of(state, -1 - touch.second, first.x + one.dx, first.y + one.dy)
            depth = overlap_with(state, -1 - touch.second, first.x + one.dx, first.y + one.dy)
            if depth > 0.0:
                push = _push(touch, depth, -(one.ux * nx + one.uy * ny), constants.rail_damping, constants)
                touch.step_x += weight * push * nx
                touch.step_y += weight * push * ny
                one.fx += push * nx
                one.fy += push * ny
            continue
        second, two = state.balls[touch.second], state.stages[touch.second]
        qx = first.x - second.x + (one.dx - two.dx)
        qy = first.y - second.y + (one.dy - two.dy)
        distance = math.sqrt(qx * qx + qy * qy)
        depth = 2.0 * constants.radius - distance
        if depth > 0.0:
            nx, ny = qx / distance, qy / distance
            rate = (two.ux - one.ux) * nx + (two.uy - one.uy) * ny
            push = _push(touch, depth, rate, constants.ball_damping, constants)
            touch.step_x += weight * push * nx
            touch.step_y += weight * push * ny
            one.fx += push * nx
            one.fy += push * ny
            two.fx -= push * nx
            two.fy -= push * ny


@kernel
def _push(touch: Touch, depth: float, rate: float, damping: float, constants: Constants) -> float:
    if touch.kink:
        return KINK * push_of(depth, KINK_DAMPING * rate, damping, constants)
    return push_of(depth, rate, damping, constants)


@kernel
def _sum(stage: Stage, weight: float) -> None:
    stage.place_x += stage.fx
    stage.place_y += stage.fy
    stage.speed_x += weight * stage.fx
    stage.speed_y += weight * stage.fy


@kernel
def _bend(ball: Ball, stage: Stage, step: float) -> None:
    # With w the mean velocity over the step and u that at its end, the parabola has a = 2 (u - w)/h and v = u - a h.
    mean_x = stage.start_vx + step / 6.0 * stage.place_x
    mean_y = stage.start_vy + step / 6.0 * stage.place_y
    end_x = stage.start_vx + step / 6.0 * (stage.speed_x + stage.fx)
    end_y = stage.start_vy + step / 6.0 * (stage.speed_y + stage.fy)
    ball.ax = 2.0 * (end_x - mean_x) / step
    ball.ay = 2.0 * (end_y - mean_y) / step
    ball.vx = end_x - ball.ax * step
    ball.vy = end_y - ball.ay * step


@kernel
def rub_touches(state: State, constants: Constants, touches: int) -> None:
    """Friction with the impulses of a step, of all contacts at once: each acts on the slip that was there."""
    for c in range(touches):
        touch = state.touches[c]
        touch.impulse_x += touch.step_x
        touch.impulse_y += touch.step_y
        touch.along = 0.0
        touch.over = 0.0
        if touch.friction > 0.0:
            nx, ny = direction_of(state, touch)
            pressed = touch.step_x * nx + touch.step_y * ny
            touch.along, touch.over = friction_of(state, touch, nx, ny, pressed, constants)
        touch.step_x = 0.0
        touch.step_y = 0.0
    for c in range(touches):
        touch = state.touches[c]
        if touch.along != 0.0 or touch.over != 0.0:
            nx, ny = direction_of(state, touch)
            first = state.balls[touch.first]
            if touch.second < 0:
                rub_at_cushion(first, nx, ny, touch.along, touch.over, constants)
            else:
                rub_pair(first, state.balls[touch.second], nx, ny, touch.along, touch.over, constants.radius)
