# SPDX-License-Identifier: Apache-2.0
"""Sustained contact: balls that cloth friction presses against each other or against a rail.

A ball that slides into a rail or into a slower ball bounces off it ever lower, infinitely often in a finite time. What
follows is the limit of ever finer bounces: the bodies stay together and push each other along the normal, just enough
that the relative normal acceleration (the centripetal term |vt|^2/2R included) does not close the gap. The contact ends
when the push would turn into a pull.

How a ball yields to a push f (per mass) follows from the limit too. A sliding ball takes it whole: a = f - mu_s g d
with d the direction of its slip. A rolling ball is kicked into a slip that friction ends again, which costs 2/7 of each
kick: a = 5/7 f, less the rolling resistance for the share of the time that it rolls, 1 - |f|/(7/2 mu_s g). Above
7/2 mu_s g friction cannot follow and it slides. A resting ball stays while 5/7 f is below the rolling resistance.

Directions turn along the way, so the motion is cut into short parabolas: directions at mid-step (second order), the
pushes solved together so that every gap at the end of the step is what it was at its start.
"""

from __future__ import annotations

import math

from .bounce import PRESS_ACCELERATION
from .feature import overlap_with
from .island import gather_island, release
from .kernel import kernel
from .motion import GRIP, ROLLING_SHARE, slip
from .settle import (
    MAX_ITERATIONS,
    MIN_STEP,
    distance_in_touch,
    least_distance,
    opening_speed,
    relative_motion,
    separation,
    set_normals,
    settle_velocities,
    stop,
    turns,
)
from .state import AT_REST, INF, ROLLING, SLIDING, Ball, Constants, Contact, State

SHORT_STEP = 2e-5
"""s. In shorter steps a gap cannot stray by 1e-12 m, and its change is lost in rounding: accelerations decide alone."""

PLAIN_SWEEPS = 32
"""Sweeps until which pushes are not relaxed: most islands are solved by then."""

OVER_RELAXATION = 1.75
"""Of pushes in later sweeps: a long chain needs a third of the sweeps."""

LEAST_MOBILITY = 0.01
"""Of a push across the one with which a resting ball sets off; less would be right, and take pushes too far at once."""

FIRST_LEAP = 96
"""Sweeps after which pushes may leap."""

LEAP_SWEEPS = 32
"""Sweeps between which the pushes are compared."""

STEADY = 0.1
"""Relative difference of two changes of the pushes in as many sweeps that are as good as one."""

LEAP = 1.0 / STEADY - 1.0
"""Times the last change: how far pushes go whose changes fall by that much each time."""

MAX_STEP = 1.0
"""s. Where nothing turns, a step may be as long as the motion."""

MAX_TURNING = 1e-9
"""s^2. Turning rate of a normal times the cube of a step: a first guess of a step that keeps to `MAX_STRAY`."""

MAX_STRAY = 2e-10
"""m. What the gap of two balls may be off by between the ends of a step; a fifth of what counts as an overlap."""

RESTORING_SPEED = 1e-6
"""m/s. Balls in contact that overlap, since something cut a step short or a push was rounded, come apart no faster."""

LEAST_OVERLAP = 1e-10
"""m. A smaller overlap is left alone: half of what a step may stray by, far above the rounding of blocked balls."""

RESTORING_SWEEPS = 200
"""Sweeps until which the pushes are to end overlaps. Between blocked balls that began with one they cannot."""

MAX_TURN = 0.2
"""rad. Largest turn of a slip or of a rolling direction in a step."""

SLIP_TURN_ERROR = 3e-8
"""m/s. Slip speed times the square of its turn in a step. A turn misplaces the end of a slip in time, not the velocity
that is left, so a slow slip may turn further: paths are then exact to 2e-7 m."""

ROLL_TURN_ERROR = 2e-5
"""m/s. The same of a rolling ball, whose resistance is a twentieth of sliding friction."""

PUSH_TOLERANCE = 1e-11
"""m/s^2. Accuracy of the pushes when they are solved together."""

