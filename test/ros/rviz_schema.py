# SPDX-License-Identifier: Apache-2.0
"""What RViz reads from its configuration files, as far as `config/table.rviz` goes, and a check of a file against it.

RViz passes over a name that it does not know, and over a value of an enumeration likewise, without a word. Read from
the sources of rviz 14.1.5 (branch `jazzy` of github.com/ros2/rviz); the files are named beside each class, with
D = rviz_default_plugins/src/rviz_default_plugins, C = rviz_common/src/rviz_common, I = rviz_common/include/rviz_common.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any


def boolean(value: object) -> bool:
    return isinstance(value, bool)


def integer(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def text(value: object) -> bool:
    return isinstance(value, str)


def colour(value: object) -> bool:  # C/properties/parse_color.cpp
    parts = re.fullmatch(r"(\d+); (\d+); (\d+)", value) if isinstance(value, str) else None
    return parts is not None and all(int(part) <= 255 for part in parts.groups())


def one_of(*names: str) -> Callable[[object], bool]:
    return lambda value: value in names


def any_names(value: object) -> bool:
    return isinstance(value, dict) and all(isinstance(one, bool) for one in value.values())


# C/properties/qos_profile_property.cpp; I/ros_topic_display.hpp
TOPIC = {
    "Value": text,
    "Depth": lambda value: integer(value) and value >= 1,
    "History Policy": one_of("System Default", "Keep Last", "Keep All"),
    "Reliability Policy": one_of("System Default", "Reliable", "Best Effort"),
    "Durability Policy": one_of("System Default", "Transient Local", "Volatile"),
}

# I/message_filter_display.hpp
FILTERED_TOPIC = {**TOPIC, "Filter size": lambda value: integer(value) and value >= 1}

# C/display.cpp, C/display_group.cpp, C/properties/property.cpp
DISPLAY = {"Class": text, "Name": text, "Enabled": boolean, "Value": boolean}

DISPLAYS = {
    # D/displays/marker_array/marker_array_display.cpp, D/displays/marker/marker_common.cpp
    "rviz_default_plugins/MarkerArray": {**DISPLAY, "Topic": TOPIC, "Namespaces": any_names},
    # D/displays/pose_array/pose_array_display.cpp
    "rviz_default_plugins/PoseArray": {
        **DISPLAY,
        "Topic": FILTERED_TOPIC,
        "Shape": one_of("Arrow (Flat)", "Arrow (3D)", "Axes"),
        "Color": colour,
        "Alpha": number,
        "Arrow Length": number,
        "Head Radius": number,
        "Head Length": number,
        "Shaft Radius": number,
        "Shaft Length": number,
        "Axes Length": number,
        "Axes Radius": number,
    },
    # D/displays/grid/grid_display.cpp
    "rviz_default_plugins/Grid": {
        **DISPLAY,
        "Reference Frame": text,
        "Plane Cell Count": integer,
        "Normal Cell Count": integer,
        "Cell Size": number,
        "Line Style": {"Value": one_of("Lines", "Billboards"), "Line Width": number},
        "Color": colour,
        "Alpha": number,
        "Plane": one_of("XY", "XZ", "YZ"),
        "Offset": {"X": number, "Y": number, "Z": number},
    },
}

# C/tool.cpp; names: rviz_default_plugins/plugins_description.xml
TOOLS = {
    # D/tools/interaction/interaction_tool.cpp
    "rviz_default_plugins/Interact": {"Class": text, "Hide Inactive Objects": boolean},
    # D/tools/move/move_tool.cpp, D/tools/select/selection_tool.cpp, D/tools/focus/focus_tool.cpp
    "rviz_default_plugins/MoveCamera": {"Class": text},
    "rviz_default_plugins/Select": {"Class": text},
    "rviz_default_plugins/FocusCamera": {"Class": text},
    # D/tools/measure/measure_tool.cpp
    "rviz_default_plugins/Measure": {"Class": text, "Line color": colour},
}

VIEWS = {
    # C/view_controller.cpp, C/frame_position_tracking_view_controller.cpp,
    # D/view_controllers/ortho/fixed_orientation_ortho_view_controller.cpp
    "rviz_default_plugins/TopDownOrtho": {
        "Class": text,
        "Name": text,
        "Value": one_of("TopDownOrtho (rviz_default_plugins)"),
        "Near Clip Distance": number,
        "Enable Stereo Rendering": {
            "Value": boolean,
            "Stereo Eye Separation": number,
            "Stereo Focal Distance": number,
            "Swap Stereo Eyes": boolean,
        },
        "Invert Z Axis": boolean,
        "Target Frame": text,
        "Scale": number,
        "Angle": number,
        "X": number,
        "Y": number,
    },
}

# C/properties/property_tree_widget.cpp
TREE = {"Expanded": lambda value: isinstance(value, list), "Splitter Ratio": number}

# C/panel.cpp; names: C/panel_factory.cpp
PANEL = {"Class": text, "Name": text}

PANELS = {
    # C/displays_panel.cpp, C/properties/property_tree_with_help.cpp
    "rviz_common/Displays": {**PANEL, "Property Tree Widget": TREE, "Tree Height": integer, "Help Height": integer},
    # C/views_panel.cpp
    "rviz_common/Views": {**PANEL, **TREE},
    # C/time_panel.cpp
    "rviz_common/Time": {
        **PANEL,
        "SyncMode": lambda value: value in (0, 1, 2),
        "SyncSource": text,
        "Experimental": boolean,
    },
}


class Each:
    """A list of things of these classes."""

    def __init__(self, classes: Mapping[str, Mapping[str, Any]]) -> None:
        self.classes = classes


class Of:
    """A thing of one of these classes."""

    def __init__(self, classes: Mapping[str, Mapping[str, Any]]) -> None:
        self.classes = classes


# C/visualization_frame.cpp, C/visualization_manager.cpp, C/view_manager.cpp, C/tool_manager.cpp
FILE = {
    "Panels": Each(PANELS),
    "Visualization Manager": {
        **DISPLAY,
        "Global Options": {"Fixed Frame": text, "Background Color": colour, "Frame Rate": integer},
        "Displays": Each(DISPLAYS),
        "Tools": Each(TOOLS),
        "Views": {"Current": Of(VIEWS), "Saved": lambda value: value is None},
    },
    "Window Geometry": {
        "X": integer,
        "Y": integer,
        "Width": integer,
        "Height": integer,
        "QMainWindow State": text,
        "Hide Left Dock": boolean,
        "Hide Right Dock": boolean,
    },
}

TOGETHER = [{"X", "Y"}, {"Width", "Height"}, {"Tree Height", "Help Height"}]
"""Read only if the other is there: C/visualization_frame.cpp, C/properties/property_tree_with_help.cpp."""

NEEDED = {"Hide Left Dock", "Hide Right Dock"}
"""Of the window, which is random without them: C/visualization_frame.cpp."""


def mistakes(settings: Mapping[str, Any]) -> list[str]:
    """What RViz would not understand in a file."""
    found = [*_mistakes(settings, FILE, "")]
    found += [f"/Window Geometry: needs {name}" for name in sorted(NEEDED - set(settings["Window Geometry"]))]
    return found


def _mistakes(value: Any, schema: Any, path: str) -> Iterator[str]:
    if isinstance(schema, Each):
        for index, one in enumerate(value):
            yield from _mistakes(one, Of(schema.classes), f"{path}/{index}")
    elif isinstance(schema, Of):
        name = value.get("Class")
        if name in schema.classes:
            yield from _mistakes(value, schema.classes[name], path)
        else:
            yield f"{path}: no class {name!r}"
    elif isinstance(schema, Mapping):
        if not isinstance(value, Mapping):
            if "Value" in schema:
                yield from _mistakes(value, schema["Value"], path)
            else:
                yield f"{path}: {value!r} has no parts"
            return
        for name, one in value.items():
            if name in schema:
                yield from _mistakes(one, schema[name], f"{path}/{name}")
            else:
                yield f"{path}: no property {name!r}"
        for group in TOGETHER:
            if group & set(value) and not group <= set(value):
                yield f"{path}: only together: {', '.join(sorted(group))}"
    elif not schema(value):
        yield f"{path}: {value!r}"
