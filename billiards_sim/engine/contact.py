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

from billiards_sim.engine.impact import normal_of_rail
from billiards_sim.engine.jit import Rows, entry, kernel
from billiards_sim.engine.motion import anchor, phase_of, roll_off, slip
from billiards_sim.engine.state import (
    ALPHA_X,
    ALPHA_Y,
    AT_REST,
    AX,
    AY,
    CHANGED,
    CONTACT_COLUMNS,
    CONTACTS,
    DIR_X,
    DIR_Y,
    FIRST,
    FIRST_PUSH,
    HELD,
    HELD_X,
    INF,
    NORMAL_X,
    NORMAL_Y,
    PHASE,
    PHASE_END,
    PUSH,
    PUSH_X,
    PUSH_Y,
    ROLLING,
    SECOND,
    SLIDING,
    UPDATE_TIME,
    VX,
    VY,
    WX,
    WY,
    Constants,
    State,
    X,
    Y,
)

PRESS_HEIGHT = 1e-12
"""m. A bounce that would rise less than this is sustained contact; far below any position error that matters, far above
the rounding of a position (1e-16)."""

PRESS_ACCELERATION = 1e-10
"""m/s^2. Bodies that close more slowly do not press: it moves them by less than 1e-10 m within a second."""

MICRO_SLIP = 10.0
"""Times the approach speed: a slip this small is left over from the last bounces, the ball rolls on average."""

SHORT_STEP = 2e-5
"""s. In shorter steps a gap cannot stray by 1e-12 m, and its change is lost in rounding: accelerations decide alone."""

MAX_STEP = 1.0
"""s. Where nothing turns, a step may be as long as the motion."""

MAX_STRAY = 1e-9
"""m s/s: turning rate of a normal times the cube of a step. Between the ends of a step the gap of two balls, whose push
changes by a few m/s^2 a radian, then strays by less than 1e-10 m."""

MIN_STEP = 1e-8
"""s. A slip that friction ends within this time has ended."""

MIN_WAY = 1e-12
"""m. A ball in contact that rolls no further than this rests."""

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

SPEED_TOLERANCE = 1e-15
"""m/s. Accuracy of the velocities when motion along the normals is taken out."""

MAX_ITERATIONS = 1000
"""Bound on the sweeps over the contacts; chains of 16 balls need about 300."""


