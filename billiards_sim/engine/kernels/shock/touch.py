# SPDX-License-Identifier: Apache-2.0
"""Who presses whom: touches of balls with each other and with what stands on the table, as rows of a table.

An island is a ball with all whom it touches, and all whom those touch.
"""

from __future__ import annotations

import math

from ..bounce import count_impact
from ..feature import normal_of, overlap_with
from ..kernel import kernel
from ..law.cushion import slip_at_cushion
from ..law.hertz import contact_duration
from ..law.throw import friction_at, rubs, slip_of_pair
from ..log import log_impact
from ..motion import mark, place_at, velocity_at
from ..state import QUEUED, Ball, Constants, State, Touch

SLOW = 0.01
"""m/s. Bodies that approach more slowly have no shock to pass on: they stay rigid (4e-6 m/s in a break)."""

LOOK = 5e-3
"""m. Nobody comes this far in a step, at light's speed excepted."""


@kernel
def takes_time(state: State, constants: Constants, i: int, j: int, approach: float) -> bool:
    """Whether ball i and ball j, or feature -1 - j, which meet at a speed, m/s, press each other for a while."""
    if constants.stiffness == 0.0:
        return False
    return approach > SLOW or presses_for_a_while(state, i, j)


@kernel
def presses_for_a_while(state: State, i: int, j: int) -> bool:
    """Whether ball i, or ball j, is in an elastic contact; j may be a feature, -1 - j."""
    return state.balls[i].touches > 0 or (j >= 0 and state.balls[j].touches > 0)


@kernel
def add_touch(state: State, constants: Constants, i: int, j: int) -> Touch:
    """Let ball i and ball j, or feature -1 - j, which are at the present, touch from now on."""
    clock = state.clock[0]
    touch = state.touches[clock.touches]
    clock.touches += 1
    touch.first = i
    touch.second = j
    touch.alone = False
    touch.impulse_x = 0.0
    touch.impulse_y = 0.0
    touch.step_x = 0.0
    touch.step_y = 0.0
    _enter(state, i)
    if j >= 0:
        _enter(state, j)
    touch.approach = max(-opening_of(state, touch), 0.0)
    touch.normal_x, touch.normal_y = direction_of(state, touch)
    along, over = _slip(state, touch, touch.normal_x, touch.normal_y, constants)
    slip = math.sqrt(along * along + over * over)
    if j >= 0:
        touch.friction = friction_at(slip, constants) if rubs(constants) else 0.0
    else:
        touch.friction = constants.rail_friction / constants.nose_cosine
    return touch


@kernel
def _enter(state: State, i: int) -> None:
    # Ball i, which is at the present, begins to touch somebody: a step is due.
    ball = state.balls[i]
    mark(state, i)
    ball.touches += 1
    ball.phase_end = ball.time
    state.stages[i].slow = False


@kernel
def drop_touch(state: State, constants: Constants, c: int, now: float) -> None:
    """Log the touch in row c and forget it."""
    clock = state.clock[0]
    touch = state.touches[c]
    i, j = touch.first, touch.second
    state.balls[i].touches -= 1
    if j >= 0:
        state.balls[j].touches -= 1
    impulse = math.sqrt(touch.impulse_x * touch.impulse_x + touch.impulse_y * touch.impulse_y)
    if touch.impulse_x * touch.normal_x + touch.impulse_y * touch.normal_y > 0.0:
        nx, ny = touch.impulse_x / impulse, touch.impulse_y / impulse
        log_impact(state, constants, now, i, j, nx, ny, touch.approach, constants.mass * impulse)
        count_impact(state.balls[i], touch.approach, constants)
        if j >= 0:
            count_impact(state.balls[j], touch.approach, constants)
    if state.balls[i].touches == 0:
        state.balls[i].vz = 0.0
    if j >= 0 and state.balls[j].touches == 0:
        state.balls[j].vz = 0.0
    clock.touches -= 1
    for k in range(c, clock.touches):
        _copy(state.touches[k + 1], state.touches[k])


@kernel
def forget_touches(state: State, constants: Constants, i: int, now: float) -> None:
    """End the elastic contacts of a ball that is taken away."""
    if state.balls[i].touches == 0:
        return
    for c in range(state.clock[0].touches - 1, -1, -1):
        touch = state.touches[c]
        if touch.first == i or touch.second == i:
            drop_touch(state, constants, c, now)


@kernel
def gather(state: State, i: int) -> tuple[int, int]:
    """Bring the touches of the island of ball i to the front of their list.

    Returns their number and that of its balls, which are listed as members.
    """
    balls, touches = state.balls, state.touches
    state.members[0].ball = i
    balls[i].member = QUEUED
    count = 1
    found = 0
    done = 0
    while done < count:
        ball = state.members[done].ball
        done += 1
        for c in range(found, state.clock[0].touches):
            if ball not in (touches[c].first, touches[c].second):
                continue
            _swap(state, c, found)
            first, second = touches[found].first, touches[found].second
            found += 1
            other = second if first == ball else first
            if other >= 0 and balls[other].member == 0:
                balls[other].member = QUEUED
                state.members[count].ball = other
                count += 1
    for k in range(count):
        balls[state.members[k].ball].member = 0
    return found, count


@kernel
def _swap(state: State, a: int, b: int) -> None:
    if a != b:
        spare = state.touches[len(state.touches) - 1]
        _copy(state.touches[a], spare)
        _copy(state.touches[b], state.touches[a])
        _copy(spare, state.touches[b])


