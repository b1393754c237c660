# SPDX-License-Identifier: Apache-2.0
"""Elastic contacts: what bodies do that press each other for a while, by `law.hertz`.

Rigid impacts have no duration, so a shock passes through a rack pair by pair. Real ones last for 0.2 to 0.4 ms and
overlap in time. Balls that touch each other form an island with all whom they touch. It goes on by short steps, each an
event: the forces are integrated over the step by the classical Runge-Kutta method of fourth order, with the cloth's
friction as it is at the start of the step, and each ball gets the parabola that has its place and its velocity at the
end. So between the ends of steps all is as for a free ball: others may run into it, and time may be cut anywhere. What
comes in the middle of a step has the step integrated again from its start up to there.

A step is a part of the contact's duration at the speed that its energy stands for, and ends where a contact is about to
begin or to end: the force has a kink there. Friction acts at the ends of steps, with the normal impulse of the step.

A pair that nobody else can reach meanwhile needs no steps: it goes by the closed form of `law.hertz` from its first
touch to where it parts. So does a ball alone at a nose or a jaw: it presses for t_c, goes on along it meanwhile, and
parts by the rigid laws of the cushion. What the cloth does along the normal is left out there: a constant force does no
work on a way that ends where it began.

An island ends when nothing in it touches. What friction presses together never parts: where all contacts are slow the
rigid rules take over.
"""

from __future__ import annotations

import math

from .bounce import count_impact
from .cells import first_neighbour, next_neighbour
from .feature import is_clear, next_feature, normal_of, overlap_with
from .impact import collide_feature
from .island import release_ball
from .kernel import kernel
from .law.cushion import rub_at_cushion, slip_at_cushion
from .law.hertz import contact_duration, free_speed, lone_pair, push_of
from .law.throw import friction_at, rub_pair, rubs, slip_of_pair
from .log import log_impact
from .motion import anchor, begin_motion, mark, phase_of, place_at, velocity_at
from .settle import advance_to as settle_to
from .state import ARC, INF, NOBODY, OFF_TABLE, QUEUED, SLIDING, Ball, Constants, Stage, State, Touch

SLOW = 0.01
"""m/s. Bodies that approach more slowly have no shock to pass on: they stay rigid (4e-6 m/s in a break)."""

AT_TOUCH = 0.01
"""Of its own step: a contact that is no older begins with the step."""

KINK = 0.4 / (2.0 / 3.0 * 0.5**1.5 + 1.0 / 6.0)
KINK_DAMPING = 0.8 / (2.0 / 3.0 * 0.5**0.25 + 1.0 / 6.0) / KINK
"""What the forces of a contact are multiplied by where a step begins or ends with it. They grow as t^(3/2) and t^(1/4)
from there, which the method's nodes 0, 1/2, 1/2, 1 with weights 1/6, 1/3, 1/3, 1/6 do not integrate to 2/5 and 4/5."""

ELASTIC_FACTOR = 2.9433
"""f of `law.hertz` without damping."""

LONGEST = 1e-4
"""s. Of a step in which nothing presses."""

LOOK = 5e-3
"""m. Nobody comes this far in a step, at light's speed excepted."""

OFF_BY = 1e-7
"""m. What the parabola of a step may be off by between its ends: 1e-4 of how deep balls press each other."""

LEAST_DEPTH = 3e-10
"""m. A contact that opens and is no deeper has ended, and one that closes and has no wider gap begins: its force is
below 1e-4 m/s^2. Balls of a touching rack whose gaps open and close by rounding would begin theirs at random times."""

SHORTEST = 1e-9
"""s. A step to where a contact begins or ends is no shorter: 1e-8 m at 10 m/s, whose force is nothing."""

NEAR = 1e-12
"""m. Overlaps as small as that are not parted."""

BESIDE = 1e-5
"""m. The overlaps that are parted when the rigid rules take over are half as large at most."""

SEPARATING_SWEEPS = 100
"""Bound on the sweeps that part what still overlaps by some 1e-6 m when the rigid rules take over."""


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
def begin_touch(state: State, constants: Constants, i: int, j: int, now: float, approach: float) -> None:
    """Let ball i and ball j, or feature -1 - j, which meet now, press each other.

    Unless they do so already, or do not meet: where an island has gone on without a new prediction of others, what was
    predicted of its balls may be wrong.
    """
    if approach <= constants.least_approach or _is_touching(state, i, j) or _is_off(state, constants, i, j):
        return
    release_ball(state, i)
    if j >= 0:
        release_ball(state, j)
    touch = _add_touch(state, constants, i, j)
    if state.balls[i].touches > 1 or (j >= 0 and state.balls[j].touches > 1):
        return
    if not _has_company(state, constants, i, j, approach):
        _keep_together(state, constants, touch, now)


