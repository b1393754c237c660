# SPDX-License-Identifier: Apache-2.0
"""The node's parameters: declared from the quantities of `Physics` and `Table`, checked together.

A `physics.*` or `table.*` parameter that is given holds. One that is not takes the value of the preset, where one is
given, or else of the scene. The table's geometry is fixed while the node runs, but for what a new scene brings;
everything else changes at rest.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

from billiards_sim.engine.physics import PRESETS as PHYSICS_PRESETS
from billiards_sim.engine.physics import Physics
from billiards_sim.engine.quantity import Quantity, parts, preset, quantities, shown
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.scene_file import load_scene
from billiards_sim.engine.scenes import BUILT_IN
from billiards_sim.engine.table import PRESETS as TABLE_PRESETS
from billiards_sim.engine.table import Table

GROUPS = {"physics": Physics, "table": Table}
"""Groups of parameters, each the fields of one class."""

PARTS = {f"{group}.{field}": kind for group, owner in GROUPS.items() for field, kind in parts(owner).items()}
"""Kind of each part of a group, by its name. A part that is not there has 0 in all its parameters; one whose first
parameter is given as 0 is taken away."""

GROUP_QUANTITIES = {
    f"{name}.{field}": declared
    for group in GROUPS
    for name, owner in [(group, GROUPS[group]), *((part, PARTS[part]) for part in PARTS if part.startswith(group))]
    for field, declared in quantities(owner).items()
}
"""Quantity of each parameter of a group."""

GROUP_PRESETS: Mapping[str, Mapping[str, Callable[..., Any]]] = {
    "physics.preset": PHYSICS_PRESETS,
    "table.preset": TABLE_PRESETS,
}
"""What makes the presets of a group, by the parameter that names one and by their names."""

PRESET_HELP = "{}, or empty for the scene's own: values for those of the group that are not given themselves"

DEFAULT_SCENE = "eight_ball"

DEFAULT_FRAME = "table"

LONGEST_FRAME = 200
"""Characters of a frame's name."""

MOST_BALLS = 100
"""Of a scene file that a table takes: reading it keeps the ticks waiting, by less than 0.1 s for so many."""

SCENE_HELP = f"what is on the table from the next reset on: {', '.join(BUILT_IN)}, or the path of a scene file"

NUMBERS = {
    "update_rate": (
        100.0,
        Quantity(
            "Hz", "ticks a second: steps, and messages on balls/states and balls/poses", minimum=0.1, maximum=1000.0
        ),
    ),
    "real_time_factor": (
        1.0,
        Quantity("1", "simulated seconds in a second of the wall clock", minimum=0.001, maximum=1000.0),
    ),
    "marker_rate": (
        30.0,
        Quantity("Hz", "messages on markers a second, no more than ticks; 0 for none", minimum=0.0, maximum=1000.0),
    ),
    "placement_tolerance": (
        0.002,
        Quantity("m", "overlap with a ball or a rail that place_balls takes for noise", minimum=0.0, maximum=0.02),
    ),
}
"""Default and quantity of each number of the node's own."""

SWITCHES = {
    "track_orientation": (
        False,
        "put how the balls are turned into states, poses and frames; else they are all upright",
    ),
    "publish_clock": (False, "publish the table's time on /clock every tick, for nodes with use_sim_time"),
    "publish_tf": (False, "publish a frame for each ball on /tf every tick; needs tf2_msgs"),
}
"""Default and help of each switch."""

TEXTS = {
    "frame_id": (DEFAULT_FRAME, "frame of every message: origin at the outer corner of the rails, z = 0 on the cloth"),
    "frame_prefix": ("", "before a ball's name in the name of its frame, on /tf and in balls/twists"),
}
"""Default and help of each name of frames; see `frame_name`."""

AT_REST = "changeable while all balls rest"

ROS_OWN = ("use_sim_time", "start_type_description_service", "qos_overrides.")
"""What parameters that every node has start with."""


@dataclass(frozen=True)
class Settings:
    """Everything the node is told: the scene with all overrides applied, and what is the node's own.

    Attributes:
        given: the parameters that the user gave, by name; the others follow the defaults and the scene.
        loaded: the scene before `given` is applied to it.
    """

    scene: Scene
    scene_name: str
    update_rate: float
    real_time_factor: float
    marker_rate: float
    placement_tolerance: float
    track_orientation: bool
    publish_clock: bool
    publish_tf: bool
    frame_id: str
    frame_prefix: str
    given: Mapping[str, Any]
    loaded: Scene

    def values(self) -> dict[str, Any]:
        """The value of every parameter, by name."""
        values: dict[str, Any] = {"scene": self.scene_name}
        values |= {name: getattr(self, name) for name in (*NUMBERS, *SWITCHES, *TEXTS)}
        for group in GROUPS:
            values |= group_values(group, getattr(self.scene, group))
        return values | {name: self.given.get(name, "") for name in GROUP_PRESETS}


