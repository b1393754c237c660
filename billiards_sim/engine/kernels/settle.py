# SPDX-License-Identifier: Apache-2.0
"""Bringing balls to an instant: free ones along their motion, those in sustained contact together.

Balls in contact keep no motion along the normals. It is taken out by impulses, to which a ball yields on the average
over fine bounces: `mobility`.
"""

from __future__ import annotations

import math

from .bounce import leniency
from .feature import normal_of
from .island import gather_island
from .kernel import kernel
from .motion import GRIP, anchor, mark, mobility, roll_off, slip
from .state import ARC, AT_REST, INF, ROLLING, SLIDING, Ball, Constants, Contact, State

MIN_STEP = 1e-8
"""s. A slip that friction ends within this time has ended."""

MIN_DISTANCE = 1e-12
"""m. A ball in contact that rolls no further than this rests; more after many slow impacts, as with their height."""

SPEED_TOLERANCE = 1e-15
"""m/s. Accuracy of the velocities when motion along the normals is taken out."""

LEAST_EFFECT = 1e-6
"""Of the squares of kicks, what they do to the balls. Kicks that cancel each other further would have to be a thousand
times the speed they stop: a ball that slides through a gap between a rail and a resting ball would end there."""

MAX_ITERATIONS = 1000
"""Bound on the sweeps over the contacts; chains of 16 balls need about 300."""


@kernel
def advance_to(state: State, constants: Constants, i: int, now: float) -> None:
    """Bring ball i, and what is in sustained contact with it, to `now` and mark it as changed.

    Balls in contact keep no motion along the normals; `update_contacts` is due for them.
    """
    mark(state, i)
    if state.balls[i].held > 0:
        _settle(state, constants, i, now)
    else:
        anchor(state.balls[i], now)


@kernel
def _settle(state: State, constants: Constants, i: int, now: float) -> None:
    balls = state.balls
    contacts, count = gather_island(state, i)
    for k in range(count):
        member = state.members[k].ball
        mark(state, member)
        anchor(balls[member], now)
        balls[member].phase_end = now
        _end_micro_slip(balls[member], constants)
    set_normals(state, contacts, 0.0)
    settle_velocities(state, constants, contacts, count)


@kernel
def settle_velocities(state: State, constants: Constants, contacts: int, count: int) -> None:
    """Take the motion along its normals from an island whose contacts and balls are gathered.

    A ball that stops by it does not yield any more, and its neighbours must not close on it.
    """
    stopping = True
    while stopping:
        _stop_normal_motion(state, constants, contacts, count)
        stopping = False
        for k in range(count):
            if _end_micro_motion(state.balls[state.members[k].ball], constants):
                stopping = True


@kernel
def _stop_normal_motion(state: State, constants: Constants, contacts: int, count: int) -> None:
    # The smallest kicks along the normals of an island that leave no velocity along any of them, by conjugate
    # gradients: sweeps from contact to contact take thousands where balls in a lattice nearly block each other.
    for c in range(contacts):
        state.contacts[c].left = False
    before = INF
    for _ in range(MAX_ITERATIONS):
        state.clock[0].work += contacts
        worst, square = _find_speeds(state, contacts)
        if worst <= SPEED_TOLERANCE:
            return
        part = _search(state, contacts, count, square / before)
        before = square if part > 0.0 else INF
        for k in range(count):
            ball = state.balls[state.members[k].ball]
            _kick(ball, part * ball.push_x, part * ball.push_y, constants.radius)


@kernel
def _find_speeds(state: State, contacts: int) -> tuple[float, float]:
    # At which the contacts of an island open that a kick is to change; returns the largest, and the sum of the squares.
    worst = 0.0
    square = 0.0
    for c in range(contacts):
        contact = state.contacts[c]
        total = mobility(state.balls[contact.first].phase)
        if contact.second >= 0:
            total += mobility(state.balls[contact.second].phase)
        contact.speed = opening_speed(state, contact) if total > 0.0 and not contact.left else 0.0
        worst = max(worst, abs(contact.speed))
        square += contact.speed * contact.speed
    return worst, square


@kernel
def _search(state: State, contacts: int, count: int, keep: float) -> float:
    # The next search direction, with so much of the one before kept, as kicks of the contacts and of the balls. Returns
    # how far to go along it, to where the velocities along the normals are least. Where its kicks cancel each other
    # that is nowhere, and the contact of the largest one is left out from then on.
    balls = state.balls
    for k in range(count):
        ball = balls[state.members[k].ball]
        ball.push_x = 0.0
        ball.push_y = 0.0
    gain = 0.0
    kicks = 0.0
    most = 0
    for c in range(contacts):
        contact = state.contacts[c]
        contact.kick = keep * contact.kick - contact.speed
        gain -= contact.kick * contact.speed
        kicks += contact.kick * contact.kick
        if abs(contact.kick) > abs(state.contacts[most].kick):
            most = c
        first = balls[contact.first]
        first.push_x += contact.kick * contact.normal_x
        first.push_y += contact.kick * contact.normal_y
        if contact.second >= 0:
            second = balls[contact.second]
            second.push_x -= contact.kick * contact.normal_x
            second.push_y -= contact.kick * contact.normal_y
    cost = 0.0
    for k in range(count):
        ball = balls[state.members[k].ball]
        cost += mobility(ball.phase) * (ball.push_x * ball.push_x + ball.push_y * ball.push_y)
    if cost > LEAST_EFFECT * kicks:
        return gain / cost
    state.contacts[most].left = True
    return 0.0


