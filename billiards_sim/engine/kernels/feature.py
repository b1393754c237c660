# SPDX-License-Identifier: Apache-2.0
"""What stands on the table, as the centre of a ball meets it.

A ball meets the nose of a rail when its centre comes to the line that lies a radius inside of it, a jaw likewise, a
point where it comes to the circle a radius around its disc. It falls into a pocket where its centre comes to the circle
by which the slate is cut. Contacts and impacts name feature k as -1 - k, where a ball could stand.

Between the lines of the rails there is nothing but balls. So a ball meets first what stands on the line that it comes
to first: a nose, or in an opening one of the parts of a pocket. Only in openings, and behind them, are these looked at.
A pocket leaks nowhere: lines take a ball on their closed stretch, points all around, also where a nose or a jaw begins.
"""

from __future__ import annotations

import math

from .detection import TOUCH, contact_time, rail_contact_time
from .kernel import inlined, kernel
from .state import ARC, INF, LINE, MOUTH, NOBODY, PARTS, RAILS, Ball, Constants, Feature, State

LIP = 1e-9
"""m. A ball whose centre is so far beyond the cut of the slate falls, whichever way it goes. One that hangs may be a
little beyond it: a scene takes as much for rounding."""

OVERRUN = 1e-12
"""m. How far a ball is held at a line or an arc beyond its end: far above what rounds where it is, so that it is then
in touch with what follows."""


@kernel
def normal_of(state: State, k: int, x: float, y: float) -> tuple[float, float]:
    """Unit normal from feature k, a line or an arc, to a ball at (x, y)."""
    feature = state.features[k]
    if feature.kind == LINE:
        return feature.normal_x, feature.normal_y
    qx, qy = x - feature.x, y - feature.y
    distance = math.sqrt(qx * qx + qy * qy)
    return qx / distance, qy / distance


@kernel
def curvature_of(state: State, k: int) -> float:
    """1/m, of the path of a ball that stays on feature k."""
    feature = state.features[k]
    return 1.0 / feature.reach if feature.kind == ARC else 0.0


@kernel
def is_touched(state: State, k: int, x: float, y: float, reach: float) -> bool:
    """Whether a ball at (x, y) is within reach of feature k, m, a line or an arc."""
    feature = state.features[k]
    if feature.kind == ARC:
        return overlap_with(state, k, x, y) >= -reach
    return -feature.normal_x * x - feature.normal_y * y >= feature.offset - reach and _is_within(feature, x, y)


@kernel
def overlap_with(state: State, k: int, x: float, y: float) -> float:
    """How far a ball at (x, y) reaches into feature k, m, a line or an arc; negative where it does not."""
    feature = state.features[k]
    if feature.kind == LINE:
        return -feature.offset - x * feature.normal_x - y * feature.normal_y
    qx, qy = x - feature.x, y - feature.y
    return feature.reach - math.sqrt(qx * qx + qy * qy)


@kernel
def place_on(state: State, k: int, ball: Ball) -> None:
    """Put a ball that touches feature k, a line or an arc, where it is but for rounding."""
    feature = state.features[k]
    if feature.kind == ARC:
        nx, ny = normal_of(state, k, ball.x, ball.y)
        ball.x = feature.x + feature.reach * nx
        ball.y = feature.y + feature.reach * ny
        return
    along = feature.normal_x * ball.y - feature.normal_y * ball.x
    ball.x = -feature.normal_x * feature.offset - along * feature.normal_y
    ball.y = -feature.normal_y * feature.offset + along * feature.normal_x


@kernel
def is_held_at(ball: Ball, k: int) -> bool:
    """Whether a ball is in sustained contact with feature k."""
    return (ball.held_at >> k) & 1 == 1


@kernel
def pocket_at(state: State, x: float, y: float, reach: float) -> int:
    """First part of the pocket in whose opening a ball at (x, y) is, within reach, m, of a line; NOBODY for none."""
    for k in range(RAILS):
        feature = state.features[k]
        if feature.offset + x * feature.normal_x + y * feature.normal_y <= reach:
            part = _opening_at(feature, x, y)
            if part != NOBODY:
                return part
    return NOBODY


@kernel
def is_clear(state: State, x: float, y: float, reach: float) -> bool:
    """Whether a ball at (x, y) is further than a reach, m, off the lines of all rails, and so off all behind them."""
    for k in range(RAILS):
        feature = state.features[k]
        if feature.offset + x * feature.normal_x + y * feature.normal_y <= reach:
            return False
    return True


@kernel
def next_feature(state: State, k: int, x: float, y: float, reach: float) -> int:
    """The first line or arc after feature k, NOBODY: of all, on whose stretch a ball at (x, y) is, or so near to it.

    Of pockets only those in whose opening it is, or so near to that, m. NOBODY after the last one.
    """
    k += 1
    while k < RAILS:
        if _is_beside(state.features[k], x, y, reach):
            return k
        k += 1
    if len(state.features) > RAILS:
        part = pocket_at(state, x, y, reach)
        if part != NOBODY:
            for later in range(max(k, part), part + PARTS - 1):  # the last one is the mouth
                if _is_beside(state.features[later], x, y, reach):
                    return later
    return NOBODY


