"""The ROS 2 node and its clients: the only place that imports rclpy."""
