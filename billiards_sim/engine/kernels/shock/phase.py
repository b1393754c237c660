# SPDX-License-Identifier: Apache-2.0
"""When touches begin and end, and how far a step goes.

A step is a part of the contact's duration at the speed that its energy stands for, and ends where a contact is about to
begin or to end: the force has a kink there. What comes in the middle of a step has the step integrated again from its
start up to there.

An island ends when nothing in it touches. What friction presses together never parts: where all contacts are slow the
rigid rules take over.
"""

from __future__ import annotations

import math

from ..cells import first_neighbour, next_neighbour
from ..feature import is_clear, next_feature, normal_of, overlap_with
from ..island import release_ball
from ..kernel import kernel
from ..law.hertz import contact_duration, free_speed
from ..motion import anchor, mark
from ..settle import advance_to as settle_to
from ..state import INF, NOBODY, OFF_TABLE, Constants, State, Touch
from .alone import has_company, keep_together, part
from .apart import leans_on_others, separate
from .step import evaluate, integrate, rub_touches, set_out
from .touch import (
    LOOK,
    SLOW,
    add_touch,
    depth_of,
    direction_of,
    drop_touch,
    gather,
    is_pushed_by,
    is_touching,
    longest_of,
    opening_of,
    share_of,
    way_to,
)

AT_TOUCH = 0.01
"""Of its own step: a contact that is no older begins with the step."""

ELASTIC_FACTOR = 2.9433
"""f of `law.hertz` without damping."""

LONGEST = 1e-4
"""s. Of a step in which nothing presses."""

OFF_BY = 1e-7
"""m. What the parabola of a step may be off by between its ends: 1e-4 of how deep balls press each other."""

LEAST_DEPTH = 3e-10
"""m. A contact that opens and is no deeper has ended, and one that closes and has no wider gap begins: its force is
below 1e-4 m/s^2. Balls of a touching rack whose gaps open and close by rounding would begin theirs at random times."""

SHORTEST = 1e-9
"""s. A step to where a contact begins or ends is no shorter: 1e-8 m at 10 m/s, whose force is nothing."""


@kernel
def begin_touch(state: State, constants: Constants, i: int, j: int, now: float, approach: float) -> None:
    """Let ball i and ball j, or feature -1 - j, which meet now, press each other.

    Unless they do so already, or do not meet: where an island has gone on without a new prediction of others, what was
    predicted of its balls may be wrong. Within a step a parabola has not quite the island's velocity: balls that touch
    to within LEAST_DEPTH press each other whether they approach at this instant or not.
    """
    approaches = approach > constants.least_approach
    if is_touching(state, i, j) or (j < 0 and not approaches):
        return
    if j >= 0:
        depth = _overlap(state, constants, i, j)
        if depth < -OFF_BY or (not approaches and abs(depth) > LEAST_DEPTH):
            return
    release_ball(state, i)
    if j >= 0:
        release_ball(state, j)
    touch = add_touch(state, constants, i, j)
    if state.balls[i].touches > 1 or (j >= 0 and state.balls[j].touches > 1):
        return
    if not has_company(state, constants, i, j, approach):
        keep_together(state, constants, touch, now)


@kernel
def _overlap(state: State, constants: Constants, i: int, j: int) -> float:
    dx, dy = state.balls[i].x - state.balls[j].x, state.balls[i].y - state.balls[j].y
    return 2.0 * constants.radius - math.sqrt(dx * dx + dy * dy)


@kernel
def advance_to(state: State, constants: Constants, i: int, now: float) -> None:
    """Bring ball i, and whom it presses or is pressed by, to `now` and mark it as changed."""
    if state.balls[i].touches > 0:
        _end_step(state, constants, i, now)
    else:
        settle_to(state, constants, i, now)


