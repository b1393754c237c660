# SPDX-License-Identifier: Apache-2.0
"""Who is in touch with whom: sustained contacts, the islands that they join, and clusters of bodies that touch."""

from __future__ import annotations

import math

from .cells import first_neighbour, next_neighbour
from .detection import TOUCH
from .feature import is_clear, is_held_at, is_touched, pocket_at
from .kernel import kernel
from .motion import place_at
from .state import LISTED, NOBODY, PARTS, QUEUED, RAILS, Constants, State


@kernel
def hold(state: State, first: int, second: int) -> None:
    """Add a sustained contact between ball `first` and ball `second`, or feature -1 - `second`."""
    clock = state.clock[0]
    contact = state.contacts[clock.contacts]
    clock.contacts += 1
    contact.first = first
    contact.second = second
    contact.push = 0.0
    state.balls[first].held += 1
    if second >= 0:
        state.balls[second].held += 1
    else:
        state.balls[first].held_at |= 1 << (-1 - second)


@kernel
def is_held(state: State, first: int, second: int) -> bool:
    """Whether ball `first` and ball `second`, or feature -1 - `second`, are in sustained contact."""
    if second >= 0:
        return hold_each_other(state, first, second)
    return is_held_at(state.balls[first], -1 - second)


@kernel
def hold_each_other(state: State, i: int, j: int) -> bool:
    """Whether balls i and j are in sustained contact with each other."""
    for c in range(state.clock[0].contacts):
        first, second = state.contacts[c].first, state.contacts[c].second
        if (first == i and second == j) or (first == j and second == i):
            return True
    return False


@kernel
def release(state: State, index: int) -> None:
    """End a sustained contact."""
    clock = state.clock[0]
    contact = state.contacts[index]
    first = state.balls[contact.first]
    first.held -= 1
    if contact.second >= 0:
        state.balls[contact.second].held -= 1
    else:
        first.held_at &= ~(1 << (-1 - contact.second))
    clock.contacts -= 1
    for c in range(index, clock.contacts):
        following = state.contacts[c + 1]
        state.contacts[c].first = following.first
        state.contacts[c].second = following.second
        state.contacts[c].push = following.push


@kernel
def release_ball(state: State, i: int) -> None:
    """End every sustained contact of a ball: what pushed it is no longer what decides."""
    if state.balls[i].held == 0:
        return
    for c in range(state.clock[0].contacts - 1, -1, -1):
        contact = state.contacts[c]
        if contact.first == i or contact.second == i:
            release(state, c)


@kernel
def release_feature(state: State, i: int, k: int) -> None:
    """End the sustained contact of ball i with feature k."""
    for c in range(state.clock[0].contacts):
        if state.contacts[c].first == i and state.contacts[c].second == -1 - k:
            release(state, c)
            return


@kernel
def gather_island(state: State, i: int) -> tuple[int, int]:
    """Bring the contacts of the island of ball i, what it is in sustained contact with directly or through others, to
    the front of the list.

    Returns the number of its contacts and of its balls, which are listed as members.
    """
    balls, contacts = state.balls, state.contacts
    found = 0
    count = _enlist(state, 0, i)
    done = 0
    while done < count:
        ball = state.members[done].ball
        done += 1
        for c in range(found, state.clock[0].contacts):
            first, second = contacts[c].first, contacts[c].second
            if ball not in (first, second):
                continue
            contacts[c].first, contacts[c].second = contacts[found].first, contacts[found].second
            contacts[found].first, contacts[found].second = first, second
            contacts[c].push, contacts[found].push = contacts[found].push, contacts[c].push
            found += 1
            other = second if first == ball else first
            if other >= 0 and balls[other].member == 0:
                count = _enlist(state, count, other)
    _dismiss(state, count)
    return found, count


@kernel
def gather_cluster(state: State, constants: Constants, start: int, now: float) -> int:
    """List the contacts of everything that touches the ball `start`, and of what touches that; returns their number."""
    balls = state.balls
    impacts = 0
    count = _enlist(state, 0, start)
    done = 0
    while done < count:
        i = state.members[done].ball
        done += 1
        balls[i].member = LISTED
        x, y = place_at(balls[i], now)
        if not is_clear(state, x, y, 2.0 * TOUCH):
            impacts = _list_features(state, impacts, i, x, y)
        j = first_neighbour(state, constants, i)
        while j != NOBODY:
            if balls[j].member != LISTED and _in_touch(state, constants, i, j, x, y, now):
                if balls[j].member == 0:
                    count = _enlist(state, count, j)
                _list(state, impacts, min(i, j), max(i, j))
                impacts += 1
            j = next_neighbour(state, constants, i, j)
    _dismiss(state, count)
    return impacts


@kernel
def _list_features(state: State, impacts: int, i: int, x: float, y: float) -> int:
    # Rails, and parts of the pocket in whose opening ball i is, at (x, y); returns the number of all contacts.
    for k in range(RAILS):
        if is_touched(state, k, x, y, TOUCH):
            _list(state, impacts, i, -1 - k)
            impacts += 1
    part = pocket_at(state, x, y, TOUCH)
    if part != NOBODY:
        for k in range(part, part + PARTS - 1):  # the last one is the mouth
            if is_held_at(state.balls[i], k) or is_touched(state, k, x, y, TOUCH):
                _list(state, impacts, i, -1 - k)
                impacts += 1
    return impacts


@kernel
def _enlist(state: State, count: int, i: int) -> int:
    # Take ball i as the next member of the group; returns how many there are.
    state.balls[i].member = QUEUED
    state.members[count].ball = i
    return count + 1


@kernel
def _dismiss(state: State, count: int) -> None:
    for k in range(count):
        state.balls[state.members[k].ball].member = 0


@kernel
def _in_touch(state: State, constants: Constants, i: int, j: int, x: float, y: float, now: float) -> bool:
    # Whether ball i, at (x, y), touches ball j.
    reach = 2.0 * constants.radius + TOUCH
    other_x, other_y = place_at(state.balls[j], now)
    dx = x - other_x
    dy = y - other_y
    if abs(dx) > reach or abs(dy) > reach:
        return False
    if math.sqrt(dx * dx + dy * dy) <= reach:
        return True
    return state.balls[i].held > 0 and state.balls[j].held > 0 and hold_each_other(state, i, j)


@kernel
def _list(state: State, index: int, first: int, second: int) -> None:
    row = state.impacts[index]
    row.first = first
    row.second = second
    row.approach = 0.0
    row.impulse = 0.0
