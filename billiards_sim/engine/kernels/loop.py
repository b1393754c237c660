# SPDX-License-Identifier: Apache-2.0
"""The event loop: take the earliest event, let it happen, predict again what it changed.

The life of an event:

1. It is predicted. Each ball knows when it meets another ball (`schedule.predict_pairs`) or what stands on the table
   (`feature.predict_feature`), when its phase or its step in sustained contact ends (`motion`, `press`), and when it
   leaves its cell (`cells`). The earliest of these is what the ball is in the tree with.
2. It is the earliest of all: it is on top of the tree (`schedule.reschedule`).
3. It happens. The balls concerned are brought to its instant (`settle.advance_to`). Of bodies that meet, those that
   bounce too low stay together (`bounce`, `island.hold`); what else touches at the same instant is solved with them
   (`cluster`); two alone follow the laws of impact (`impact`, `law/`). A phase that ends passes into the next
   (`motion.end_phase`).
4. It is logged, if it is one to tell of (`log`).
5. What it changed is marked (`motion.mark`), set going (`press.update_contacts` where balls press, else
   `motion.begin_motion`) and predicted again. What was not marked keeps its predictions.
"""

from __future__ import annotations

from .bounce import count_impact, presses_feature, presses_pair, subsides
from .cells import change_cell, predict_border
from .cluster import advance_all, closing_speed, reflect
from .feature import curvature_of, is_held_at, normal_of, place_on, predict_feature
from .impact import approach_speed, collide_feature, collide_pair, is_ideal, normal_between
from .island import gather_cluster, hold, is_held, release_ball, release_feature
from .kernel import kernel
from .law.spin import slow_spin
from .log import log_event, log_impact
from .motion import begin_motion, end_phase, mark, phase_of
from .pocket import first_due, pocket
from .press import update_contacts
from .schedule import await_step, enter_all, predict_pairs
from .shock.phase import advance_to, begin_touch, take_step
from .shock.touch import presses_for_a_while, takes_time
from .state import AT_REST, INF, MOUTH, NOBODY, RAILS, RESTED, ROLLED, ROLLING, SLIDING, Constants, State

DONE = 0
"""No event is left before the time asked for."""

PAUSED = 1
"""The work allowed is done, or the log is full; there may be more to do."""

CONTACTS_PER_BALL = 7
"""At most: equal discs have at most three contacts with others each, counted once, and a jaw or nose and a point on
both sides of a mouth."""


@kernel
def run_until(state: State, until: float, taken: int, work: int) -> int:
    """Let every event up to and including a time happen, until so much work is done; returns DONE or PAUSED.

    `taken` is the number of events since the clock was at 0 that have been copied from the log: once all of them are,
    the log begins again.
    """
    clock = state.clock[0]
    constants = state.constants[0]
    if taken == clock.logged:
        clock.events = 0
    room = len(state.log) - (CONTACTS_PER_BALL + 1) * len(state.balls)  # the most that happens at one instant
    if not clock.begun:
        clock.begun = True
        enter_all(state, constants)
    _resume(state, constants, clock.now)
    enough = clock.work + work
    while clock.work < enough:
        i = state.nodes[1].ball
        ball = state.balls[i]
        now = ball.event_time
        if now > until or now == INF:
            return DONE
        if clock.events > room:
            return PAUSED
        clock.now = now
        clock.passes += 1
        clock.work += 1
        if len(state.features) > RAILS:
            i = first_due(state, i, now)
            ball = state.balls[i]
        if ball.hit_time == now and ball.hit == NOBODY:
            if ball.touches > 0:
                await_step(state, i)
            else:
                predict_pairs(state, constants, i, now)
        elif ball.hit_time == now:
            _meet_ball(state, constants, min(i, ball.hit), max(i, ball.hit), now)
        elif ball.feature_time == now:
            _meet_feature(state, constants, i, ball.feature, now)
        elif ball.phase_end != now:
            change_cell(state, constants, i)
            predict_border(ball, constants, now)
            if ball.touches > 0:
                await_step(state, i)
            else:
                predict_pairs(state, constants, i, now)
        elif ball.held > 0 or ball.touches > 0:
            advance_to(state, constants, i, now)
        else:
            end_phase(ball, constants)
            mark(state, i)
        _resume(state, constants, now)
    return PAUSED


@kernel
def _meet_ball(state: State, constants: Constants, i: int, j: int, now: float) -> None:
    advance_to(state, constants, i, now)
    advance_to(state, constants, j, now)
    first, second = state.balls[i], state.balls[j]
    nx, ny = normal_between(first, second)
    approach = approach_speed(first, second, nx, ny)
    if takes_time(state, constants, i, j, approach):
        begin_touch(state, constants, i, j, now, approach)
        return
    if approach <= constants.least_approach:
        approach = 0.0
    if presses_pair(first, second, nx, ny, approach, constants):
        if approach > 0.0:
            _note_impact(state, constants, now, i, j, nx, ny, approach, constants.mass * approach)
        hold(state, i, j)
        advance_to(state, constants, i, now)
    elif approach > 0.0 and subsides(min(first.bounces, second.bounces), approach, constants):
        _join_all(state, constants, i, now)
    elif approach > 0.0:
        count = gather_cluster(state, constants, i, now)
        if count > 1:
            _collide_cluster(state, constants, count, now)
            return
        impulse = collide_pair(first, second, nx, ny, approach, constants)
        _note_impact(state, constants, now, i, j, nx, ny, approach, impulse)
        release_ball(state, i)
        release_ball(state, j)