@kernel
def hold(state: State, first: int, second: float) -> None:
    """Add a sustained contact between ball `first` and ball `second`, or rail -1 - `second`."""
    clock = state.clock[0]
    contact = state.contacts[int(clock[CONTACTS])]
    clock[CONTACTS] += 1.0
    contact[FIRST] = first
    contact[SECOND] = second
    contact[PUSH] = 0.0
    state.balls[first][HELD] += 1.0
    if second >= 0.0:
        state.balls[int(second)][HELD] += 1.0
    else:
        rail = -1 - int(second)
        state.balls[first][HELD_X + rail // 2] = 2.0 * (rail % 2) - 1.0


@kernel
def _release(state: State, index: int) -> None:
    clock = state.clock[0]
    contact = state.contacts[index]
    first = state.balls[int(contact[FIRST])]
    first[HELD] -= 1.0
    if contact[SECOND] >= 0.0:
        state.balls[int(contact[SECOND])][HELD] -= 1.0
    else:
        first[HELD_X + (-1 - int(contact[SECOND])) // 2] = 0.0
    clock[CONTACTS] -= 1.0
    for c in range(index, int(clock[CONTACTS])):
        for column in range(CONTACT_COLUMNS):
            state.contacts[c][column] = state.contacts[c + 1][column]


@entry
def release_ball(state: State, i: int) -> None:
    """End every sustained contact of a ball: what pushed it is no longer what decides."""
    for c in range(int(state.clock[0][CONTACTS]) - 1, -1, -1):
        contact = state.contacts[c]
        if contact[FIRST] == i or contact[SECOND] == i:
            _release(state, c)


@kernel
def _mean_acceleration(ball: Rows, approach: float, constants: Constants) -> tuple[float, float]:
    # Of a ball about to bounce, on the average over fine bounces; with what already pushes it.
    if ball[HELD] > 0.0:
        return ball[AX], ball[AY]
    ux, uy = slip(ball, constants.radius)
    slipping = math.sqrt(ux * ux + uy * uy)
    if slipping > MICRO_SLIP * approach and phase_of(ball, constants) == SLIDING:
        return -constants.sliding * ux / slipping, -constants.sliding * uy / slipping
    speed = math.sqrt(ball[VX] * ball[VX] + ball[VY] * ball[VY])
    if speed > MICRO_SLIP * approach:
        return -constants.rolling * ball[VX] / speed, -constants.rolling * ball[VY] / speed
    return 0.0, 0.0


@kernel
def presses_rail(ball: Rows, nx: float, ny: float, approach: float, constants: Constants) -> bool:
    """Whether a ball that arrives at a rail (normal into the table) has bounced low enough to stay on it."""
    if _too_fast(constants.restitution * approach, constants):
        return False
    ax, ay = _mean_acceleration(ball, approach, constants)
    return _stays(-(ax * nx + ay * ny), constants.restitution * approach)


@kernel
def presses_ball(first: Rows, second: Rows, nx: float, ny: float, approach: float, constants: Constants) -> bool:
    """Whether two balls that meet (normal from the second to the first) bounce low enough to stay together."""
    if _too_fast(approach, constants):
        return False
    ax, ay = _mean_acceleration(first, approach, constants)
    bx, by = _mean_acceleration(second, approach, constants)
    across = (first[VY] - second[VY]) * nx - (first[VX] - second[VX]) * ny
    return _stays((bx - ax) * nx + (by - ay) * ny - 0.5 * across * across / constants.radius, approach)


@kernel
def _too_fast(speed: float, constants: Constants) -> bool:
    # Without a look at the motion: free balls close at no more than twice the friction of both kinds.
    return speed * speed > 4.0 * (constants.sliding + constants.rolling) * PRESS_HEIGHT


@kernel
def _stays(closing: float, speed: float) -> bool:
    return closing > PRESS_ACCELERATION and speed * speed <= 2.0 * closing * PRESS_HEIGHT


@kernel
def settle_contacts(state: State, constants: Constants, now: float) -> None:
    """Bring every ball in sustained contact to `now`, with no motion along the normals, and mark it as changed.

    The pushes are due for `update_contacts` then.
    """
    state.clock[0][UPDATE_TIME] = now
    count = int(state.clock[0][CONTACTS])
    for i in range(len(state.balls)):
        ball = state.balls[i]
        if ball[HELD] > 0.0:
            ball[CHANGED] = 1.0
            anchor(ball, now)
            _end_micro_slip(ball, constants)
    _set_normals(state, 0.0)
    for _ in range(MAX_ITERATIONS):
        worst = 0.0
        for c in range(count):
            contact = state.contacts[c]
            first = state.balls[int(contact[FIRST])]
            nx, ny = contact[NORMAL_X], contact[NORMAL_Y]
            speed = first[VX] * nx + first[VY] * ny
            give = _yield_to_kick(first)
            if contact[SECOND] >= 0.0:
                second = state.balls[int(contact[SECOND])]
                speed -= second[VX] * nx + second[VY] * ny
                give += _yield_to_kick(second)
            if give > 0.0:
                kick = -speed / give
                _kick(first, kick * nx, kick * ny, constants.radius)
                if contact[SECOND] >= 0.0:
                    _kick(second, -kick * nx, -kick * ny, constants.radius)
                worst = max(worst, abs(speed))
        if worst <= SPEED_TOLERANCE:
            break
    for i in range(len(state.balls)):
        if state.balls[i][HELD] > 0.0:
            _end_micro_motion(state.balls[i], constants)


@kernel
def _end_micro_slip(ball: Rows, constants: Constants) -> None:
    # A slip that friction ends within MIN_STEP.
    ux, uy = slip(ball, constants.radius)
    if ball[PHASE] == SLIDING and math.sqrt(ux * ux + uy * uy) <= 3.5 * constants.sliding * MIN_STEP:
        roll_off(ball, constants.radius)
        ball[PHASE] = ROLLING


@kernel
def _end_micro_motion(ball: Rows, constants: Constants) -> None:
    # A roll that has stopped, or is ending and would go no further than MIN_WAY. The acceleration stays: it tells what
    # pushes the ball.
    square = ball[VX] * ball[VX] + ball[VY] * ball[VY]
    ending = ball[AX] * ball[VX] + ball[AY] * ball[VY] <= 0.0
    stopped = square <= constants.rest_speed * constants.rest_speed
    if ball[PHASE] == ROLLING and (stopped or (ending and square <= 2.0 * constants.rolling * MIN_WAY)):
        ball[PHASE] = AT_REST
        ball[VX] = 0.0
        ball[VY] = 0.0
        ball[WX] = 0.0
        ball[WY] = 0.0


@kernel
def _yield_to_kick(ball: Rows) -> float:
    # Change of velocity by a unit impulse per mass, on the average over fine bounces.
    if ball[PHASE] == SLIDING:
        return 1.0
    return 5.0 / 7.0 if ball[PHASE] == ROLLING else 0.0


@kernel
def _kick(ball: Rows, jx: float, jy: float, radius: float) -> None:
    give = _yield_to_kick(ball)
    ball[VX] += give * jx
    ball[VY] += give * jy
    if ball[PHASE] == ROLLING:
        ball[WX] = -ball[VY] / radius
        ball[WY] = ball[VX] / radius


@kernel
def _set_normals(state: State, ahead: float) -> None:
    # Normals of all contacts, `ahead` seconds along the present arcs.
    for c in range(int(state.clock[0][CONTACTS])):
        contact = state.contacts[c]
        if contact[SECOND] >= 0.0:
            qx, qy = _separation(state, contact, ahead)
            distance = math.sqrt(qx * qx + qy * qy)
            contact[NORMAL_X] = qx / distance
            contact[NORMAL_Y] = qy / distance
        else:
            contact[NORMAL_X], contact[NORMAL_Y] = normal_of_rail(-1.0 - contact[SECOND])


@kernel
def _separation(state: State, contact: Rows, ahead: float) -> tuple[float, float]:
    first = state.balls[int(contact[FIRST])]
    second = state.balls[int(contact[SECOND])]
    return (
        first[X] - second[X] + (first[VX] - second[VX] + 0.5 * (first[AX] - second[AX]) * ahead) * ahead,
        first[Y] - second[Y] + (first[VY] - second[VY] + 0.5 * (first[AY] - second[AY]) * ahead) * ahead,
    )


@kernel
def _set_direction(ball: Rows, ahead: float, constants: Constants) -> None:
    # The direction that friction opposes, `ahead` seconds along the present arc.
    if ball[PHASE] == SLIDING:
        ux, uy = slip(ball, constants.radius)
        dx = ux + (ball[AX] - constants.radius * ball[ALPHA_Y]) * ahead
        dy = uy + (ball[AY] + constants.radius * ball[ALPHA_X]) * ahead
    else:
        dx = ball[VX] + ball[AX] * ahead
        dy = ball[VY] + ball[AY] * ahead
    length = math.sqrt(dx * dx + dy * dy)
    if length > 0.0:
        ball[DIR_X] = dx / length
        ball[DIR_Y] = dy / length


@kernel
def _stay(ball: Rows) -> None:
    ball[AX] = 0.0
    ball[AY] = 0.0
    ball[ALPHA_X] = 0.0
    ball[ALPHA_Y] = 0.0


@kernel
def _set_acceleration(ball: Rows, constants: Constants) -> None:
    # Of a pushed ball; spin follows from friction alone.
    px, py = ball[PUSH_X], ball[PUSH_Y]
    if ball[PHASE] == SLIDING:
        fx = -constants.sliding * ball[DIR_X]
        fy = -constants.sliding * ball[DIR_Y]
        ball[AX] = px + fx
        ball[AY] = py + fy
        ball[ALPHA_X] = 2.5 * fy / constants.radius
        ball[ALPHA_Y] = -2.5 * fx / constants.radius
        return
    push = math.sqrt(px * px + py * py)
    grip = 3.5 * constants.sliding
    resistance = constants.rolling * (1.0 - push / grip) if push < grip else 0.0
    dx, dy = ball[DIR_X], ball[DIR_Y]
    if ball[PHASE] == AT_REST:
        if 5.0 / 7.0 * push <= resistance or push == 0.0:
            _stay(ball)
            return
        dx = px / push
        dy = py / push
    ball[AX] = 5.0 / 7.0 * px - resistance * dx
    ball[AY] = 5.0 / 7.0 * py - resistance * dy
    ball[ALPHA_X] = -ball[AY] / constants.radius
    ball[ALPHA_Y] = ball[AX] / constants.radius


@kernel
def _push(ball: Rows, fx: float, fy: float, constants: Constants) -> None:
    ball[PUSH_X] += fx
    ball[PUSH_Y] += fy
    _set_acceleration(ball, constants)


@kernel
def _solve_pushes(state: State, constants: Constants, step: float) -> None:
    # Pushes of all contacts by sweeps over them (projected Gauss-Seidel). With a step, no gap changes over it; without,
    # no relative normal acceleration.
    count = int(state.clock[0][CONTACTS])
    for i in range(len(state.balls)):
        ball = state.balls[i]
        if ball[HELD] > 0.0:
            ball[PUSH_X] = 0.0
            ball[PUSH_Y] = 0.0
            _set_acceleration(ball, constants)
    for c in range(count):
        contact = state.contacts[c]
        fx = contact[PUSH] * contact[NORMAL_X]
        fy = contact[PUSH] * contact[NORMAL_Y]
        _push(state.balls[int(contact[FIRST])], fx, fy, constants)
        if contact[SECOND] >= 0.0:
            _push(state.balls[int(contact[SECOND])], -fx, -fy, constants)
    enough = max(PUSH_TOLERANCE, GAP_TOLERANCE / (step * step)) if step > 0.0 else PUSH_TOLERANCE
    for _ in range(MAX_ITERATIONS):
        worst = 0.0
        for c in range(count):
            contact = state.contacts[c]
            first = state.balls[int(contact[FIRST])]
            nx, ny = contact[NORMAL_X], contact[NORMAL_Y]
            give = 1.0 if first[PHASE] == SLIDING else 5.0 / 7.0
            if contact[SECOND] < 0.0:
                opening = first[AX] * nx + first[AY] * ny
            else:
                second = state.balls[int(contact[SECOND])]
                give += 1.0 if second[PHASE] == SLIDING else 5.0 / 7.0
                qx, qy = _separation(state, contact, 0.0)
                distance = math.sqrt(qx * qx + qy * qy)
                if step > 0.0:
                    ex, ey = _separation(state, contact, step)
                    # |e| - |q| without cancellation
                    change = (ex - qx) * (ex + qx) + (ey - qy) * (ey + qy)
                    opening = 2.0 * change / ((math.sqrt(ex * ex + ey * ey) + distance) * step * step)
                else:
                    across = (first[VY] - second[VY]) * nx - (first[VX] - second[VX]) * ny
                    opening = (first[AX] - second[AX]) * nx + (first[AY] - second[AY]) * ny
                    opening += across * across / distance
            new = max(contact[PUSH] - opening / give, 0.0)
            change = new - contact[PUSH]
            if change != 0.0:
                contact[PUSH] = new
                _push(first, change * nx, change * ny, constants)
                if contact[SECOND] >= 0.0:
                    _push(second, -change * nx, -change * ny, constants)
                worst = max(worst, abs(change))
        if worst <= enough:
            break


@kernel
def _step_for(ball: Rows, constants: Constants) -> float:
    # How long a held ball's directions stay nearly what they are.
    if ball[PHASE] == AT_REST:
        return INF
    if ball[PHASE] == SLIDING:
        vx, vy = slip(ball, constants.radius)
        ax = ball[AX] - constants.radius * ball[ALPHA_Y]
        ay = ball[AY] + constants.radius * ball[ALPHA_X]
        error = SLIP_TURN_ERROR
    else:
        vx, vy, ax, ay = ball[VX], ball[VY], ball[AX], ball[AY]
        error = ROLL_TURN_ERROR
    step = INF
    speed = math.sqrt(vx * vx + vy * vy)
    along = ax * ball[DIR_X] + ay * ball[DIR_Y]
    across = abs(ax * ball[DIR_Y] - ay * ball[DIR_X])
    if across > 0.0:
        turn = min(MAX_TURN, math.sqrt(error / speed)) if speed > 0.0 else MAX_TURN
        step = turn * speed / across
    if along < 0.0 and speed < -along * 2.0 * step:
        stop = speed / -along
        step = stop if stop <= step else 0.5 * stop
    return step


@kernel
def update_contacts(state: State, constants: Constants, now: float) -> None:
    """Solve the pushes for the next step and start the arcs of all balls in sustained contact, which are at `now`.

    Contacts without a push end. `settle_contacts` must have run at this time.
    """
    clock = state.clock[0]
    balls = state.balls
    for c in range(int(clock[CONTACTS])):
        state.contacts[c][PUSH] = 0.0  # not from where they were: among resting balls any old push would do
    sliding_off = True
    while sliding_off:
        for i in range(len(balls)):
            if balls[i][HELD] > 0.0:
                _set_direction(balls[i], 0.0, constants)
        _solve_pushes(state, constants, 0.0)
        sliding_off = False
        for i in range(len(balls)):
            if balls[i][HELD] > 0.0 and _slides_off(balls[i], constants):
                sliding_off = True
    for c in range(int(clock[CONTACTS])):
        state.contacts[c][FIRST_PUSH] = state.contacts[c][PUSH]
    step = MAX_STEP
    for i in range(len(balls)):
        if balls[i][HELD] > 0.0:
            step = min(step, _step_for(balls[i], constants))
    for c in range(int(clock[CONTACTS])):
        turning = _turning_rate(state, state.contacts[c], constants)
        while turning * step * step * step > MAX_STRAY:
            step *= 0.5
    step = max(step, MIN_STEP)
    for i in range(len(balls)):
        if balls[i][HELD] > 0.0:
            _set_direction(balls[i], 0.5 * step, constants)
    _set_normals(state, 0.5 * step)
    _solve_pushes(state, constants, step if step >= SHORT_STEP else 0.0)
    for i in range(len(balls)):
        ball = balls[i]
        if ball[HELD] > 0.0:
            ball[PHASE_END] = INF
            if ball[PHASE] == AT_REST:
                if abs(ball[AX]) + abs(ball[AY]) > PRESS_ACCELERATION:
                    ball[PHASE] = ROLLING
                else:
                    _stay(ball)
    for c in range(int(clock[CONTACTS]) - 1, -1, -1):
        # One that closes at first and opens within the step lasts for the step.
        if max(state.contacts[c][PUSH], state.contacts[c][FIRST_PUSH]) <= PUSH_TOLERANCE:
            _release(state, c)
    clock[UPDATE_TIME] = now + step if clock[CONTACTS] > 0.0 else INF


@kernel
def _turning_rate(state: State, contact: Rows, constants: Constants) -> float:
    # Of the normal of a contact, rad/s.
    if contact[SECOND] < 0.0:
        return 0.0
    first, second = state.balls[int(contact[FIRST])], state.balls[int(contact[SECOND])]
    across = (first[VY] - second[VY]) * contact[NORMAL_X] - (first[VX] - second[VX]) * contact[NORMAL_Y]
    return abs(across) / (2.0 * constants.radius)


@kernel
def _slides_off(ball: Rows, constants: Constants) -> bool:
    # Whether a push is more than a ball can roll with; it then begins to slip along the push.
    push = math.sqrt(ball[PUSH_X] * ball[PUSH_X] + ball[PUSH_Y] * ball[PUSH_Y])
    if ball[PHASE] == SLIDING or push <= 3.5 * constants.sliding:
        return False
    ball[PHASE] = SLIDING
    ball[DIR_X] = ball[PUSH_X] / push
    ball[DIR_Y] = ball[PUSH_Y] / push
    return True