@kernel
def _is_beside(feature: Feature, x: float, y: float, reach: float) -> bool:
    away = abs(feature.normal_x * y - feature.normal_y * x - feature.along)
    return feature.near - reach <= away <= feature.far + reach


@inlined
def predict_feature(state: State, constants: Constants, ball: Ball) -> None:
    """Find the next contact of a ball with what stands on the table, from its anchor on."""
    if len(state.features) == RAILS:
        time, ball.feature = _first_nose(state, constants, ball)
    else:
        time, ball.feature = first_contact(
            state,
            ball.x,
            ball.y,
            ball.vx,
            ball.vy,
            ball.ax,
            ball.ay,
            ball.held_at,
            ball.phase_end - ball.time,
            constants.least_approach,
        )
    ball.feature_time = ball.time + time


@inlined
def _first_nose(state: State, constants: Constants, ball: Ball) -> tuple[float, int]:
    # When a ball meets a rail of a table without pockets, s from its anchor, and which one; INF and NOBODY if none.
    best = INF
    first = NOBODY
    for k in range(RAILS):
        feature = state.features[k]
        speed = -(ball.vx * feature.normal_x + ball.vy * feature.normal_y)
        acceleration = -(ball.ax * feature.normal_x + ball.ay * feature.normal_y)
        if (speed == 0.0 and acceleration == 0.0) or is_held_at(ball, k):
            continue
        distance = feature.offset + ball.x * feature.normal_x + ball.y * feature.normal_y
        time = rail_contact_time(distance, speed, acceleration, constants.least_approach)
        if time < best:
            best = time
            first = k
    return best, first


@kernel
def first_contact(
    state: State,
    x: float,
    y: float,
    vx: float,
    vy: float,
    ax: float,
    ay: float,
    held_at: int,
    duration: float,
    least: float,
) -> tuple[float, int]:
    """When a ball meets what stands on the table, s, and which feature; INF and NOBODY if it does not.

    Args:
        x, y, vx, vy, ax, ay: position m, velocity m/s and acceleration m/s^2, constant over the duration.
        held_at: bit k: in sustained contact with feature k; it meets the end of it.
        duration: s; parts of pockets are looked for no longer.
        least: m/s; a touching ball that approaches no faster does not approach.
    """
    best = INF
    first = NOBODY
    if vx == 0.0 and vy == 0.0 and ax == 0.0 and ay == 0.0:
        return best, first
    for k in range(RAILS):
        time = _line_time(state.features[k], x, y, vx, vy, ax, ay, (held_at >> k) & 1 == 1, least)
        if time < best:
            best = time
            first = k
    if len(state.features) == RAILS:
        return best, first
    inside = pocket_at(state, x, y, 0.0)
    if inside == NOBODY and held_at >> RAILS != 0:
        inside = _pocket_held_at(held_at)
    if inside == NOBODY:
        if best > duration:
            return INF, NOBODY
        if first == NOBODY or (held_at >> first) & 1 == 1:
            return best, first
        if _is_within(state.features[first], x + (vx + 0.5 * ax * best) * best, y + (vy + 0.5 * ay * best) * best):
            return best, first
    return _first_among_parts(state, inside, x, y, vx, vy, ax, ay, held_at, duration, least)


@kernel
def _pocket_held_at(held_at: int) -> int:
    # The first part of the pocket of which a ball is held at a part.
    part = RAILS
    while (held_at >> part) & ((1 << PARTS) - 1) == 0:
        part += PARTS
    return part


@kernel
def _first_among_parts(
    state: State,
    inside: int,
    x: float,
    y: float,
    vx: float,
    vy: float,
    ax: float,
    ay: float,
    held_at: int,
    duration: float,
    least: float,
) -> tuple[float, int]:
    # Of a ball in the pocket with the first part `inside`, or that comes to the opening of one.
    best = duration
    first = NOBODY
    for k in range(RAILS):
        held = (held_at >> k) & 1 == 1
        time = _line_time(state.features[k], x, y, vx, vy, ax, ay, held, least)
        if time < best and (
            held or _is_within(state.features[k], x + (vx + 0.5 * ax * time) * time, y + (vy + 0.5 * ay * time) * time)
        ):
            best = time
            first = k
    if inside != NOBODY:
        best, first = _first_part(state, inside, best, first, x, y, vx, vy, ax, ay, held_at, least)
    looked = inside
    for k in range(RAILS):
        time = _line_time(state.features[k], x, y, vx, vy, ax, ay, (held_at >> k) & 1 == 1, least)
        if time < best:
            part = _opening_at(state.features[k], x + (vx + 0.5 * ax * time) * time, y + (vy + 0.5 * ay * time) * time)
            if part not in (NOBODY, looked):
                best, first = _first_part(state, part, best, first, x, y, vx, vy, ax, ay, held_at, least)
                looked = part
    return (best, first) if first != NOBODY else (INF, NOBODY)