@kernel
def _copy(touch: Touch, to: Touch) -> None:
    to.first = touch.first
    to.second = touch.second
    to.alone = touch.alone
    to.approach = touch.approach
    to.normal_x = touch.normal_x
    to.normal_y = touch.normal_y
    to.friction = touch.friction
    to.turn = touch.turn
    to.parting = touch.parting
    to.impulse_x = touch.impulse_x
    to.impulse_y = touch.impulse_y
    to.step_x = touch.step_x
    to.step_y = touch.step_y
    to.kink = touch.kink
    to.along = touch.along
    to.over = touch.over


@kernel
def is_touching(state: State, i: int, j: int) -> bool:
    """Whether balls i and j are in touch."""
    for c in range(state.clock[0].touches):
        first, second = state.touches[c].first, state.touches[c].second
        if (first == i and second == j) or (first == j and second == i):
            return True
    return False


@kernel
def is_pushed_by(state: State, i: int, k: int) -> bool:
    """Whether ball i touches feature k, or what stands there as part of the same edge."""
    for c in range(state.clock[0].touches):
        touch = state.touches[c]
        if touch.first == i and touch.second < 0 and are_of_one_edge(state, k, -1 - touch.second, state.balls[i]):
            return True
    return False


@kernel
def are_of_one_edge(state: State, k: int, other: int, ball: Ball) -> bool:
    """Whether features are the same, or a nose, a point and a jaw that follow each other.

    A ball is pushed by one edge in one direction. Two edges push at right angles, or against each other.
    """
    if k == other:
        return True
    ax, ay = normal_of(state, k, ball.x, ball.y)
    bx, by = normal_of(state, other, ball.x, ball.y)
    return ax * bx + ay * by > 0.0


@kernel
def depth_of(state: State, constants: Constants, touch: Touch) -> float:
    """How far two bodies press each other, m; negative where they do not touch."""
    first = state.balls[touch.first]
    if touch.second < 0:
        return overlap_with(state, -1 - touch.second, first.x, first.y)
    second = state.balls[touch.second]
    dx, dy = first.x - second.x, first.y - second.y
    return 2.0 * constants.radius - math.sqrt(dx * dx + dy * dy)


@kernel
def direction_of(state: State, touch: Touch) -> tuple[float, float]:
    """Unit normal of a touch, towards its first ball."""
    if touch.second < 0:
        ball = state.balls[touch.first]
        return normal_of(state, -1 - touch.second, ball.x, ball.y)
    first, second = state.balls[touch.first], state.balls[touch.second]
    dx, dy = first.x - second.x, first.y - second.y
    distance = math.sqrt(dx * dx + dy * dy)
    return dx / distance, dy / distance


@kernel
def opening_of(state: State, touch: Touch) -> float:
    """Speed at which two bodies part, m/s."""
    nx, ny = direction_of(state, touch)
    first = state.balls[touch.first]
    speed = first.vx * nx + first.vy * ny
    if touch.second >= 0:
        second = state.balls[touch.second]
        speed -= second.vx * nx + second.vy * ny
    return speed


@kernel
def share_of(touch: Touch) -> float:
    """Mass of a ball over the reduced mass."""
    return 2.0 if touch.second >= 0 else 1.0


@kernel
def longest_of(j: int, approach: float, constants: Constants) -> float:
    """How long a ball presses ball j, or feature -1 - j, at the most."""
    if j >= 0:
        return contact_duration(approach, 2.0, constants.duration_factor, constants)
    return contact_duration(approach, 1.0, constants.rail_duration_factor, constants)


@kernel
def way_to(state: State, constants: Constants, i: int, j: int, now: float) -> tuple[float, float, float]:
    """From ball i, which is at `now`, to ball j: m between them, m/s at which that closes, and m/s^2."""
    ball, other = state.balls[i], state.balls[j]
    x, y = place_at(other, now)
    dx, dy = ball.x - x, ball.y - y
    square = dx * dx + dy * dy
    reach = 2.0 * constants.radius + LOOK
    if square > reach * reach:
        return LOOK, 0.0, 0.0
    distance = math.sqrt(square)
    vx, vy = velocity_at(other, now)
    ax, ay = other.ax, other.ay
    if other.touches > 0:
        vx, vy = state.stages[j].start_vx, state.stages[j].start_vy
        ax, ay = state.stages[j].fx, state.stages[j].fy
        if other.phase_end <= now:
            vx, vy = other.vx, other.vy
    closing = ((vx - ball.vx) * dx + (vy - ball.vy) * dy) / distance
    faster = ((ax - state.stages[i].fx) * dx + (ay - state.stages[i].fy) * dy) / distance
    return distance - 2.0 * constants.radius, closing, faster


@kernel
def _slip(state: State, touch: Touch, nx: float, ny: float, constants: Constants) -> tuple[float, float]:
    first = state.balls[touch.first]
    if touch.second < 0:
        return slip_at_cushion(first, nx, ny, constants)
    return slip_of_pair(first, state.balls[touch.second], nx, ny, constants.radius)


@kernel
def friction_of(
    state: State, touch: Touch, nx: float, ny: float, pressed: float, constants: Constants
) -> tuple[float, float]:
    """Tangential impulse per mass, m/s, of a contact whose normal impulse per mass is `pressed`."""
    along, over = _slip(state, touch, nx, ny, constants)
    slip = math.sqrt(along * along + over * over)
    if slip == 0.0 or pressed <= 0.0:
        return 0.0, 0.0
    part = min(1.0 / 7.0 if touch.second >= 0 else 2.0 / 7.0, touch.friction * pressed / slip)
    return -part * along, -part * over