GAP_TOLERANCE = 1e-16
"""m. Or what a push does to a gap within a step, where that is coarser: rounding of a separation."""


@kernel
def update_contacts(state: State, constants: Constants, i: int, now: float) -> None:
    """Solve the pushes of the island of ball i for its next step and start the arcs of its balls, which are at `now`.

    Contacts without a push end.
    """
    balls = state.balls
    contacts, count = gather_island(state, i)
    step = 0.0
    while step == 0.0:
        set_normals(state, contacts, 0.0)
        _solve_first_pushes(state, constants, contacts, count)
        if not _stop_reversing_balls(state, constants, contacts, count):
            step = _solve_step(state, constants, contacts, count)
    for k in range(count):
        ball = balls[state.members[k].ball]
        ball.phase_end = now + step
        if ball.phase == AT_REST:
            if abs(ball.ax) + abs(ball.ay) > PRESS_ACCELERATION:
                ball.phase = ROLLING
            else:
                _stay(ball)
    for c in range(contacts - 1, -1, -1):
        # One that closes at first and opens within the step lasts for the step.
        if state.contacts[c].push <= PUSH_TOLERANCE and not state.contacts[c].closes:
            release(state, c)


@kernel
def _set_direction(ball: Ball, ahead: float, constants: Constants) -> None:
    # The direction that friction opposes, `ahead` seconds along the present arc.
    if ball.phase == SLIDING:
        ux, uy = slip(ball, constants.radius)
        dx = ux + (ball.ax - constants.radius * ball.alpha_y) * ahead
        dy = uy + (ball.ay + constants.radius * ball.alpha_x) * ahead
    else:
        dx = ball.vx + ball.ax * ahead
        dy = ball.vy + ball.ay * ahead
    length = math.sqrt(dx * dx + dy * dy)
    if length > 0.0:
        ball.dir_x = dx / length
        ball.dir_y = dy / length


@kernel
def _stay(ball: Ball) -> None:
    ball.ax = 0.0
    ball.ay = 0.0
    ball.alpha_x = 0.0
    ball.alpha_y = 0.0


@kernel
def _set_acceleration(ball: Ball, constants: Constants) -> None:
    # Of a pushed ball; spin follows from friction alone.
    px, py = ball.push_x, ball.push_y
    if ball.phase == SLIDING:
        fx = -constants.sliding * ball.dir_x
        fy = -constants.sliding * ball.dir_y
        ball.ax = px + fx
        ball.ay = py + fy
        ball.alpha_x = 2.5 * fy / constants.radius
        ball.alpha_y = -2.5 * fx / constants.radius
        return
    push = math.sqrt(px * px + py * py)
    grip = GRIP * constants.sliding
    resistance = constants.rolling * (1.0 - push / grip) if push < grip else 0.0
    dx, dy = ball.dir_x, ball.dir_y
    if ball.phase == AT_REST:
        if ROLLING_SHARE * push <= resistance or push == 0.0:
            _stay(ball)
            return
        dx = px / push
        dy = py / push
    ball.ax = ROLLING_SHARE * px - resistance * dx
    ball.ay = ROLLING_SHARE * py - resistance * dy
    ball.alpha_x = -ball.ay / constants.radius
    ball.alpha_y = ball.ax / constants.radius


@kernel
def _push(ball: Ball, fx: float, fy: float, constants: Constants) -> None:
    ball.push_x += fx
    ball.push_y += fy
    _set_acceleration(ball, constants)


