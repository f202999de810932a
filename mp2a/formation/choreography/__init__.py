"""The choreography of the thesis, chapters 4-6: scenario language, virtual leader, robot controller, check.

``scenario`` is what a text means, ``reading`` reads it (the only part that needs a parser), ``program`` lays it out
robot by robot, ``leader`` and ``follower`` are the controllers on arrays, ``force_field`` is what LIDAR points do,
``runner`` puts them together, ``leader_broadcast`` takes the leaders' motion through the chain, ``check`` finds what
would go wrong.
"""
