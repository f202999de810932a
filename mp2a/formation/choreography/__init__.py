"""The choreography of the thesis, chapters 4-6: scenario language, virtual leader, robot controller, safety.

``scenario`` is what a text means, ``reading`` reads it (the only part that needs a parser), ``program`` lays it out
robot by robot, ``leader`` and ``follower`` are the controllers on arrays, ``obstacles`` is what LIDAR points do,
``runner`` puts them together, ``motion`` hands the formation to the scan, ``check`` finds what would go wrong.
"""