@kernel
def opening_speed(state: State, contact: Contact) -> float:
    """Speed along the normal of a contact at which its bodies come apart, m/s."""
    first = state.balls[contact.first]
    speed = first.vx * contact.normal_x + first.vy * contact.normal_y
    if contact.second >= 0:
        second = state.balls[contact.second]
        speed -= second.vx * contact.normal_x + second.vy * contact.normal_y
    return speed


@kernel
def _end_micro_slip(ball: Ball, constants: Constants) -> None:
    # A slip that friction ends within MIN_STEP.
    ux, uy = slip(ball, constants.radius)
    if ball.phase == SLIDING and math.sqrt(ux * ux + uy * uy) <= GRIP * constants.sliding * MIN_STEP:
        roll_off(ball, constants.radius)
        ball.phase = ROLLING


@kernel
def _end_micro_motion(ball: Ball, constants: Constants) -> bool:
    # A roll that has stopped, or is ending and would go no further than MIN_DISTANCE; returns whether the ball had any
    # velocity left. The acceleration stays: it tells what pushes the ball.
    square = ball.vx * ball.vx + ball.vy * ball.vy
    ending = ball.ax * ball.vx + ball.ay * ball.vy <= 0.0
    stopped = square <= constants.rest_speed * constants.rest_speed
    ending = ending and square <= 2.0 * constants.rolling * least_distance(ball)
    if not (ball.phase == ROLLING and (stopped or ending)):
        return False
    stop(ball)
    return square > 0.0


@kernel
def least_distance(ball: Ball) -> float:
    """Distance, m: a ball in contact that rolls no further rests."""
    return MIN_DISTANCE * leniency(ball.bounces)


@kernel
def stop(ball: Ball) -> None:
    """Lay a ball to rest where it is."""
    ball.phase = AT_REST
    ball.vx = 0.0
    ball.vy = 0.0
    ball.wx = 0.0
    ball.wy = 0.0


@kernel
def _kick(ball: Ball, jx: float, jy: float, radius: float) -> None:
    share = mobility(ball.phase)
    ball.vx += share * jx
    ball.vy += share * jy
    if ball.phase == ROLLING:  # a slip that is too small to count stays what it is, else energy could rise
        ball.wx -= share * jy / radius
        ball.wy += share * jx / radius


@kernel
def set_normals(state: State, contacts: int, ahead: float) -> None:
    """Set the normals of the first so many contacts to what they are `ahead` s along the present arcs."""
    for c in range(contacts):
        contact = state.contacts[c]
        if turns(state, contact):
            qx, qy = separation(state, contact, ahead)
            distance = math.sqrt(qx * qx + qy * qy)
            contact.normal_x = qx / distance
            contact.normal_y = qy / distance
        else:
            first = state.balls[contact.first]
            contact.normal_x, contact.normal_y = normal_of(state, -1 - contact.second, first.x, first.y)


@kernel
def turns(state: State, contact: Contact) -> bool:
    """Whether the normal of a contact turns as the bodies move: it is one of two balls, or of a ball and an arc."""
    return contact.second >= 0 or state.features[-1 - contact.second].kind == ARC


@kernel
def separation(state: State, contact: Contact, ahead: float) -> tuple[float, float]:
    """From the centre of the second body of a contact that turns to the first, m, `ahead` s along the present arcs."""
    first = state.balls[contact.first]
    if contact.second < 0:
        arc = state.features[-1 - contact.second]
        return (
            first.x - arc.x + (first.vx + 0.5 * first.ax * ahead) * ahead,
            first.y - arc.y + (first.vy + 0.5 * first.ay * ahead) * ahead,
        )
    second = state.balls[contact.second]
    return (
        first.x - second.x + (first.vx - second.vx + 0.5 * (first.ax - second.ax) * ahead) * ahead,
        first.y - second.y + (first.vy - second.vy + 0.5 * (first.ay - second.ay) * ahead) * ahead,
    )


@kernel
def relative_motion(state: State, contact: Contact) -> tuple[float, float, float, float]:
    """Velocity, m/s, and acceleration, m/s^2, of the first body of a contact as the second sees it."""
    first = state.balls[contact.first]
    if contact.second < 0:
        return first.vx, first.vy, first.ax, first.ay
    second = state.balls[contact.second]
    return first.vx - second.vx, first.vy - second.vy, first.ax - second.ax, first.ay - second.ay


@kernel
def distance_in_touch(state: State, constants: Constants, contact: Contact) -> float:
    """Of the centres of a contact that turns, m."""
    return 2.0 * constants.radius if contact.second >= 0 else state.features[-1 - contact.second].reach
