"""Robots over ROS 1, by rospy."""
