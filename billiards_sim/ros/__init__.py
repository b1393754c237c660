# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 node, and in `tools` its clients: the only place that imports rclpy."""
