"""Robots over ROS 2, by the wire that it goes over (DDS); no ROS installation is needed."""