@kernel
def _first_part(
    state: State,
    part: int,
    best: float,
    first: int,
    x: float,
    y: float,
    vx: float,
    vy: float,
    ax: float,
    ay: float,
    held_at: int,
    least: float,
) -> tuple[float, int]:
    # The best and first so far, or what of a pocket comes before. Of two at the same instant the mouth comes last.
    for k in range(part, part + PARTS):
        feature = state.features[k]
        held = (held_at >> k) & 1 == 1
        if feature.kind == LINE:
            time = _line_time(feature, x, y, vx, vy, ax, ay, held, least)
            if time < best and not (
                held or _is_within(feature, x + (vx + 0.5 * ax * time) * time, y + (vy + 0.5 * ay * time) * time)
            ):
                time = INF
        elif held:
            time = _time_to_end(feature, x, y, vx, vy, ax, ay)
        else:
            time = _circle_time(feature, x, y, vx, vy, ax, ay, best, least)
        if time < best:
            best = time
            first = k
    return best, first


@kernel
def _is_within(feature: Feature, x: float, y: float) -> bool:
    # Whether a ball on a line is on the stretch of it where there is something.
    return feature.near <= abs(feature.normal_x * y - feature.normal_y * x - feature.along) <= feature.far


@kernel
def _opening_at(feature: Feature, x: float, y: float) -> int:
    # The first part of the pocket that opens in the line of a rail where a ball is; NOBODY where its nose is.
    along = feature.normal_x * y - feature.normal_y * x
    if along > feature.far:
        return feature.high
    if along < -feature.far:
        return feature.low
    return feature.between if abs(along) < feature.near else NOBODY


@kernel
def _line_time(
    feature: Feature, x: float, y: float, vx: float, vy: float, ax: float, ay: float, held: bool, least: float
) -> float:
    # When a ball comes to a line, wherever on it; where it is held there, to the end of the stretch.
    if held:
        return _time_to_end(feature, x, y, vx, vy, ax, ay) if feature.far < INF or feature.near > 0.0 else INF
    speed = -(vx * feature.normal_x + vy * feature.normal_y)
    acceleration = -(ax * feature.normal_x + ay * feature.normal_y)
    if speed == 0.0 and acceleration == 0.0:
        return INF
    distance = feature.offset + x * feature.normal_x + y * feature.normal_y
    if distance < 0.0 and not _is_within(feature, x, y):  # behind the line, where it can only come back from
        discriminant = speed * speed + 2.0 * acceleration * distance
        if speed < 0.0 and acceleration > 0.0 and discriminant >= 0.0:
            return (math.sqrt(discriminant) - speed) / acceleration
        return INF
    return rail_contact_time(distance, speed, acceleration, least)


@kernel
def _time_to_end(feature: Feature, x: float, y: float, vx: float, vy: float, ax: float, ay: float) -> float:
    # When a ball that is held at a line or an arc comes to where it ends.
    place = feature.normal_x * y - feature.normal_y * x - feature.along
    speed = feature.normal_x * vy - feature.normal_y * vx
    acceleration = feature.normal_x * ay - feature.normal_y * ax
    time = INF
    if feature.far < INF:
        far = feature.far + OVERRUN
        time = min(
            rail_contact_time(far - place, speed, acceleration, 0.0),
            rail_contact_time(far + place, -speed, -acceleration, 0.0),
        )
    if feature.near > 0.0:
        near = feature.near - OVERRUN
        if place > 0.0:
            return min(time, rail_contact_time(place - near, -speed, -acceleration, 0.0))
        return min(time, rail_contact_time(-place - near, speed, acceleration, 0.0))
    return time


@kernel
def _is_beyond_lip(feature: Feature, px: float, py: float) -> bool:
    # Whether a ball is in a mouth or behind it, m from its middle: it was pressed in, by what takes time.
    behind = px * feature.normal_x + py * feature.normal_y < 0.0
    return behind or math.sqrt(px * px + py * py) < feature.reach - LIP


@kernel
def _circle_time(
    feature: Feature, x: float, y: float, vx: float, vy: float, ax: float, ay: float, duration: float, least: float
) -> float:
    # When a ball comes to the circle of a point or a mouth.
    px, py = x - feature.x, y - feature.y
    if feature.kind == MOUTH and _is_beyond_lip(feature, px, py):
        return 0.0
    if duration == INF:  # without friction: past the closest point of its straight path
        duration = 2.0 * (abs(px) + abs(py)) / math.sqrt(vx * vx + vy * vy)
    time = contact_time(px, py, vx, vy, ax, ay, duration, feature.reach, least)
    if feature.kind != ARC or time == 0.0 or time == INF:
        return time
    # A ball that comes no closer than rounding, along the nose of a rail, passes.
    closer = contact_time(px, py, vx, vy, ax, ay, duration, feature.reach - TOUCH, least)
    return time if closer < INF else INF