def read_settings(given: Mapping[str, Any], loaded: Scene | None = None) -> Settings:
    """Settings from the parameters that the user gave, by name; all others take their defaults.

    Args:
        given: the parameters.
        loaded: the scene that `given` names, if it has been loaded already.

    Raises:
        ValueError: a value of the wrong type or out of bounds, an unknown scene, an unknown `physics.*` or `table.*`
            name, a scene that does not fit the table. The text is one line and names the parameter.
    """
    for name in given:
        group = name.partition(".")[0]
        if group in GROUPS and name not in GROUP_QUANTITIES and name not in GROUP_PRESETS:
            raise ValueError(f"no parameter {name!r}; under {group!r} there are {', '.join(_fields(group))}")
    own: dict[str, Any] = {
        name: number(name, given.get(name, default), declared) for name, (default, declared) in NUMBERS.items()
    }
    own |= {name: switch(name, given.get(name, default)) for name, (default, _) in SWITCHES.items()}
    own |= {name: frame_name(name, given.get(name, default)) for name, (default, _) in TEXTS.items()}
    scene_name = given.get("scene", DEFAULT_SCENE)
    start = loaded or find_scene(scene_name)
    if "track_orientation" not in given:
        own["track_orientation"] = start.track_orientation
    groups = {}
    for group in GROUPS:
        groups[group] = _group(group, given, _base(group, given, start))
    try:
        scene = BUILT_IN[scene_name](**groups) if scene_name in BUILT_IN else dataclasses.replace(start, **groups)
    except ValueError as error:
        raise ValueError(f"scene {scene_name!r} does not fit these physics and table parameters: {error}") from None
    scene = dataclasses.replace(scene, track_orientation=own["track_orientation"])
    if own["publish_tf"] and own["frame_id"] in (own["frame_prefix"] + ball for ball in scene.names):
        raise ValueError(f"the table and a ball cannot both have the frame {own['frame_id']!r}: change frame_id")
    return Settings(scene, scene_name, **own, given=dict(given), loaded=start)


def read_groups(given: Mapping[str, Any]) -> dict[str, Any]:
    """What the parameters of all groups, by name, describe: `Physics` as "physics", `Table` as "table".

    Raises:
        ValueError: one is missing, of the wrong type or out of bounds. The text names the parameter.
    """
    missing = [name for name in GROUP_QUANTITIES if given.get(name) is None]
    if missing:
        raise ValueError(f"there is no parameter {missing[0]!r}")
    return {group: _group(group, given, owner()) for group, owner in GROUPS.items()}


def change_settings(settings: Settings, changes: Mapping[str, Any]) -> Settings:
    """Settings with some parameters changed, all of them or none.

    Raises:
        ValueError: as `read_settings`.
    """
    return read_settings({**settings.given, **changes}, None if "scene" in changes else settings.loaded)


def followers(settings: Settings) -> dict[str, Any]:
    """The values of the parameters of groups, by name: a preset changes those that are not given."""
    return {name: value for name, value in settings.values().items() if name in GROUP_QUANTITIES}


def check_changeable(settings: Settings, changes: Mapping[str, Any]) -> None:
    """Raises:
    ValueError: a change of what is fixed while the node runs.
    """
    present = settings.values()
    given = {**settings.given, **changes}
    brought: dict[str, float] = {}
    for group in GROUPS:
        brought |= group_values(group, _base(group, given, settings.loaded))
    for name, declared in GROUP_QUANTITIES.items():
        if not is_geometry(name):
            continue
        value, said = given.get(name), "got"
        if value is None:
            group = name.partition(".")[0]
            value, said = brought[name], f"{group}.preset {given.get(f'{group}.preset', '')!r} brings"
        if value != present[name]:
            raise ValueError(
                f"parameter {name!r} is fixed while the node runs, at {present[name]:.9g}{_unit(declared)}; "
                f"{said} {value!r}: give it at the start, or reset to a scene file that brings it"
            )


def group_values(group: str, owner: Any) -> dict[str, float]:
    """The values of the parameters of a group, and of its parts, by name; 0 for a part that is not there."""
    values = {f"{group}.{field}": getattr(owner, field) for field in quantities(owner)}
    for field, kind in parts(owner).items():
        part = getattr(owner, field)
        values |= {f"{group}.{field}.{one}": getattr(part, one, 0.0) for one in quantities(kind)}
    return values


def is_geometry(name: str) -> bool:
    """Whether a parameter says what fits where."""
    return name == "physics.radius" or name.startswith("table.")


