# SPDX-License-Identifier: Apache-2.0
"""What the kernels share: the records of balls, contacts, impacts and events.

Positions are centred: x and y are measured from the centre of the playing area, so that IEEE arithmetic, exact under
negation, keeps a mirror-symmetric scene symmetric.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

INF = math.inf

NOBODY = -1
"""Where a ball or a feature could stand, and none does."""

ONE_CELL = 32
"""Balls. Up to so many it is faster to look at all of them than to keep account of cells."""

OFF_TABLE = -1
AT_REST = 0
SLIDING = 1
ROLLING = 2
"""Phases. What has none is off the table: in no cell, so nothing meets it, and never scheduled."""

BALL_BALL = 0
BALL_RAIL = 1
ROLLED = 2
RESTED = 3
SHOT = 4
POCKETED = 5
"""Kinds of events."""

X_MIN = 0
X_MAX = 1
Y_MIN = 2
Y_MAX = 3
"""Sides of the playing area, in the order of the features, and of a cell."""

LINE = 0
ARC = 1
MOUTH = 2
"""Kinds of features: the nose of a rail or a jaw, the point between them, and where a ball falls into a pocket."""

RAILS = 4
"""Number of features that every table begins with: the lines of its rails."""

PARTS = 5
"""Number of features of a pocket, one after the other: two jaws, two points, the mouth."""

QUEUED = 1
LISTED = 2

REST_DISTANCE = 1e-20
"""m. A ball that would roll no further than this has stopped, 4e-11 m/s on the paper's cloth: otherwise balls in touch
hand on the rounding of their velocities in ever smaller steps. Without friction nothing stops."""

PRESS_HEIGHT = 1e-12
"""m. A bounce that would rise less than this is sustained contact; far below any position error that matters, far above
the rounding of a position (1e-16)."""

SPEED_ROUNDING = 1e-15
"""m/s. An approach this slow at a touch is rounding of velocities that were equal, even without friction."""


@dataclass(slots=True)
class Ball:
    """A ball. From its own last event on, the anchor, it moves by x + v t + a t^2/2 and w + alpha t, in closed form."""

    time: float = 0.0  # s, the anchor
    x: float = 0.0  # m, centred
    y: float = 0.0
    vx: float = 0.0  # m/s
    vy: float = 0.0
    ax: float = 0.0  # m/s^2
    ay: float = 0.0
    horizon: float = 0.0  # s, until when it moves like that and stays in its cell: the earliest of three times below
    hit_time: float = 0.0  # s, when it meets another ball at the earliest
    hit: int = 0  # that ball; NOBODY where it must be looked for then
    next_in_cell: int = 0  # ball
    cell_x: int = 0
    cell_y: int = 0
    event_time: float = 0.0  # s, the earlier of horizon and hit_time
    phase: int = AT_REST  # or ROLLING, SLIDING, OFF_TABLE
    held: int = 0  # number of sustained contacts
    touches: int = 0  # number of elastic contacts
    wx: float = 0.0  # rad/s
    wy: float = 0.0
    wz: float = 0.0
    alpha_x: float = 0.0  # rad/s^2
    alpha_y: float = 0.0
    alpha_z: float = 0.0  # until wz is 0
    vz: float = 0.0  # m/s, during an impact alone
    phase_end: float = 0.0  # s, when the phase, or a step of a sustained contact, ends
    feature_time: float = (
        0.0  # s, when it meets a feature at the earliest, or comes to the end of one that it is held at
    )
    feature: int = 0  # that feature; of a ball off the table the mouth that it fell into, 0 for none
    border_time: float = 0.0  # s, when it leaves its cell
    border: int = 0  # on which side
    held_at: int = 0  # bit k: in sustained contact with feature k
    push_x: float = 0.0  # m/s^2, push of its sustained contacts per mass; of their kicks, m/s, while those are sought
    push_y: float = 0.0
    dir_x: float = 0.0  # unit direction that friction opposes while in sustained contact
    dir_y: float = 0.0
    changed: bool = False  # its motion has changed and the predictions have not
    reported: int = AT_REST  # the phase that the log knows of
    bounces: int = 0  # slow impacts in a row
    member: int = 0  # of the group that is being gathered: QUEUED or LISTED


@dataclass(slots=True)
class Contact:
    """A sustained contact."""

    first: int = 0  # ball
    second: int = 0  # ball or, for feature k, -1 - k
    push: float = 0.0  # m/s^2 per mass
    normal_x: float = 0.0  # unit, from second to first
    normal_y: float = 0.0
    marked: float = 0.0  # m/s^2, the push some sweeps ago
    change: float = 0.0  # m/s^2, by how much it had changed until then, in as many sweeps
    closes: bool = False  # at the start of a step
    speed: float = 0.0  # m/s at which it opens
    kick: float = 0.0  # m/s, its part of a search direction for the kicks that stop it
    left: bool = False  # not stopped, since the others stop it but for what no kick of a likely size can


@dataclass(slots=True)
class Impact:
    """One of the impacts that happen at the same instant."""

    first: int = 0  # ball
    second: int = 0  # ball or, for feature k, -1 - k
    normal_x: float = 0.0  # unit, from second to first
    normal_y: float = 0.0
    approach: float = 0.0  # m/s, when it first closed
    closing: float = 0.0  # m/s, at the start of a reflection
    stopping: float = 0.0  # m/s, impulse per mass that stops it in one reflection
    impulse: float = 0.0  # N s
    grip: float = 0.0  # m/s, largest tangential impulse per mass in one reflection
    along: float = 0.0  # m/s, that impulse, along the horizontal tangent
    over: float = 0.0  # and across it


@dataclass(slots=True)
class Touch:
    """An elastic contact."""

    first: int = 0  # ball
    second: int = 0  # ball or, for feature k, -1 - k
    alone: bool = False  # nobody else can reach those who touch: it goes by the closed form
    approach: float = 0.0  # m/s, at the first touch
    normal_x: float = 0.0  # unit, from second to first, at the first touch
    normal_y: float = 0.0
    friction: float = 0.0  # coefficient
    turn: float = 0.0  # rad, by which the line of centres of a lone pair turns
    parting: float = 0.0  # m/s, speed at which it parts
    impulse_x: float = 0.0  # m/s, on the first, so far, per mass, without friction
    impulse_y: float = 0.0
    step_x: float = 0.0  # and in the present step
    step_y: float = 0.0
    kink: bool = False  # the step begins or ends where the touch does
    along: float = 0.0  # m/s, tangential impulse of a step, or of all of a lone pair's contact, per mass
    over: float = 0.0


@dataclass(slots=True)
class Stage:
    """A ball in a step of an elastic contact."""

    start_vx: float = 0.0  # m/s, at the start of the step
    start_vy: float = 0.0
    cloth_x: float = 0.0  # m/s^2, by the cloth's friction
    cloth_y: float = 0.0
    dx: float = 0.0  # m, displacement at a stage of the integration
    dy: float = 0.0
    ux: float = 0.0  # m/s, velocity there
    uy: float = 0.0
    fx: float = 0.0  # m/s^2, acceleration there
    fy: float = 0.0
    slow: bool = False  # all contacts of its island are
    moved: bool = False  # it is moved off others
    looked: bool = False  # it has looked for others that begin to touch its island
    before_x: float = 0.0  # m/s^2, at the stage before
    before_y: float = 0.0
    place_x: float = 0.0  # sums of accelerations, for place and velocity
    place_y: float = 0.0
    speed_x: float = 0.0
    speed_y: float = 0.0


@dataclass(slots=True)
class Feature:
    """What stands on the table, as the centre of a ball meets it: a stretch of a line, or a circle.

    On a line, and on an arc, there is something `near` to `far` away from `along`, to both sides. Lengths along t =
    (-normal_y, normal_x) count from the centre of the table. In the openings of a rail's line are pockets.
    """

    kind: int = LINE
    normal_x: float = 0.0  # unit, into the table; of an arc that in its middle, of a mouth along its axis
    normal_y: float = 0.0
    offset: float = 0.0  # m, of the table's centre over the line
    along: float = 0.0  # m
    near: float = 0.0
    far: float = 0.0
    x: float = 0.0  # m, centre of the circle
    y: float = 0.0
    reach: float = 0.0  # m, its radius
    low: int = 0  # the first part of the pocket before the stretch, NOBODY: none
    between: int = 0  # in its middle
    high: int = 0  # and behind it


@dataclass(slots=True)
class Slot:
    """A place for a ball in a list."""

    ball: int = 0


@dataclass(slots=True)
class Clock:
    """Where the run is."""

    begun: bool = False
    now: float = 0.0  # s, the last event
    passes: int = 0  # of the event loop
    work: int = 0  # looks at another ball or at a contact, and passes: what takes the kernels their time
    changed: int = 0  # number of balls whose motion has changed
    contacts: int = 0  # number of sustained contacts
    touches: int = 0  # number of elastic contacts
    events: int = 0  # number of events in the log
    logged: int = 0  # number of events since the clock was at 0


@dataclass(slots=True)
class Record:
    """An event in the log."""

    time: float = 0.0  # s
    kind: int = 0  # code
    first: int = 0  # ball
    second: int = 0  # ball or feature
    point_x: float = 0.0  # m, centred
    point_y: float = 0.0
    normal_x: float = 0.0
    normal_y: float = 0.0
    approach: float = 0.0  # m/s
    impulse: float = 0.0  # N s


@dataclass(slots=True)
class Constants:
    """What the kernels need of physics and table, derived once."""

    mass: float = 0.0  # kg
    radius: float = 0.0  # m
    sliding: float = 0.0  # m/s^2, deceleration of a sliding ball, mu_s g
    rolling: float = 0.0  # m/s^2, deceleration of a rolling ball, mu_r g
    ball_restitution: float = 0.0
    ball_friction: float = 0.0
    ball_friction_slow: float = 0.0
    ball_friction_decay: float = 0.0  # s/m
    rail_restitution: float = 0.0
    rail_friction: float = 0.0
    nose_sine: float = 0.0  # of the angle by which the nose's normal is tilted down
    nose_cosine: float = 0.0
    stiffness: float = 0.0  # m^-1/2 s^-2, K of `law.hertz` per mass; 0: contacts take no time
    ball_damping: float = 0.0  # alpha sqrt(m' K) per mass, of two balls
    rail_damping: float = 0.0  # and of a ball and a rail
    duration_factor: float = 0.0  # f of two balls
    rail_duration_factor: float = 0.0  # and of a ball and a rail
    shortening: float = 0.0  # of the contact of a lone pair: see `law.hertz`
    pressing: float = 0.0  # likewise, mean depth over v_n t_c
    integrates_all: bool = False  # what has a closed form, too
    contact_steps: float = 0.0  # steps of an integration in the duration of a contact
    spin_deceleration: float = 0.0  # rad/s^2, of the spin about the vertical
    centre_x: float = 0.0  # m, of the playing area in the frame `table`
    centre_y: float = 0.0
    cells_x: int = 0  # number of cells along x
    cells_y: int = 0
    cell_width: float = 0.0  # m
    cell_height: float = 0.0
    rest_speed: float = 0.0  # m/s, a ball or a slip this slow has stopped
    least_approach: float = 0.0  # m/s, bodies in touch that approach no faster do not
    cue_contact_time: float = 0.0  # s
    cue_end_mass: float = 0.0  # kg
    low_speed: float = 0.0  # m/s, faster bounces rise above PRESS_HEIGHT, whatever friction does


class State(NamedTuple):
    """The tables that the kernels work on.

    Clock and constants are tables of one row; constants and features do not change.
    """

    balls: Sequence[Ball]
    cells: Sequence[Slot]  # the first ball in each, row by row
    nodes: Sequence[Slot]  # of the tree, from 1 on: the first of the two below; the second half are the leaves
    changed: Sequence[Slot]
    contacts: Sequence[Contact]
    touches: Sequence[Touch]  # one more than there can be; none where contacts take no time
    stages: Sequence[Stage]  # of each ball; likewise
    clock: Sequence[Clock]
    constants: Sequence[Constants]
    features: Sequence[Feature]
    members: Sequence[Slot]  # scratch, as what follows: of a group
    impacts: Sequence[Impact]
    log: Sequence[Record]


SCRATCH = ("members", "impacts", "log")
"""Tables of a state that hold nothing from one call to the next, once the log is taken."""