@kernel
def _is_off(state: State, constants: Constants, i: int, j: int) -> bool:
    # Whether balls i and j are further apart than a parabola may be off within a step.
    if j < 0:
        return False
    dx, dy = state.balls[i].x - state.balls[j].x, state.balls[i].y - state.balls[j].y
    return math.sqrt(dx * dx + dy * dy) - 2.0 * constants.radius > OFF_BY


@kernel
def _add_touch(state: State, constants: Constants, i: int, j: int) -> Touch:
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
    touch.approach = -_opening(state, touch)
    touch.normal_x, touch.normal_y = _normal(state, touch)
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
def _depth(state: State, constants: Constants, touch: Touch) -> float:
    # How far two bodies press each other, m; negative where they do not touch.
    first = state.balls[touch.first]
    if touch.second < 0:
        return overlap_with(state, -1 - touch.second, first.x, first.y)
    second = state.balls[touch.second]
    dx, dy = first.x - second.x, first.y - second.y
    return 2.0 * constants.radius - math.sqrt(dx * dx + dy * dy)


@kernel
def _normal(state: State, touch: Touch) -> tuple[float, float]:
    # Unit, towards the first.
    if touch.second < 0:
        ball = state.balls[touch.first]
        return normal_of(state, -1 - touch.second, ball.x, ball.y)
    first, second = state.balls[touch.first], state.balls[touch.second]
    dx, dy = first.x - second.x, first.y - second.y
    distance = math.sqrt(dx * dx + dy * dy)
    return dx / distance, dy / distance


@kernel
def _opening(state: State, touch: Touch) -> float:
    # Speed at which two bodies part, m/s.
    nx, ny = _normal(state, touch)
    first = state.balls[touch.first]
    speed = first.vx * nx + first.vy * ny
    if touch.second >= 0:
        second = state.balls[touch.second]
        speed -= second.vx * nx + second.vy * ny
    return speed


@kernel
def _slip(state: State, touch: Touch, nx: float, ny: float, constants: Constants) -> tuple[float, float]:
    first = state.balls[touch.first]
    if touch.second < 0:
        return slip_at_cushion(first, nx, ny, constants)
    return slip_of_pair(first, state.balls[touch.second], nx, ny, constants.radius)


@kernel
def _share(touch: Touch) -> float:
    # Mass of a ball over the reduced mass.
    return 2.0 if touch.second >= 0 else 1.0


# A pair alone


@kernel
def _has_company(state: State, constants: Constants, i: int, j: int, approach: float) -> bool:
    # Whether anybody but balls i and j can touch one of them while they press each other, or there is no closed form.
    if constants.integrates_all or (j < 0 and state.features[-1 - j].kind == ARC):
        return True
    duration = _longest(j, approach, constants)
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
        met = -1 - k == j or (j < 0 and _are_of_one_edge(state, k, -1 - j, mine))
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
def _longest(j: int, approach: float, constants: Constants) -> float:
    # How long a ball presses ball j, or feature -1 - j, at the most.
    if j >= 0:
        return contact_duration(approach, 2.0, constants.duration_factor, constants)
    return contact_duration(approach, 1.0, constants.rail_duration_factor, constants)


@kernel
def _keep_together(state: State, constants: Constants, touch: Touch, now: float) -> None:
    # Let a pair, or a ball at a line, move on for as long as it presses, to where it parts.
    touch.alone = True
    _set_out(state, constants, touch.first)
    if touch.second < 0:
        _glide_along(state, constants, touch, now)
        return
    first, second = state.balls[touch.first], state.balls[touch.second]
    _set_out(state, constants, touch.second)
    nx, ny = touch.normal_x, touch.normal_y
    across = (first.vy - second.vy) * nx - (first.vx - second.vx) * ny
    duration, touch.turn, touch.parting = lone_pair(touch.approach, across, constants)
    touch.along = 0.0
    touch.over = 0.0
    if touch.friction > 0.0:
        pressed = max(0.5 * (touch.approach + touch.parting - across * touch.turn), 0.0)
        touch.along, touch.over = _friction_of(state, touch, nx, ny, pressed, constants)
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
    duration = _longest(touch.second, touch.approach, constants)
    nx, ny = touch.normal_x, touch.normal_y
    way = ((ball.vy + 0.5 * ball.ay * duration) * nx - (ball.vx + 0.5 * ball.ax * duration) * ny) * duration
    _glide(ball, ball.x - way * ny, ball.y + way * nx, now, duration)


