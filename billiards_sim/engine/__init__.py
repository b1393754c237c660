"""The exact, event-driven engine: no ROS, no plotting."""