def as_declared(given: Iterable[Parameter]) -> list[Parameter]:
    """The parameters with integers made doubles where a double is declared: users write `update_rate: 50`."""
    doubles = {*NUMBERS, *GROUP_QUANTITIES}
    return [
        Parameter(one.name, value=float(one.value))
        if one.name in doubles and one.type_ == Parameter.Type.INTEGER
        else one
        for one in given
    ]


def changes(given: Iterable[Parameter], shown: Mapping[str, Any]) -> dict[str, Any]:
    """Those of the parameters that this module declares and that change something, by name.

    A value that is shown already is no change, so a dump of all parameters can be loaded at any time. But a scene file
    that is named again is read again: somebody may have edited it. And what comes with a new preset holds against it.
    """
    last = {one.name: one.value for one in given}  # of several values of one the last counts, as for every node
    new = {name.partition(".")[0] for name in GROUP_PRESETS if last.get(name, shown[name]) != shown[name]}
    return {
        name: value
        for name, value in last.items()
        if name in shown
        and (
            value != shown[name]
            or (name == "scene" and value not in BUILT_IN)
            or (name in GROUP_QUANTITIES and name.partition(".")[0] in new)
        )
    }


def find_scene(name: Any) -> Scene:
    """A built-in scene, or one from a file.

    Raises:
        ValueError: not a string, neither built-in nor a file, or a file that does not load.
    """
    if not isinstance(name, str):
        raise ValueError(f"parameter 'scene' must be a string, got {name!r}")
    if name in BUILT_IN:
        return BUILT_IN[name]()
    try:
        if not Path(name).is_file():
            raise ValueError(f"{shown(name)} is neither a file nor one of {', '.join(BUILT_IN)}")
        return load_scene(name, MOST_BALLS)
    except (OSError, UnicodeError, ImportError) as error:
        raise ValueError(f"parameter 'scene': cannot read {shown(name)}: {error}") from None
    except ValueError as error:
        raise ValueError(f"parameter 'scene': {error}") from None


def _base(group: str, given: Mapping[str, Any], start: Scene) -> Any:
    # What the parameters of a group that are not given follow.
    name = f"{group}.preset"
    if given.get(name, "") == "":
        return getattr(start, group)
    return preset(f"parameter {name!r}", given[name], GROUP_PRESETS[name])()


def _group(group: str, given: Mapping[str, Any], base: Any) -> Any:
    # What the parameters that are given make of it.
    values: dict[str, Any] = {
        field: number(f"{group}.{field}", given[f"{group}.{field}"], declared)
        for field, declared in quantities(base).items()
        if f"{group}.{field}" in given
    }
    values |= {field: _part(f"{group}.{field}", given, getattr(base, field)) for field in parts(base)}
    return dataclasses.replace(base, **values)


def _part(name: str, given: Mapping[str, Any], base: Any) -> Any:
    kind = PARTS[name]
    declared = quantities(kind)
    values = {} if base is None else dataclasses.asdict(base)
    values |= {field: given[f"{name}.{field}"] for field in declared if f"{name}.{field}" in given}
    first = next(iter(declared))
    if not values or (first in values and number_or_nan(values[first]) == 0.0):
        return None
    missing = [field for field in declared if field not in values]
    if missing:
        raise ValueError(f"there is no {name}: to make one give it {', '.join(missing)}, too")
    return kind(**{field: number(f"{name}.{field}", values[field], one) for field, one in declared.items()})


def number(name: str, given: Any, declared: Quantity) -> float:
    """A parameter's value as a float; an integer is as good.

    Raises:
        ValueError: not a number, or out of bounds.
    """
    value = number_or_nan(given)
    if not declared.contains(value):
        raise ValueError(f"parameter {name!r} must be a number {declared.bounds()} ({declared.unit}), got {given!r}")
    return value


def number_or_nan(given: Any) -> float:
    """A parameter's value as a float, NaN for what is no number."""
    return float(given) if isinstance(given, (int, float)) and not isinstance(given, bool) else math.nan


def switch(name: str, given: Any) -> bool:
    """A parameter's value as a truth value.

    Raises:
        ValueError: neither true nor false.
    """
    if not isinstance(given, bool):
        raise ValueError(f"parameter {name!r} must be true or false, got {given!r}")
    return given


def frame_name(name: str, given: Any) -> str:
    """A parameter's value as the name of a frame, or the begin of one.

    Raises:
        ValueError: not a string, or one that tf2 does not take.
    """
    if not isinstance(given, str) or given != given.strip() or given.startswith("/") or not given.isprintable():
        raise ValueError(
            f"parameter {name!r} must be a string without space at its ends and without '/' in front, got {given!r}"
        )
    if len(given) > LONGEST_FRAME:
        raise ValueError(f"parameter {name!r} must have at most {LONGEST_FRAME} characters, got {len(given)}")
    if name == "frame_id" and not given:
        raise ValueError(f"parameter {name!r} must not be empty")
    return given


