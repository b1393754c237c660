# SPDX-License-Identifier: Apache-2.0
"""The node `table`, and RViz where asked; `ros2 launch billiards_sim table.launch.py --show-args` lists arguments."""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

PACKAGE = "billiards_sim"
CONFIG = PathJoinSubstitution([FindPackageShare(PACKAGE), "config"])


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "scene", default_value="", description="built-in scene or scene file; empty: what params_file says"
            ),
            DeclareLaunchArgument(
                "params_file",
                default_value=PathJoinSubstitution([CONFIG, "table.yaml"]),
                description="parameters of the table; config/ has some",
            ),
            DeclareLaunchArgument("namespace", default_value="", description="of the table, its topics, and RViz"),
            DeclareLaunchArgument(
                "rviz", default_value="false", choices=["true", "false"], description="whether to show the table"
            ),
            DeclareLaunchArgument(
                "use_sim_time", default_value="false", choices=["true", "false"], description="follow /clock"
            ),
            # Before the table: where rviz2 is not installed, launch ends here, and would leave a table running.
            Node(
                package="rviz2",
                executable="rviz2",
                namespace=LaunchConfiguration("namespace"),
                arguments=["-d", PathJoinSubstitution([CONFIG, "table.rviz"])],
                parameters=[sim_time()],
                condition=IfCondition(LaunchConfiguration("rviz")),
            ),
            OpaqueFunction(function=table),
        ]
    )


def table(context: LaunchContext) -> list[Node]:
    """The node; a scene that is not given must not hide that of the parameter file."""
    scene = LaunchConfiguration("scene").perform(context)
    given = {"scene": ParameterValue(scene, value_type=str)} if scene else {}
    return [
        Node(
            package=PACKAGE,
            executable="table",
            namespace=LaunchConfiguration("namespace"),
            parameters=[LaunchConfiguration("params_file"), given | sim_time()],
            output="screen",
        )
    ]


def sim_time() -> dict[str, ParameterValue]:
    return {"use_sim_time": ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool)}
