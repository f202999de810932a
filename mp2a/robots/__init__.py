"""HUSKY and TRADR: from setpoints to velocity commands that a robot obeys.

`interface` says what a robot takes and gives; `simulated`, `ros_robot` and `records.recorded` have such robots, and
`adapters` is the table of them. `drive_setup` makes all robots of a process ready, `driver` runs them through a
choreography: `limits` and `slip` shape commands, `sender` and `watchdog` send them from a process of their own, `start`
and `terms` let all begin the same at the same time. `ticks` is what is known of a tick; `records` writes it from a
process of its own, and plays it back. `ros_backend` is what ROS 1 and ROS 2 have in common, `topic_state` what their
topics amount to. `robot_config` holds topics, frames, rates and limits of each robot.
"""