@kernel
def _turned(x: float, y: float, angle: float) -> tuple[float, float]:
    cosine, sine = math.cos(angle), math.sin(angle)
    return cosine * x - sine * y, sine * x + cosine * y


@kernel
def _set_out(state: State, constants: Constants, i: int) -> None:
    # Begin a step of a ball: what it is at its start, and what the cloth does to it.
    ball, stage = state.balls[i], state.stages[i]
    begin_motion(ball, phase_of(ball, constants), constants)
    stage.start_vx = ball.vx
    stage.start_vy = ball.vy
    stage.cloth_x = ball.ax
    stage.cloth_y = ball.ay
    ball.phase = SLIDING  # it moves, whatever it did


@kernel
def _glide(ball: Ball, x: float, y: float, now: float, duration: float) -> None:
    # Straight on to a place.
    ball.vx = (x - ball.x) / duration
    ball.vy = (y - ball.y) / duration
    ball.ax = 0.0
    ball.ay = 0.0
    ball.phase_end = now + duration


@kernel
def _part(state: State, constants: Constants, touch: Touch, duration: float) -> None:
    # What a pair that was alone, or a ball at a line, does when it parts.
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


# An island


@kernel
def _gather(state: State, i: int) -> tuple[int, int]:
    # Bring the touches of the island of ball i to the front of their list; returns their number and that of its balls,
    # which are listed as members.
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
def _swap(state: State, a: int, b: int) -> None:
    if a != b:
        spare = state.touches[len(state.touches) - 1]
        _copy(state.touches[a], spare)
        _copy(state.touches[b], state.touches[a])
        _copy(spare, state.touches[b])


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
    touches, count = _gather(state, i)
    ball = state.balls[i]
    duration = now - ball.time
    if duration > 0.0:
        alone = state.touches[0].alone
        if now < ball.phase_end and alone:
            state.touches[0].alone = False  # somebody came after all
            alone = False
            _integrate_in_parts(state, constants, count, now)
        elif now < ball.phase_end:
            _integrate(state, constants, touches, count, duration)
        for k in range(count):
            anchor(state.balls[state.members[k].ball], now)
        if alone:
            _part(state, constants, state.touches[0], duration)
        else:
            _rub(state, constants, touches)
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
    parts = 1 + int(constants.contact_steps * duration / _longest(touch.second, touch.approach, constants))
    for _ in range(parts - 1):
        _integrate(state, constants, 1, count, duration / parts)
        part_end = first.time + duration / parts
        for k in range(count):
            anchor(state.balls[state.members[k].ball], part_end)
        _rub(state, constants, 1)
        for k in range(count):
            _set_out(state, constants, state.members[k].ball)
    _integrate(state, constants, 1, count, now - first.time)


@kernel
def _drop_ended(state: State, constants: Constants, touches: int, count: int, now: float, alone: bool) -> None:
    # Log and forget the touches that have ended; all of them, where all are slow and their balls have room to part.
    fastest = 0.0
    for c in range(touches):
        touch = state.touches[c]
        depth = max(_depth(state, constants, touch), 0.0)
        fastest = max(fastest, free_speed(depth, _opening(state, touch), _share(touch), constants))
    slow = fastest <= SLOW and not alone
    for k in range(count):
        state.stages[state.members[k].ball].slow = slow
    rigid = slow and not _leans_on_others(state, constants, count, now)
    if rigid:
        _separate(state, constants, touches, now)
    for c in range(touches - 1, -1, -1):
        touch = state.touches[c]
        depth = _depth(state, constants, touch)
        ended = depth <= LEAST_DEPTH and (_opening(state, touch) >= 0.0 or depth < -OFF_BY)
        if ended or rigid or alone:
            _drop(state, constants, c, now)


