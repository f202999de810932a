"""The choreography of the thesis, chapters 4-6: scenario language, virtual leader, robot controller.

``scenario`` is what a text means, ``reading`` reads it (the only part that needs a parser), ``program`` lays it out
robot by robot, ``leader`` and ``follower`` are the controllers on arrays, ``force_field`` is what LIDAR points do,
``runner`` puts them together, ``leader_broadcast`` takes the leaders' motion through the chain, ``rules`` finds what is
wrong on paper; `mp2a.simulator.check` runs a scenario as well.
"""