@kernel
def _solve_pushes(state: State, constants: Constants, contacts: int, count: int, step: float) -> None:
    # Pushes of an island by sweeps over them (projected Gauss-Seidel). With a step, no gap changes over it but for an
    # overlap, which ends; without, there is no relative normal acceleration.
    for k in range(count):
        ball = state.balls[state.members[k].ball]
        ball.push_x = 0.0
        ball.push_y = 0.0
        _set_acceleration(ball, constants)
    for c in range(contacts):
        contact = state.contacts[c]
        fx = contact.push * contact.normal_x
        fy = contact.push * contact.normal_y
        _push(state.balls[contact.first], fx, fy, constants)
        if contact.second >= 0:
            _push(state.balls[contact.second], -fx, -fy, constants)
    # The resistance falls with the push, so a ball that rolls along it gives distance more than by the 5/7.
    rolling_mobility = ROLLING_SHARE
    if constants.sliding > 0.0:
        rolling_mobility += constants.rolling / (GRIP * constants.sliding)
    enough = max(PUSH_TOLERANCE, GAP_TOLERANCE / (step * step)) if step > 0.0 else PUSH_TOLERANCE
    for sweep in range(MAX_ITERATIONS):
        state.clock[0].work += contacts
        relaxation = 1.0 if sweep < PLAIN_SWEEPS else OVER_RELAXATION
        worst = 0.0
        for c in range(contacts):
            contact = state.contacts[c]
            total = _mobility_along(state.balls[contact.first], contact, rolling_mobility)
            if contact.second >= 0:
                total += _mobility_along(state.balls[contact.second], contact, rolling_mobility)
            if step > 0.0:
                opened, overlap = _separation_change(state, constants, contact, step)
                if overlap > LEAST_OVERLAP and sweep < RESTORING_SWEEPS:
                    opened -= min(overlap, RESTORING_SPEED * step)
                opening = 2.0 * opened / (step * step)
            else:
                opening = _opening_acceleration(state, contact)
            before = contact.push
            _set_push(state, contact, max(before - relaxation * opening / total, 0.0), constants)
            worst = max(worst, abs(contact.push - before))
        if worst <= enough:
            break
        if sweep >= FIRST_LEAP and sweep % LEAP_SWEEPS == 0:
            _leap(state, constants, contacts, sweep)


@kernel
def _leap(state: State, constants: Constants, contacts: int, sweep: int) -> None:
    # Where pushes change by nearly as much in each LEAP_SWEEPS, take them on to where that leads: pushes in a row of
    # resting balls grow by what little one of them yields in a sweep, until the last one yields.
    along = 0.0
    square = 0.0
    for c in range(contacts):
        contact = state.contacts[c]
        change = contact.push - contact.marked if sweep > FIRST_LEAP else 0.0
        along += change * contact.change
        square += contact.change * contact.change
        contact.marked = contact.push
        contact.change = change
    if sweep == FIRST_LEAP or abs(along - square) >= STEADY * square:
        return
    for c in range(contacts):
        contact = state.contacts[c]
        before = contact.push
        _set_push(state, contact, max(before + LEAP * contact.change, 0.0), constants)
        contact.marked = contact.push
        contact.change = 0.0


@kernel
def _set_push(state: State, contact: Contact, push: float, constants: Constants) -> None:
    change = push - contact.push
    if change == 0.0:
        return
    contact.push = push
    nx, ny = contact.normal_x, contact.normal_y
    _push(state.balls[contact.first], change * nx, change * ny, constants)
    if contact.second >= 0:
        _push(state.balls[contact.second], -change * nx, -change * ny, constants)


@kernel
def _mobility_along(ball: Ball, contact: Contact, rolling_mobility: float) -> float:
    # Change of acceleration along a normal by a unit of push along it; of a rolling ball at most.
    if ball.phase == SLIDING:
        return 1.0
    square = ball.push_x * ball.push_x + ball.push_y * ball.push_y
    if ball.phase == ROLLING or square == 0.0 or (ball.ax == 0.0 and ball.ay == 0.0):
        return rolling_mobility
    # It sets off along its push: what is across that only turns it.
    along = ball.push_x * contact.normal_x + ball.push_y * contact.normal_y
    share = along * along / square
    turning = math.sqrt((ball.ax * ball.ax + ball.ay * ball.ay) / square)
    return max(share * rolling_mobility + (1.0 - share) * turning, LEAST_MOBILITY)


