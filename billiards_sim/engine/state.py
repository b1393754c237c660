"""The arrays that the kernels share, column by column.

Positions are centred: x and y are measured from the centre of the playing area, so that IEEE arithmetic, exact under
negation, keeps a mirror-symmetric scene symmetric.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from billiards_sim.engine.jit import Rows
from billiards_sim.engine.physics import Physics
from billiards_sim.engine.table import Table

INF = math.inf

SPEED_LIMIT = 299_792_458.0
"""m/s. Largest speed, and spin times radius, of a ball at the start or after a shot: light's. Far below where the
powers in the formulas overflow."""

# Columns of a ball. Motion from its own last event on ("anchor") is x + v t + a t^2/2 and w + alpha t, in closed form.
TIME = 0  # s, the anchor
X, Y = 1, 2  # m, centred
VX, VY = 3, 4  # m/s
WX, WY, WZ = 5, 6, 7  # rad/s
AX, AY = 8, 9  # m/s^2
ALPHA_X, ALPHA_Y = 10, 11  # rad/s^2
PHASE = 12  # AT_REST, ROLLING or SLIDING
PHASE_END = 13  # s, when the phase ends by itself
RAIL_TIME, RAIL = 14, 15  # s, code; the next rail contact
HIT_TIME, HIT = 16, 17  # s, ball; the earliest predicted contact with another ball
HELD = 18  # number of sustained contacts
HELD_X, HELD_Y = 19, 20  # -1, 0 or 1: the rail that the ball is pressed to, by axis
PUSH_X, PUSH_Y = 21, 22  # m/s^2, push of its sustained contacts per mass
DIR_X, DIR_Y = 23, 24  # unit direction that friction opposes while in sustained contact
CHANGED = 25  # 1 while the motion has changed and the predictions have not
REPORTED = 26  # the phase that the log knows of
MEMBER = 27  # in the cluster that is being gathered
BALL_COLUMNS = 28

AT_REST = 0.0
SLIDING = 1.0
ROLLING = 2.0

# Columns of a sustained contact.
FIRST, SECOND = 0, 1  # ball; ball or, for a rail, -1 - code
PUSH = 2  # m/s^2 per mass
NORMAL_X, NORMAL_Y = 3, 4  # unit, from second to first
FIRST_PUSH = 5  # m/s^2, the push at the start of a step
CONTACT_COLUMNS = 6

# Columns of an impact, one of those that happen at the same instant.
I_FIRST, I_SECOND = 0, 1  # ball; ball or, for a rail, -1 - code
I_NORMAL_X, I_NORMAL_Y = 2, 3  # unit, from second to first
I_APPROACH = 4  # m/s, when it first closed
I_SHARE = 5  # m/s, what stops it in one reflection
I_IMPULSE = 6  # N s
IMPACT_COLUMNS = 7

# Columns of the clock, a table of one row.
NOW = 0  # s, the last event
UPDATE_TIME = 1  # s, when sustained contacts, and balls that were set going from outside, are next looked at
CONTACTS = 2  # number of sustained contacts
EVENTS = 3  # number of events in the log
CLOCK_COLUMNS = 4

# Columns of an event.
E_TIME, E_KIND, E_FIRST, E_SECOND = 0, 1, 2, 3  # E_SECOND: ball or rail
E_POINT_X, E_POINT_Y, E_NORMAL_X, E_NORMAL_Y, E_APPROACH, E_IMPULSE = 4, 5, 6, 7, 8, 9
EVENT_COLUMNS = 10


REST_WAY = 1e-20
"""m. A ball that would roll no further than this has stopped, 4e-11 m/s on the paper's cloth: otherwise balls in touch
hand on the rounding of their velocities in ever smaller steps. Without friction nothing stops."""

SPEED_ROUNDING = 1e-15
"""m/s. An approach this slow at a touch is rounding of velocities that were equal, even without friction."""


class State(NamedTuple):
    """Everything that changes."""

    balls: Rows  # (N, BALL_COLUMNS)
    pairs: Rows  # (N, N) s, predicted contact of each pair, symmetric
    contacts: Rows  # (capacity, CONTACT_COLUMNS)
    impacts: Rows  # (capacity, IMPACT_COLUMNS), scratch
    clock: Rows  # (1, CLOCK_COLUMNS)
    log: Rows  # (capacity, EVENT_COLUMNS)


class Constants(NamedTuple):
    """What the kernels need of physics and table, derived once."""

    mass: float  # kg
    radius: float  # m
    sliding: float  # m/s^2, deceleration of a sliding ball, mu_s g
    rolling: float  # m/s^2, deceleration of a rolling ball, mu_r g
    restitution: float
    limit_x: float  # m, largest |x| of a ball's centre
    limit_y: float  # m
    rest_speed: float  # m/s, a ball or a slip this slow has stopped
    least_approach: float  # m/s, bodies in touch that approach no faster do not


def constants(physics: Physics, table: Table) -> Constants:
    sliding = physics.sliding_friction * physics.gravity
    rolling = physics.rolling_friction * physics.gravity
    rest_speed = math.sqrt(2.0 * rolling * REST_WAY) if sliding > 0.0 else 0.0
    return Constants(
        mass=physics.mass,
        radius=physics.radius,
        sliding=sliding,
        rolling=rolling,
        restitution=physics.rail_restitution,
        limit_x=0.5 * table.length - physics.radius,
        limit_y=0.5 * table.width - physics.radius,
        rest_speed=rest_speed,
        least_approach=max(rest_speed, SPEED_ROUNDING),
    )
