# SPDX-License-Identifier: Apache-2.0
"""The exact, event-driven engine: no ROS, no plotting."""