@kernel
def _separation_change(state: State, constants: Constants, contact: Contact, step: float) -> tuple[float, float]:
    # How far the bodies come apart over a step, m, and how far they overlap at its start if one of them moves.
    first = state.balls[contact.first]
    nx, ny = contact.normal_x, contact.normal_y
    if not turns(state, contact):
        opening = first.vx * nx + first.vy * ny + 0.5 * (first.ax * nx + first.ay * ny) * step
        overlap = overlap_with(state, -1 - contact.second, first.x, first.y) if first.phase != AT_REST else 0.0
        return opening * step, overlap
    qx, qy = separation(state, contact, 0.0)
    ex, ey = separation(state, contact, step)
    distance = math.sqrt(qx * qx + qy * qy)
    # |e| - |q| without cancellation
    change = (ex - qx) * (ex + qx) + (ey - qy) * (ey + qy)
    moving = first.phase != AT_REST or (contact.second >= 0 and state.balls[contact.second].phase != AT_REST)
    overlap = distance_in_touch(state, constants, contact) - distance if moving else 0.0
    return change / (math.sqrt(ex * ex + ey * ey) + distance), overlap


@kernel
def _opening_acceleration(state: State, contact: Contact) -> float:
    # Along the normal, m/s^2, the centripetal term included.
    vx, vy, ax, ay = relative_motion(state, contact)
    nx, ny = contact.normal_x, contact.normal_y
    opening = ax * nx + ay * ny
    if not turns(state, contact):
        return opening
    qx, qy = separation(state, contact, 0.0)
    across = vy * nx - vx * ny
    return opening + across * across / math.sqrt(qx * qx + qy * qy)


@kernel
def _step_for(ball: Ball, constants: Constants) -> float:
    # How long a held ball's directions stay nearly what they are.
    if ball.phase == AT_REST:
        return INF
    if ball.phase == SLIDING:
        vx, vy = slip(ball, constants.radius)
        ax = ball.ax - constants.radius * ball.alpha_y
        ay = ball.ay + constants.radius * ball.alpha_x
        error = SLIP_TURN_ERROR
    else:
        vx, vy, ax, ay = ball.vx, ball.vy, ball.ax, ball.ay
        error = ROLL_TURN_ERROR
    step = INF
    speed = math.sqrt(vx * vx + vy * vy)
    along = ax * ball.dir_x + ay * ball.dir_y
    across = abs(ax * ball.dir_y - ay * ball.dir_x)
    if across > 0.0:
        turn = min(MAX_TURN, math.sqrt(error / speed)) if speed > 0.0 else MAX_TURN
        step = turn * speed / across
        if ball.phase == ROLLING:  # at first the direction does not matter
            distance = least_distance(ball)
            step = max(
                step,
                2.0 * distance / (speed + math.sqrt(speed * speed + 2.0 * distance * math.sqrt(ax * ax + ay * ay))),
            )
    if along < 0.0 and speed < -along * 2.0 * step:
        stop = speed / -along
        step = stop if stop <= step else 0.5 * stop
    return step


@kernel
def _step_for_all(state: State, constants: Constants, count: int) -> float:
    step = MAX_STEP
    for k in range(count):
        step = min(step, _step_for(state.balls[state.members[k].ball], constants))
    return step


@kernel
def _solve_first_pushes(state: State, constants: Constants, contacts: int, count: int) -> None:
    # Pushes of an island at the start of a step.
    balls = state.balls
    for c in range(contacts):
        contact = state.contacts[c]
        slides = balls[contact.first].phase == SLIDING
        if contact.second >= 0 and balls[contact.second].phase == SLIDING:
            slides = True
        if not slides:
            contact.push = 0.0  # not from where it was: among resting balls any old push would do
    sliding_off = True
    while sliding_off:
        for k in range(count):
            _set_direction(balls[state.members[k].ball], 0.0, constants)
        _solve_pushes(state, constants, contacts, count, 0.0)
        sliding_off = False
        for k in range(count):
            if _slides_off(balls[state.members[k].ball], constants):
                sliding_off = True
    for c in range(contacts):
        contact = state.contacts[c]
        contact.closes = contact.push > PUSH_TOLERANCE or opening_speed(state, contact) < -constants.least_approach


