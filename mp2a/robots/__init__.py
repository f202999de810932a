"""HUSKY and TRADR: from setpoints to velocity commands that a robot obeys.

`interface` says what a robot takes and gives; `dry`, `simulated`, `ros1` and `ros2` are such robots. `drive` runs one
through a choreography: `limits` and `slip` shape its commands, `sender` and `watchdog` send them from a process of
their own, `start` lets all begin at the same time. `table` holds topics, frames, rates and limits a robot.
"""