@kernel
def _leans_on_others(state: State, constants: Constants, count: int, now: float) -> bool:
    # Whether beside a slow island there is a ball that presses others, and is not to be moved.
    for k in range(count):
        i = state.members[k].ball
        j = first_neighbour(state, constants, i)
        while j != NOBODY:
            presses = state.balls[j].touches > 0 and not state.stages[j].slow
            if presses and not _is_member(state, count, j):
                gap, _, _ = _way_to(state, constants, i, j, now)
                if gap < BESIDE:
                    return True
            j = next_neighbour(state, constants, i, j)
    return False


@kernel
def _is_member(state: State, count: int, j: int) -> bool:
    k = 0
    while k < count and state.members[k].ball != j:
        k += 1
    return k < count


@kernel
def _drop(state: State, constants: Constants, c: int, now: float) -> None:
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
def _separate(state: State, constants: Constants, touches: int, now: float) -> None:
    # Move the balls of an island apart until none overlaps, with those that stand in their way.
    for c in range(touches):
        touch = state.touches[c]
        state.stages[touch.first].moved = True
        if touch.second >= 0:
            state.stages[touch.second].moved = True
    for _ in range(SEPARATING_SWEEPS):
        worst = 0.0
        for i in range(len(state.balls)):
            if state.stages[i].moved:
                worst = max(worst, _move_off(state, constants, i, now))
        if worst <= NEAR:
            break
    for i in range(len(state.balls)):
        state.stages[i].moved = False


@kernel
def _move_off(state: State, constants: Constants, i: int, now: float) -> float:
    # Move a ball off whom it overlaps with; returns the largest overlap, m.
    ball = state.balls[i]
    worst = 0.0
    k = next_feature(state, NOBODY, ball.x, ball.y, 0.0)
    while k != NOBODY:
        depth = overlap_with(state, k, ball.x, ball.y)
        if depth > NEAR:
            nx, ny = normal_of(state, k, ball.x, ball.y)
            ball.x += depth * nx
            ball.y += depth * ny
            worst = max(worst, depth)
        k = next_feature(state, k, ball.x, ball.y, 0.0)
    j = first_neighbour(state, constants, i)
    while j != NOBODY:
        other = state.balls[j]
        if j != i and other.phase != OFF_TABLE:
            x, y = place_at(other, now)
            dx, dy = ball.x - x, ball.y - y
            distance = math.sqrt(dx * dx + dy * dy)
            depth = 2.0 * constants.radius - distance
            if depth > NEAR:
                worst = max(worst, depth)
                yields = state.stages[j].moved or other.touches == 0 or state.stages[j].slow
                if not state.stages[j].moved and other.touches == 0:
                    settle_to(state, constants, j, now)
                    state.stages[j].moved = True
                part = 0.5 * depth / distance if yields else depth / distance
                ball.x += part * dx
                ball.y += part * dy
                if yields:
                    other.x -= part * dx
                    other.y -= part * dy
        j = next_neighbour(state, constants, i, j)
    return worst


@kernel
def _rub(state: State, constants: Constants, touches: int) -> None:
    # Friction with the impulses of a step, of all contacts at once: each acts on the slip that was there.
    for c in range(touches):
        touch = state.touches[c]
        touch.impulse_x += touch.step_x
        touch.impulse_y += touch.step_y
        touch.along = 0.0
        touch.over = 0.0
        if touch.friction > 0.0:
            nx, ny = _normal(state, touch)
            pressed = touch.step_x * nx + touch.step_y * ny
            touch.along, touch.over = _friction_of(state, touch, nx, ny, pressed, constants)
        touch.step_x = 0.0
        touch.step_y = 0.0
    for c in range(touches):
        touch = state.touches[c]
        if touch.along != 0.0 or touch.over != 0.0:
            nx, ny = _normal(state, touch)
            first = state.balls[touch.first]
            if touch.second < 0:
                rub_at_cushion(first, nx, ny, touch.along, touch.over, constants)
            else:
                rub_pair(first, state.balls[touch.second], nx, ny, touch.along, touch.over, constants.radius)


@kernel
def _friction_of(
    state: State, touch: Touch, nx: float, ny: float, pressed: float, constants: Constants
) -> tuple[float, float]:
    # Tangential impulse per mass, m/s, of a contact whose normal impulse per mass is `pressed`.
    along, over = _slip(state, touch, nx, ny, constants)
    slip = math.sqrt(along * along + over * over)
    if slip == 0.0 or pressed <= 0.0:
        return 0.0, 0.0
    part = min(1.0 / 7.0 if touch.second >= 0 else 2.0 / 7.0, touch.friction * pressed / slip)
    return -part * along, -part * over