@kernel
def _solve_step(state: State, constants: Constants, contacts: int, count: int) -> float:
    # The longest step of an island that its arcs allow, with the pushes over it; 0 where a ball had to be stopped.
    step = _step_for_all(state, constants, count)
    for c in range(contacts):
        turning = _turning_rate(state, state.contacts[c], constants)
        while turning * step * step * step > MAX_TURNING:
            step *= 0.5
    while True:
        step = max(step, MIN_STEP)
        for k in range(count):
            _set_direction(state.balls[state.members[k].ball], 0.5 * step, constants)
        set_normals(state, contacts, 0.5 * step)
        _solve_pushes(state, constants, contacts, count, step if step >= SHORT_STEP else 0.0)
        if _stop_reversing_balls(state, constants, contacts, count):
            return 0.0
        allowed = _step_for_all(state, constants, count)
        if allowed >= 0.5 * step:  # else a direction turns once the ball sets off
            allowed = _step_within_stray(state, contacts, step)
        if allowed >= step or step == MIN_STEP:
            return step
        step = allowed


@kernel
def _stop_reversing_balls(state: State, constants: Constants, contacts: int, count: int) -> bool:
    # Stop the balls that would roll no further than MIN_DISTANCE before their pushes turn them back: a ball
    # that rests is held by the resistance of the cloth, where one that hardly rolls would turn back again and again.
    # Returns whether there were any; the pushes are then to be solved again.
    stopped = False
    for k in range(count):
        ball = state.balls[state.members[k].ball]
        square = ball.vx * ball.vx + ball.vy * ball.vy
        along = ball.ax * ball.vx + ball.ay * ball.vy
        if ball.phase == ROLLING and 0.0 < square * math.sqrt(square) <= -2.0 * along * least_distance(ball):
            stop(ball)
            stopped = True
    if stopped:
        set_normals(state, contacts, 0.0)
        settle_velocities(state, constants, contacts, count)
    return stopped


@kernel
def _step_within_stray(state: State, contacts: int, step: float) -> float:
    # A step that keeps the gaps within MAX_STRAY at every instant, where they are what they were at both of its ends.
    # With relative place q, velocity v and acceleration a, the square of the distance d is then off by
    # t (t - h) (q.a + v^2 + v.a (t + h) + a^2/4 (t^2 + h t + h^2)) after t of a step h, and as it is not off after h,
    # by t (t - h)/h (v.a h t + a^2/4 (t^2 + h t) h - 2 q.v): no more than |q.v| h/2 + 4/27 |v.a| h^3 + a^2 h^4/16.
    allowed = step
    for c in range(contacts):
        contact = state.contacts[c]
        if not turns(state, contact):
            closing = abs(opening_speed(state, contact))
            while 0.25 * closing * allowed > MAX_STRAY:
                allowed *= 0.5
            continue
        vx, vy, ax, ay = relative_motion(state, contact)
        qx, qy = separation(state, contact, 0.0)
        most = 2.0 * MAX_STRAY * math.sqrt(qx * qx + qy * qy)
        linear = 0.5 * abs(qx * vx + qy * vy)
        cubic = 4.0 / 27.0 * abs(vx * ax + vy * ay)
        quartic = (ax * ax + ay * ay) / 16.0
        while (linear + (cubic + quartic * allowed) * allowed * allowed) * allowed > most:
            allowed *= 0.5
    return allowed


@kernel
def _turning_rate(state: State, contact: Contact, constants: Constants) -> float:
    # Of the normal of a contact, rad/s.
    if not turns(state, contact):
        return 0.0
    vx, vy, _, _ = relative_motion(state, contact)
    across = vy * contact.normal_x - vx * contact.normal_y
    return abs(across) / distance_in_touch(state, constants, contact)


@kernel
def _slides_off(ball: Ball, constants: Constants) -> bool:
    # Whether a push is more than a ball can roll with; it then begins to slip along the push.
    push = math.sqrt(ball.push_x * ball.push_x + ball.push_y * ball.push_y)
    if ball.phase == SLIDING or push <= GRIP * constants.sliding:
        return False
    ball.phase = SLIDING
    ball.dir_x = ball.push_x / push
    ball.dir_y = ball.push_y / push
    return True
