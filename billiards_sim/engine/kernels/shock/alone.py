# SPDX-License-Identifier: Apache-2.0
"""A pair that nobody else can reach while it presses: no steps, but the closed form of `law.hertz`, to where it parts.

So does a ball alone at a nose or a jaw: it presses for t_c, goes on along it meanwhile, and parts by the rigid laws of
the cushion. What the cloth does along the normal is left out there: a constant force does no work on a way that ends
where it began.
"""

from __future__ import annotations

import math

from ..cells import first_neighbour, next_neighbour
from ..feature import next_feature, overlap_with
from ..impact import collide_feature
from ..kernel import kernel
from ..law.hertz import lone_pair
from ..law.throw import rub_pair
from ..state import ARC, NOBODY, OFF_TABLE, Ball, Constants, State, Touch
from .step import set_out
from .touch import are_of_one_edge, friction_of, longest_of


@kernel
def has_company(state: State, constants: Constants, i: int, j: int, approach: float) -> bool:
    """Whether anybody else can touch ball i or j while they press each other, or there is no closed form."""
    if constants.integrates_all or (j < 0 and state.features[-1 - j].kind == ARC):
        return True
    duration = longest_of(j, approach, constants)
    if _is_reached(state, constants, i, j, duration):
        return True
    return j >= 0 and _is_reached(state, constants, j, i, duration)


@kernel
def _is_reached(state: State, constants: Constants, i: int, j: int, duration: float) -> bool:
    # Whether ball i can touch anybody but j within a duration. It gets no faster than both are together.
    mine = state.balls[i]
    fastest = math.sqrt(mine.vx * mine.vx + mine.vy * mine.vy)
    if j >= 0:
        partner = state.balls[j]
        fastest += math.sqrt(partner.vx * partner.vx + partner.vy * partner.vy)
    k = next_feature(state, NOBODY, mine.x, mine.y, fastest * duration)
    while k != NOBODY:
        met = -1 - k == j or (j < 0 and are_of_one_edge(state, k, -1 - j, mine))
        if not met and -overlap_with(state, k, mine.x, mine.y) <= fastest * duration:
            return True
        k = next_feature(state, k, mine.x, mine.y, fastest * duration)
    k = first_neighbour(state, constants, i)
    while k != NOBODY:
        if k not in (i, j) and state.balls[k].phase != OFF_TABLE:
            other = state.balls[k]
            age = mine.time - other.time
            dx = mine.x - other.x - (other.vx + 0.5 * other.ax * age) * age
            dy = mine.y - other.y - (other.vy + 0.5 * other.ay * age) * age
            speed = math.sqrt(other.vx * other.vx + other.vy * other.vy)
            reach = 2.0 * constants.radius + (fastest + speed) * duration
            if dx * dx + dy * dy <= reach * reach:
                return True
        k = next_neighbour(state, constants, i, k)
    return False


@kernel
def keep_together(state: State, constants: Constants, touch: Touch, now: float) -> None:
    """Let a pair, or a ball at a line, move on for as long as it presses, to where it parts."""
    touch.alone = True
    set_out(state, constants, touch.first)
    if touch.second < 0:
        _glide_along(state, constants, touch, now)
        return
    first, second = state.balls[touch.first], state.balls[touch.second]
    set_out(state, constants, touch.second)
    nx, ny = touch.normal_x, touch.normal_y
    across = (first.vy - second.vy) * nx - (first.vx - second.vx) * ny
    duration, touch.turn, touch.parting = lone_pair(touch.approach, across, constants)
    touch.along = 0.0
    touch.over = 0.0
    if touch.friction > 0.0:
        pressed = max(0.5 * (touch.approach + touch.parting - across * touch.turn), 0.0)
        touch.along, touch.over = friction_of(state, touch, nx, ny, pressed, constants)
        if touch.along != 0.0:
            rubbed = math.sqrt(touch.along * touch.along + touch.over * touch.over) / (touch.friction * pressed)
            touch.turn += (1.0 - 0.5 * rubbed) * touch.along * duration / constants.radius
    ex, ey = _turned(nx, ny, touch.turn)
    middle_x = 0.5 * (first.x + second.x + (first.vx + second.vx + 0.5 * (first.ax + second.ax) * duration) * duration)
    middle_y = 0.5 * (first.y + second.y + (first.vy + second.vy + 0.5 * (first.ay + second.ay) * duration) * duration)
    _glide(first, middle_x + constants.radius * ex, middle_y + constants.radius * ey, now, duration)
    _glide(second, middle_x - constants.radius * ex, middle_y - constants.radius * ey, now, duration)


@kernel
def _glide_along(state: State, constants: Constants, touch: Touch, now: float) -> None:
    ball = state.balls[touch.first]
    duration = longest_of(touch.second, touch.approach, constants)
    nx, ny = touch.normal_x, touch.normal_y
    way = ((ball.vy + 0.5 * ball.ay * duration) * nx - (ball.vx + 0.5 * ball.ax * duration) * ny) * duration
    _glide(ball, ball.x - way * ny, ball.y + way * nx, now, duration)


@kernel
def _glide(ball: Ball, x: float, y: float, now: float, duration: float) -> None:
    # Straight on to a place.
    ball.vx = (x - ball.x) / duration
    ball.vy = (y - ball.y) / duration
    ball.ax = 0.0
    ball.ay = 0.0
    ball.phase_end = now + duration


@kernel
def _turned(x: float, y: float, angle: float) -> tuple[float, float]:
    cosine, sine = math.cos(angle), math.sin(angle)
    return cosine * x - sine * y, sine * x + cosine * y


@kernel
def part(state: State, constants: Constants, touch: Touch, duration: float) -> None:
    """What a pair that was alone, or a ball at a line, does when it parts."""
    nx, ny = touch.normal_x, touch.normal_y
    first, one = state.balls[touch.first], state.stages[touch.first]
    if touch.second < 0:
        across = one.start_vy * nx - one.start_vx * ny + (one.cloth_y * nx - one.cloth_x * ny) * duration
        first.vx = -touch.approach * nx - across * ny
        first.vy = -touch.approach * ny + across * nx
        impulse = collide_feature(first, nx, ny, constants) / constants.mass
        touch.impulse_x = impulse * nx
        touch.impulse_y = impulse * ny
        return
    second, two = state.balls[touch.second], state.stages[touch.second]
    middle_vx = 0.5 * (one.start_vx + two.start_vx + (one.cloth_x + two.cloth_x) * duration)
    middle_vy = 0.5 * (one.start_vy + two.start_vy + (one.cloth_y + two.cloth_y) * duration)
    before_x, before_y = one.start_vx - two.start_vx, one.start_vy - two.start_vy
    across = before_y * nx - before_x * ny
    ex, ey = _turned(nx, ny, touch.turn)
    touch.impulse_x = 0.5 * (touch.parting * ex - across * ey - before_x)
    touch.impulse_y = 0.5 * (touch.parting * ey + across * ex - before_y)
    across += ((one.cloth_y - two.cloth_y) * nx - (one.cloth_x - two.cloth_x) * ny) * duration
    half_x, half_y = 0.5 * (touch.parting * ex - across * ey), 0.5 * (touch.parting * ey + across * ex)
    first.vx = middle_vx + half_x
    first.vy = middle_vy + half_y
    second.vx = middle_vx - half_x
    second.vy = middle_vy - half_y
    if touch.along != 0.0 or touch.over != 0.0:
        mx, my = _turned(nx, ny, 0.5 * touch.turn)
        rub_pair(first, second, mx, my, touch.along, touch.over, constants.radius)
