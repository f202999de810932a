"""HUSKY and TRADR: from setpoints to velocity commands that a robot obeys.

`interface` says what a robot takes and gives; `dry`, `simulated`, `ros1`, `ros2` and `records.recorded` have such
robots, and `adapters` is the table of them. `driver` runs one through a choreography, `fleet` makes all of a process
ready: `limits` and `slip` shape commands, `sender` and `watchdog` send them from a process of their own, `start` lets
all begin at the same time. `steps` is what is known of a tick; `records` writes it from a process of its own, and plays
it back. `table` holds topics, frames, rates and limits a robot.
"""