@kernel
def take_step(state: State, constants: Constants, i: int, now: float) -> None:
    """Begin a step of the island of ball i, which is at `now`, with all who begin to touch it."""
    step = 0.0
    touches, count = 0, 0
    while step == 0.0:
        touches, count = _gather(state, i)
        for k in range(count):
            _set_out(state, constants, state.members[k].ball)
        step = _step_of(state, constants, touches, count, now)
    _integrate(state, constants, touches, count, step)
    for k in range(count):
        state.balls[state.members[k].ball].phase_end = now + step


@kernel
def _time_to_touch(state: State, constants: Constants, count: int, now: float) -> float:
    # How long it takes until somebody begins to touch an island, s; 0 where that is now, and is added to the touches.
    first = INF
    for k in range(count):
        i = state.members[k].ball
        first = min(first, _time_to_feature(state, constants, i))
        if first == 0.0:
            return 0.0
        j = first_neighbour(state, constants, i)
        while j != NOBODY:
            other = state.balls[j]
            looks_at_me = j < i and other.touches > 0 and other.phase_end <= now  # it is of the island, or due now, too
            if j != i and not looks_at_me and other.phase != OFF_TABLE:
                gap, closing, faster = _way_to(state, constants, i, j, now)
                if gap > LEAST_DEPTH and gap < LOOK:
                    if not _is_touching(state, i, j):
                        first = min(first, max(_time_for(gap, closing, faster), SHORTEST))
                elif gap <= LEAST_DEPTH and closing > constants.least_approach and not _is_touching(state, i, j):
                    advance_to(state, constants, j, now)
                    release_ball(state, j)
                    _add_touch(state, constants, min(i, j), max(i, j))
                    return 0.0
            j = next_neighbour(state, constants, i, j)
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
                if not _is_pushed_by(state, i, k):
                    first = min(first, max(_time_for(gap, closing, -(stage.fx * nx + stage.fy * ny)), SHORTEST))
            elif closing > constants.least_approach and not _is_pushed_by(state, i, k):
                _add_touch(state, constants, i, -1 - k)
                return 0.0
        k = next_feature(state, k, ball.x, ball.y, LOOK)
    return first


@kernel
def _way_to(state: State, constants: Constants, i: int, j: int, now: float) -> tuple[float, float, float]:
    # From ball i, which is at `now`, to ball j: m between them, m/s at which that closes, and m/s^2.
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
def _is_touching(state: State, i: int, j: int) -> bool:
    for c in range(state.clock[0].touches):
        first, second = state.touches[c].first, state.touches[c].second
        if (first == i and second == j) or (first == j and second == i):
            return True
    return False


@kernel
def _is_pushed_by(state: State, i: int, k: int) -> bool:
    # Whether ball i touches feature k, or what stands there as part of the same edge.
    for c in range(state.clock[0].touches):
        touch = state.touches[c]
        if touch.first == i and touch.second < 0 and _are_of_one_edge(state, k, -1 - touch.second, state.balls[i]):
            return True
    return False


@kernel
def _are_of_one_edge(state: State, k: int, other: int, ball: Ball) -> bool:
    # Whether features are the same, or a nose, a point and a jaw that follow each other: a ball is pushed by one edge
    # in one direction. Two edges push at right angles, or against each other.
    if k == other:
        return True
    ax, ay = normal_of(state, k, ball.x, ball.y)
    bx, by = normal_of(state, other, ball.x, ball.y)
    return ax * bx + ay * by > 0.0


@kernel
def forget_touches(state: State, constants: Constants, i: int, now: float) -> None:
    """End the elastic contacts of a ball that is taken away."""
    if state.balls[i].touches == 0:
        return
    for c in range(state.clock[0].touches - 1, -1, -1):
        touch = state.touches[c]
        if touch.first == i or touch.second == i:
            _drop(state, constants, c, now)