@kernel
def _end_step(state: State, constants: Constants, i: int, now: float) -> None:
    # Bring the island of ball i to `now`, at the end of a step or within.
    touches, count = gather(state, i)
    ball = state.balls[i]
    duration = now - ball.time
    if duration > 0.0:
        alone = state.touches[0].alone
        if now < ball.phase_end and alone:
            state.touches[0].alone = False  # somebody came after all
            alone = False
            _integrate_in_parts(state, constants, count, now)
        elif now < ball.phase_end:
            integrate(state, constants, touches, count, duration)
        for k in range(count):
            anchor(state.balls[state.members[k].ball], now)
        if alone:
            part(state, constants, state.touches[0], duration)
        else:
            rub_touches(state, constants, touches)
        _drop_ended(state, constants, touches, count, now, alone)
    for k in range(count):
        member = state.members[k].ball
        state.balls[member].phase_end = now
        mark(state, member)


@kernel
def _integrate_in_parts(state: State, constants: Constants, count: int, now: float) -> None:
    # What was alone, from its first touch; what it does last is left for the caller.
    touch = state.touches[0]
    first = state.balls[touch.first]
    duration = now - first.time
    parts = 1 + int(constants.contact_steps * duration / longest_of(touch.second, touch.approach, constants))
    for _ in range(parts - 1):
        integrate(state, constants, 1, count, duration / parts)
        part_end = first.time + duration / parts
        for k in range(count):
            anchor(state.balls[state.members[k].ball], part_end)
        rub_touches(state, constants, 1)
        for k in range(count):
            set_out(state, constants, state.members[k].ball)
    integrate(state, constants, 1, count, now - first.time)


@kernel
def _drop_ended(state: State, constants: Constants, touches: int, count: int, now: float, alone: bool) -> None:
    # Log and forget the touches that have ended; all of them, where all are slow and their balls have room to part.
    fastest = 0.0
    for c in range(touches):
        touch = state.touches[c]
        depth = max(depth_of(state, constants, touch), 0.0)
        fastest = max(fastest, free_speed(depth, opening_of(state, touch), share_of(touch), constants))
    slow = fastest <= SLOW and not alone
    for k in range(count):
        state.stages[state.members[k].ball].slow = slow
    rigid = slow and not leans_on_others(state, constants, count, now)
    if rigid:
        separate(state, constants, touches, now)
    for c in range(touches - 1, -1, -1):
        touch = state.touches[c]
        depth = depth_of(state, constants, touch)
        ended = depth <= LEAST_DEPTH and (opening_of(state, touch) >= 0.0 or depth < -OFF_BY)
        if ended or rigid or alone:
            drop_touch(state, constants, c, now)


@kernel
def take_step(state: State, constants: Constants, i: int, now: float) -> None:
    """Begin a step of the island of ball i, which is at `now`, with all who begin to touch it."""
    step = 0.0
    touches, count = 0, 0
    while step == 0.0:
        touches, count = gather(state, i)
        for k in range(count):
            set_out(state, constants, state.members[k].ball)
        step = _step_of(state, constants, touches, count, now)
    integrate(state, constants, touches, count, step)
    for k in range(count):
        state.balls[state.members[k].ball].phase_end = now + step


@kernel
def _step_of(state: State, constants: Constants, touches: int, count: int, now: float) -> float:
    # How long the forces of an island are smooth, and are followed well; 0 where a touch was added.
    for k in range(count):
        stage = state.stages[state.members[k].ball]
        stage.dx = 0.0
        stage.dy = 0.0
        stage.ux = stage.start_vx
        stage.uy = stage.start_vy
    evaluate(state, constants, touches, count, 0.0)
    step = min(LONGEST, _time_to_touch(state, constants, count, now))
    if step == 0.0:
        return 0.0
    for c in range(touches):
        touch = state.touches[c]
        depth = max(depth_of(state, constants, touch), 0.0)
        opening = opening_of(state, touch)
        speed = free_speed(depth, opening, share_of(touch), constants)
        own = (
            contact_duration(speed, share_of(touch), ELASTIC_FACTOR, constants) / constants.contact_steps
            if speed > 0.0
            else INF
        )
        touch.kink = opening < 0.0 and depth <= AT_TOUCH * own * -opening
        step = min(step, own)
        if opening > 0.0 and depth > 0.0:
            step = min(step, max(_time_for(depth, opening, _opening_acceleration(state, touch)), SHORTEST))
    for c in range(touches):
        if _ends_with(state, constants, state.touches[c], step):
            state.touches[c].kink = True
    return step