@kernel
def _collide_cluster(state: State, constants: Constants, count: int, now: float) -> None:
    # The contacts of a cluster at the same instant.
    advance_all(state, constants, count, now)
    reflect(state, constants, count)
    for c in range(count):
        impact = state.impacts[c]
        if impact.impulse == 0.0:
            continue
        i, j = impact.first, impact.second
        _note_impact(state, constants, now, i, j, impact.normal_x, impact.normal_y, impact.approach, impact.impulse)
        release_ball(state, i)
        if j >= 0:
            release_ball(state, j)


@kernel
def _join_all(state: State, constants: Constants, i: int, now: float) -> None:
    # Everything that touches ball i, and what touches that, stays together. All of it at once: a ball that slides
    # through a gap between two others would hit one and the other in turn.
    count = gather_cluster(state, constants, i, now)
    advance_all(state, constants, count, now)
    for c in range(count):
        impact = state.impacts[c]
        first, second = impact.first, impact.second
        closing = closing_speed(state, impact)
        if closing > constants.least_approach:
            impulse = constants.mass * closing
            _note_impact(state, constants, now, first, second, impact.normal_x, impact.normal_y, closing, impulse)
        if not (is_held(state, first, second) or presses_for_a_while(state, first, second)):
            hold(state, first, second)
    advance_to(state, constants, i, now)


@kernel
def _meet_feature(state: State, constants: Constants, i: int, k: int, now: float) -> None:
    advance_to(state, constants, i, now)
    ball = state.balls[i]
    if state.features[k].kind == MOUTH:
        pocket(state, constants, i, k, now)
        return
    if is_held_at(ball, k):  # until its end
        release_feature(state, i, k)
        return
    nx, ny = normal_of(state, k, ball.x, ball.y)
    place_on(state, k, ball)
    approach = -(nx * ball.vx + ny * ball.vy)
    if takes_time(state, constants, i, -1 - k, approach):
        begin_touch(state, constants, i, -1 - k, now, approach)
        return
    if approach <= constants.least_approach:
        approach = 0.0
    bounces = ball.bounces
    if approach > 0.0:
        count_impact(ball, approach, constants)
    if presses_feature(ball, nx, ny, curvature_of(state, k), approach, constants):
        if approach > 0.0:
            log_impact(state, constants, now, i, -1 - k, nx, ny, approach, constants.mass * approach)
        hold(state, i, -1 - k)
        advance_to(state, constants, i, now)
    elif approach > 0.0 and subsides(ball.bounces, approach, constants):
        _join_all(state, constants, i, now)
    elif approach > 0.0:
        # Where rails rub, what one body does changes what another beside the ball does to it. In a pocket, where they
        # meet at any angle, it does so anyway.
        if k >= RAILS or not is_ideal(constants):
            count = gather_cluster(state, constants, i, now)
            if count > 1:
                ball.bounces = bounces  # counted with those of the cluster
                _collide_cluster(state, constants, count, now)
                return
        impulse = collide_feature(ball, nx, ny, constants)
        log_impact(state, constants, now, i, -1 - k, nx, ny, approach, impulse)
        release_ball(state, i)


@kernel
def _note_impact(
    state: State,
    constants: Constants,
    now: float,
    i: int,
    j: int,
    nx: float,
    ny: float,
    approach: float,
    impulse: float,
) -> None:
    # Log an impact and count it.
    log_impact(state, constants, now, i, j, nx, ny, approach, impulse)
    count_impact(state.balls[i], approach, constants)
    if j >= 0:
        count_impact(state.balls[j], approach, constants)


@kernel
def _resume(state: State, constants: Constants, now: float) -> None:
    # Set going every ball that is marked as changed, in sustained contact or free, and predict it again.
    clock = state.clock[0]
    k = 0
    while k < clock.changed:
        i = state.changed[k].ball
        ball = state.balls[i]
        if ball.held > 0 and ball.phase_end <= now:
            update_contacts(state, constants, i, now)
        elif ball.touches > 0 and ball.phase_end <= now:
            take_step(state, constants, i, now)
            k = -1  # who is run into may have been among those before, and new ones are marked
        k += 1
    for k in range(clock.changed):
        i = state.changed[k].ball
        ball = state.balls[i]
        ball.changed = False
        if ball.touches > 0:
            predict_border(ball, constants, now)
            await_step(state, i)
            continue
        if ball.held == 0:
            begin_motion(ball, phase_of(ball, constants), constants)
        if constants.spin_deceleration > 0.0:
            slow_spin(ball, constants)
        _report_phase(state, i, now)
        predict_feature(state, constants, ball)
        predict_border(ball, constants, now)
    for k in range(clock.changed):
        i = state.changed[k].ball
        if state.balls[i].touches == 0:
            predict_pairs(state, constants, i, now)
    clock.changed = 0


@kernel
def _report_phase(state: State, i: int, now: float) -> None:
    # Log the end of a slip or of a motion.
    ball = state.balls[i]
    phase = ball.phase
    before = ball.reported
    ball.reported = phase
    if (phase == ROLLING and before == SLIDING) or (phase == AT_REST and before != AT_REST):
        kind = ROLLED if phase == ROLLING else RESTED
        log_event(state, now, kind, i, NOBODY, ball.x, ball.y, 0.0, 0.0, 0.0, 0.0)