@kernel
def _step_of(state: State, constants: Constants, touches: int, count: int, now: float) -> float:
    # How long the forces of an island are smooth, and are followed well; 0 where a touch was added.
    for k in range(count):
        stage = state.stages[state.members[k].ball]
        stage.dx = 0.0
        stage.dy = 0.0
        stage.ux = stage.start_vx
        stage.uy = stage.start_vy
    _evaluate(state, constants, touches, count, 0.0)
    step = min(LONGEST, _time_to_touch(state, constants, count, now))
    if step == 0.0:
        return 0.0
    for c in range(touches):
        touch = state.touches[c]
        depth = max(_depth(state, constants, touch), 0.0)
        opening = _opening(state, touch)
        speed = free_speed(depth, opening, _share(touch), constants)
        own = (
            contact_duration(speed, _share(touch), ELASTIC_FACTOR, constants) / constants.contact_steps
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
    depth = max(_depth(state, constants, touch), 0.0)
    opening = _opening(state, touch)
    if depth == 0.0 or opening <= 0.0:
        return False
    return _time_for(depth, opening, _opening_acceleration(state, touch)) <= (1.0 + AT_TOUCH) * step


@kernel
def _time_for(distance: float, speed: float, acceleration: float) -> float:
    # The first time at which a distance is covered; INF if it never is.
    square = speed * speed + 2.0 * acceleration * distance
    if square < 0.0:
        return INF
    total = speed + math.sqrt(square)
    return 2.0 * distance / total if total > 0.0 else INF


@kernel
def _opening_acceleration(state: State, touch: Touch) -> float:
    nx, ny = _normal(state, touch)
    one = state.stages[touch.first]
    opening = one.fx * nx + one.fy * ny
    if touch.second >= 0:
        two = state.stages[touch.second]
        opening -= two.fx * nx + two.fy * ny
    return opening


@kernel
def _integrate(state: State, constants: Constants, touches: int, count: int, step: float) -> None:
    # Over a step from the anchors on; the balls get parabolas that end where they are then, and as fast.
    for c in range(touches):
        state.touches[c].step_x = 0.0
        state.touches[c].step_y = 0.0
    for k in range(count):
        stage = state.stages[state.members[k].ball]
        stage.dx = 0.0
        stage.dy = 0.0
        stage.ux = stage.start_vx
        stage.uy = stage.start_vy
    _evaluate(state, constants, touches, count, step / 6.0)
    for k in range(count):
        stage = state.stages[state.members[k].ball]
        stage.before_x, stage.before_y = stage.fx, stage.fy
        stage.place_x, stage.place_y = stage.fx, stage.fy
        stage.speed_x, stage.speed_y = stage.fx, stage.fy
        stage.dx = 0.5 * step * stage.start_vx
        stage.dy = 0.5 * step * stage.start_vy
        stage.ux = stage.start_vx + 0.5 * step * stage.fx
        stage.uy = stage.start_vy + 0.5 * step * stage.fy
    _evaluate(state, constants, touches, count, step / 3.0)
    for k in range(count):
        stage = state.stages[state.members[k].ball]
        _sum(stage, 2.0)
        stage.dx = 0.5 * step * (stage.start_vx + 0.5 * step * stage.before_x)
        stage.dy = 0.5 * step * (stage.start_vy + 0.5 * step * stage.before_y)
        stage.ux = stage.start_vx + 0.5 * step * stage.fx
        stage.uy = stage.start_vy + 0.5 * step * stage.fy
        stage.before_x, stage.before_y = stage.fx, stage.fy
    _evaluate(state, constants, touches, count, step / 3.0)
    for k in range(count):
        stage = state.stages[state.members[k].ball]
        _sum(stage, 2.0)
        stage.dx = step * (stage.start_vx + 0.5 * step * stage.before_x)
        stage.dy = step * (stage.start_vy + 0.5 * step * stage.before_y)
        stage.ux = stage.start_vx + step * stage.fx
        stage.uy = stage.start_vy + step * stage.fy
    _evaluate(state, constants, touches, count, step / 6.0)
    for k in range(count):
        i = state.members[k].ball
        _bend(state.balls[i], state.stages[i], step)


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
def _push(touch: Touch, depth: float, rate: float, damping: float, constants: Constants) -> float:
    if touch.kink:
        return KINK * push_of(depth, KINK_DAMPING * rate, damping, constants)
    return push_of(depth, rate, damping, constants)


@kernel
def _evaluate(state: State, constants: Constants, touches: int, count: int, weight: float) -> None:
    # Accelerations of an island's balls at a stage; the impulses of its touches grow by theirs, weighted.
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