def take_overrides(node: Node) -> dict[str, Any]:
    """The values that the user gave on the command line or in a parameter file, by name.

    The node must have been made with `automatically_declare_parameters_from_overrides`. The parameters of this module
    are undeclared again, so that `declare` can declare them with type, range and help.
    """
    names = [
        "scene",
        *NUMBERS,
        *SWITCHES,
        *TEXTS,
        *(name for name in node.get_parameters_by_prefix("") if name.partition(".")[0] in GROUPS),
    ]
    given = {}
    for name in names:
        if node.has_parameter(name):
            given[name] = node.get_parameter(name).value
            node.undeclare_parameter(name)
    return given


def declare(node: Node, settings: Settings) -> None:
    """Declare every parameter with the value in use."""
    values = settings.values()
    node.declare_parameter(
        "scene",
        values["scene"],
        ParameterDescriptor(description=SCENE_HELP, additional_constraints="takes effect at the next reset"),
        ignore_override=True,
    )
    for name, (_, declared) in NUMBERS.items():
        _declare_number(node, name, values[name], declared)
    for name, (_, text) in SWITCHES.items():
        descriptor = ParameterDescriptor(description=text, additional_constraints=AT_REST)
        node.declare_parameter(name, values[name], descriptor, ignore_override=True)
    for name, (_, text) in TEXTS.items():
        descriptor = ParameterDescriptor(description=text, additional_constraints=AT_REST)
        node.declare_parameter(name, values[name], descriptor, ignore_override=True)
    for name, presets in GROUP_PRESETS.items():
        descriptor = ParameterDescriptor(
            description=PRESET_HELP.format(", ".join(presets)), additional_constraints=AT_REST
        )
        node.declare_parameter(name, values[name], descriptor, ignore_override=True)
    for name, declared in GROUP_QUANTITIES.items():
        _declare_number(node, name, values[name], declared)


def unknown(node: Node) -> list[str]:
    """Parameters that the user gave and that mean nothing to the node, for instance a misspelt one."""
    known = _names()
    return [name for name in node.get_parameters_by_prefix("") if name not in known and not name.startswith(ROS_OWN)]


def help_lines() -> str:
    """The parameters with their defaults, units and bounds, one a line, for `--help`."""
    lines = [f"  scene ({DEFAULT_SCENE}): {SCENE_HELP}"]
    for name, (default, declared) in NUMBERS.items():
        lines.append(f"  {name} ({default:g}{_unit(declared)}, {declared.bounds()}): {declared.help}")
    for name, (on, text) in SWITCHES.items():
        lines.append(f"  {name} ({str(on).lower()}): {text}")
    lines += [f"  {name} ({default!r}): {text}" for name, (default, text) in TEXTS.items()]
    lines += [f"  {name} (''): {PRESET_HELP.format(', '.join(presets))}" for name, presets in GROUP_PRESETS.items()]
    for group, owner in GROUPS.items():
        for name, default in group_values(group, owner()).items():
            declared = GROUP_QUANTITIES[name]
            lines.append(f"  {name} ({default:g}{_unit(declared)}, {bounds(name)}): {declared.help}")
    return "\n".join(lines)


def _names() -> set[str]:
    return {"scene", *NUMBERS, *SWITCHES, *TEXTS, *GROUP_PRESETS, *GROUP_QUANTITIES}


def bounds(name: str) -> str:
    """What the parameter of a group may be, in words."""
    words = GROUP_QUANTITIES[name].bounds()
    return f"{words}, or 0 for none" if name.rpartition(".")[0] in PARTS else words


def _fields(group: str) -> list[str]:
    presets = ["preset"] if f"{group}.preset" in GROUP_PRESETS else []
    return presets + [name.partition(".")[2] for name in GROUP_QUANTITIES if name.startswith(group)]


def _unit(declared: Quantity) -> str:
    return "" if declared.unit == "1" else f" {declared.unit}"


def _declare_number(node: Node, name: str, value: float, declared: Quantity) -> None:
    least = 0.0 if name.rpartition(".")[0] in PARTS else max(declared.minimum, declared.above)
    change = "fixed while the node runs" if is_geometry(name) else AT_REST
    words = bounds(name) if name in GROUP_QUANTITIES else declared.bounds()
    descriptor = ParameterDescriptor(
        description=f"{declared.help},{_unit(declared)}".rstrip(","),
        additional_constraints=f"{words}; {change}",
        floating_point_range=[FloatingPointRange(from_value=least, to_value=declared.maximum, step=0.0)],
    )
    node.declare_parameter(name, value, descriptor, ignore_override=True)