@kernel
def _ends_with(state: State, constants: Constants, touch: Touch, step: float) -> bool:
    # Whether a touch that opens ends with a step, not after it; of symmetric ones all do.
    depth = max(depth_of(state, constants, touch), 0.0)
    opening = opening_of(state, touch)
    if depth == 0.0 or opening <= 0.0:
        return False
    return _time_for(depth, opening, _opening_acceleration(state, touch)) <= (1.0 + AT_TOUCH) * step


@kernel
def _opening_acceleration(state: State, touch: Touch) -> float:
    nx, ny = direction_of(state, touch)
    one = state.stages[touch.first]
    opening = one.fx * nx + one.fy * ny
    if touch.second >= 0:
        two = state.stages[touch.second]
        opening -= two.fx * nx + two.fy * ny
    return opening


@kernel
def _time_to_touch(state: State, constants: Constants, count: int, now: float) -> float:
    # How long it takes until somebody begins to touch an island, s; 0 where that is now, and is added to the touches.
    first = INF
    for k in range(count):
        state.stages[state.members[k].ball].looked = False
    for k in range(count):
        i = state.members[k].ball
        first = min(first, _time_to_feature(state, constants, i))
        if first == 0.0:
            return 0.0
        j = first_neighbour(state, constants, i)
        while j != NOBODY:
            other = state.balls[j]
            looks_at_me = j < i and other.phase_end <= now  # it is due now, too
            seen = other.touches > 0 and (looks_at_me or state.stages[j].looked)
            if j != i and not seen and other.phase != OFF_TABLE:
                gap, closing, faster = way_to(state, constants, i, j, now)
                if gap > LEAST_DEPTH and gap < LOOK:
                    if not is_touching(state, i, j):
                        first = min(first, max(_time_for(gap, closing, faster), SHORTEST))
                elif gap <= LEAST_DEPTH and closing > constants.least_approach and not is_touching(state, i, j):
                    advance_to(state, constants, j, now)
                    release_ball(state, j)
                    add_touch(state, constants, min(i, j), max(i, j))
                    return 0.0
            j = next_neighbour(state, constants, i, j)
        state.stages[i].looked = True
    for k in range(count):
        state.stages[state.members[k].ball].looked = False
    return first


@kernel
def _time_to_feature(state: State, constants: Constants, i: int) -> float:
    # The same of ball i and what stands on the table.
    first = INF
    ball, stage = state.balls[i], state.stages[i]
    if is_clear(state, ball.x, ball.y, LOOK):
        return first
    k = next_feature(state, NOBODY, ball.x, ball.y, LOOK)
    while k != NOBODY:
        gap = -overlap_with(state, k, ball.x, ball.y)
        if gap < LOOK:
            nx, ny = normal_of(state, k, ball.x, ball.y)
            closing = -(ball.vx * nx + ball.vy * ny)
            if gap > LEAST_DEPTH:
                if not is_pushed_by(state, i, k):
                    first = min(first, max(_time_for(gap, closing, -(stage.fx * nx + stage.fy * ny)), SHORTEST))
            elif closing > constants.least_approach and not is_pushed_by(state, i, k):
                add_touch(state, constants, i, -1 - k)
                return 0.0
        k = next_feature(state, k, ball.x, ball.y, LOOK)
    return first


@kernel
def _time_for(distance: float, speed: float, acceleration: float) -> float:
    # The first time at which a distance is covered; INF if it never is.
    square = speed * speed + 2.0 * acceleration * distance
    if square < 0.0:
        return INF
    total = speed + math.sqrt(square)
    return 2.0 * distance / total if total > 0.0 else INF
