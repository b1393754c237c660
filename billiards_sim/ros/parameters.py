"""The node's parameters: declared from the quantities of `Physics` and `Table`, checked once, then fixed.

A `physics.*` or `table.*` parameter that is not given takes the value of the scene; one that is given replaces it.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.node import Node

from billiards_sim.engine.physics import Physics
from billiards_sim.engine.quantity import Quantity, quantities
from billiards_sim.engine.scene import Scene, load_scene
from billiards_sim.engine.scenes import BUILT_IN
from billiards_sim.engine.table import Table

GROUPS = {"physics": Physics, "table": Table}
"""Groups of parameters, each the fields of one class."""

DEFAULT_SCENE = "eight_ball"

SCENE_HELP = f"what is on the table: {', '.join(BUILT_IN)}, or the path of a scene file"

RATES = {
    "update_rate": (100.0, Quantity("Hz", "steps, and messages on balls/poses, a second", minimum=0.1, maximum=1000.0)),
    "real_time_factor": (
        1.0,
        Quantity("1", "simulated seconds in a second of the wall clock", minimum=0.001, maximum=1000.0),
    ),
    "marker_rate": (30.0, Quantity("Hz", "messages on markers a second, 0 for none", minimum=0.0, maximum=1000.0)),
}
"""Default and quantity of each rate."""


ROS_OWN = ("use_sim_time", "start_type_description_service", "qos_overrides.")
"""What parameters that every node has start with."""


@dataclass(frozen=True)
class Settings:
    """Everything the node is told: the scene with all overrides applied, and the rates."""

    scene: Scene
    scene_name: str
    update_rate: float
    real_time_factor: float
    marker_rate: float


def read_settings(given: Mapping[str, Any]) -> Settings:
    """Settings from the parameters that the user gave, by name; all others take their defaults.

    Raises:
        ValueError: a value of the wrong type or out of bounds, an unknown scene, an unknown `physics.*` or `table.*`
            name, a scene that does not fit the table. The text is one line and names the parameter.
    """
    for name in given:
        group, dot, _ = name.partition(".")
        if dot and group in GROUPS and name not in dict(_group_quantities()):
            known = ", ".join(quantities(GROUPS[group]))
            raise ValueError(f"no parameter {name!r}; under {group!r} there are {known}")
    rates = {name: number(name, given.get(name, default), declared) for name, (default, declared) in RATES.items()}
    scene_name = given.get("scene", DEFAULT_SCENE)
    scene = find_scene(scene_name)
    changes = {}
    for group in GROUPS:
        values = {
            field: number(f"{group}.{field}", given[f"{group}.{field}"], declared)
            for field, declared in quantities(GROUPS[group]).items()
            if f"{group}.{field}" in given
        }
        changes[group] = dataclasses.replace(getattr(scene, group), **values)
    try:
        scene = dataclasses.replace(scene, **changes)
    except ValueError as error:
        raise ValueError(f"scene {scene_name!r} does not fit these physics and table parameters: {error}") from None
    return Settings(scene, scene_name, **rates)


def find_scene(name: Any) -> Scene:
    """A built-in scene, or one from a file.

    Raises:
        ValueError: not a string, neither built-in nor a file, or a file that does not load.
    """
    if not isinstance(name, str):
        raise ValueError(f"parameter 'scene' must be a string, got {name!r}")
    if name in BUILT_IN:
        return BUILT_IN[name]()
    if not Path(name).is_file():
        raise ValueError(f"parameter 'scene': {name!r} is neither a file nor one of {', '.join(BUILT_IN)}")
    try:
        return load_scene(name)
    except (OSError, UnicodeError, ImportError) as error:
        raise ValueError(f"parameter 'scene': cannot read {name!r}: {error}") from None
    except ValueError as error:
        raise ValueError(f"parameter 'scene': {error}") from None


def number(name: str, given: Any, declared: Quantity) -> float:
    """A parameter's value as a float; an integer is as good.

    Raises:
        ValueError: not a number, or out of bounds.
    """
    value = float(given) if isinstance(given, (int, float)) and not isinstance(given, bool) else math.nan
    if not declared.contains(value):
        raise ValueError(f"parameter {name!r} must be a number {declared.bounds()} ({declared.unit}), got {given!r}")
    return value


def take_overrides(node: Node) -> dict[str, Any]:
    """The values that the user gave on the command line or in a parameter file, by name.

    The node must have been made with `automatically_declare_parameters_from_overrides`. The parameters of this module
    are undeclared again, so that `declare` can declare them with type, range and help.
    """
    names = ["scene", *RATES, *(name for name in node.get_parameters_by_prefix("") if name.partition(".")[0] in GROUPS)]
    given = {}
    for name in names:
        if node.has_parameter(name):
            given[name] = node.get_parameter(name).value
            node.undeclare_parameter(name)
    return given


def declare(node: Node, settings: Settings) -> None:
    """Declare every parameter, read-only, with the value in use."""
    node.declare_parameter(
        "scene",
        settings.scene_name,
        ParameterDescriptor(description=SCENE_HELP, read_only=True),
        ignore_override=True,
    )
    for name, (_, declared) in RATES.items():
        _declare_number(node, name, getattr(settings, name), declared)
    for name, declared in _group_quantities():
        group, _, field = name.partition(".")
        _declare_number(node, name, getattr(getattr(settings.scene, group), field), declared)


def unknown(node: Node) -> list[str]:
    """Parameters that the user gave and that mean nothing to the node, for instance a misspelt one."""
    known = {"scene", *RATES, *dict(_group_quantities())}
    return [name for name in node.get_parameters_by_prefix("") if name not in known and not name.startswith(ROS_OWN)]


def help_lines() -> str:
    """The parameters with their defaults, units and bounds, one a line, for `--help`."""
    lines = [f"  scene ({DEFAULT_SCENE}): {SCENE_HELP}"]
    for name, (default, declared) in RATES.items():
        lines.append(f"  {name} ({default:g}{_unit(declared)}, {declared.bounds()}): {declared.help}")
    for name, declared in _group_quantities():
        group, _, field = name.partition(".")
        default = getattr(GROUPS[group](), field)
        lines.append(f"  {name} ({default:g}{_unit(declared)}, {declared.bounds()}): {declared.help}")
    return "\n".join(lines)


def _group_quantities() -> Iterator[tuple[str, Quantity]]:
    for group, owner in GROUPS.items():
        for field, declared in quantities(owner).items():
            yield f"{group}.{field}", declared


def _unit(declared: Quantity) -> str:
    return "" if declared.unit == "1" else f" {declared.unit}"


def _declare_number(node: Node, name: str, value: float, declared: Quantity) -> None:
    bounds = FloatingPointRange(from_value=max(declared.minimum, declared.above), to_value=declared.maximum, step=0.0)
    descriptor = ParameterDescriptor(
        description=f"{declared.help},{_unit(declared)}".rstrip(","),
        additional_constraints=declared.bounds(),
        floating_point_range=[bounds],
        read_only=True,
    )
    node.declare_parameter(name, value, descriptor, ignore_override=True)
