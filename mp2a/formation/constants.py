"""Every constant that more than one part of the formation uses, and all of the choreography, with where it is from.

Sections and equations are the thesis'; "ours" is what it gives no number for.
"""

import math

TICK = 0.1
"""s between two points of a leader's path, and between two commands (section 4.3: 10 Hz; chapter 2)."""
LONGEST_RUN = 3600.0
"""s of a scenario that are run at most, unless told otherwise; ours."""

# ---- virtual leader --------------------------------------------------------------------------------------------
LEADER_LEAD = 0.5
"""m from the first row to the virtual leader in front of it (chapter 6, newVL)."""
LEADER_SPEED_SHARE = 0.7
"""Of the slowest robot's speed (section 4.1, eq. 4.1a)."""
LEADER_SPEED_GAIN = 1.5
"""1/s (eq. 4.1a)."""
LEADER_LEAST_SPEED = 0.1
"""m/s, for it never turns on the spot (eq. 4.1a)."""
LEADER_TURN_GAIN = 2.0
"""1/s (eq. 4.1b)."""
LEADER_MOST_TURN = math.pi / 2
"""rad/s (section 4.2)."""
ARC_GAIN = 5.0
"""1/m (eq. 4.3b)."""
WAYPOINT_TOLERANCE = 0.3
"""m; the thesis has a tolerance (section 4.2) and gives 0.3 m for the robots' targets alone (section 7.2.2)."""
NEW_LEADER_PAUSE = 1.0
"""s for which robots stand before a new leader starts; ours, enough for every robot to brake."""

# ---- robot -----------------------------------------------------------------------------------------------------
GAP_GAIN = 3.0
"""1/m (eq. 4.4a)."""
STEER_GAIN = 3.0
"""1/s (eq. 4.4b)."""
TARGET_TOLERANCE = 0.3
"""m at which a point of the queue counts as reached (sections 4.3, 7.2.2)."""
TARGET_AHEAD = 20
"""Points of the queue, 2 s of the leader's path, among which a reached one takes those before it along; ours."""
QUEUE_RESET_RATIO = 2.0
"""Times the distance wanted at which the queue is cleared (section 4.3)."""
CLOSING_SPEED = 0.2
"""m/s by which a follower in a line that is too far behind is faster than its predecessor; ours."""

# ---- team mates ------------------------------------------------------------------------------------------------
MOST_TEAMMATES = 8
"""Team mates that are looked for among a robot's points: the nearest ones; ours."""

# ---- obstacles -------------------------------------------------------------------------------------------------
FORCE_GAIN = 2.0
"""1/s (eq. 4.4b)."""
WINDOW = 4.0
"""m, side of the square around the robot whose points count (section 5.2)."""
CELL = 0.1
"""m, side of the cells that points are sorted into, so that a denser scan pushes no harder; ours."""
CELL_FORCE = 0.06
"""m²: an occupied cell straight ahead at distance d pushes with CELL_FORCE / d². Ours, for what section 5.2 asks of it:
noticeable from 1 to 1.5 m away (half a metre of wall, 1 m ahead, outweighs a target 30° aside)."""
LOWEST, HIGHEST = 0.1, 1.5
"""m above the ground between which a point of a 3-D cloud counts (section 5.2)."""
STOP_DISTANCE = 0.55
"""m from the robot's front or rear (section 5.2)."""
STOP_SIDE = 0.05
"""m beside the body that also counts as in the way; ours."""
TURN_AHEAD = 0.5
"""rad: no turn whose first half radian brings the body, with TURN_SIDE around it, against a point; ours."""
TURN_SIDE = 0.1
"""m around the body that a turn keeps free; ours."""

# ---- failures --------------------------------------------------------------------------------------------------
SILENCE = 0.3
"""s: a robot without LIDAR data for longer is in its error state (section 5.1)."""
LOST_POSES = 3
"""Look-ups of the pose that fail in a row until then (section 5.1)."""
