"""A LIDAR that turns in the plane: which of its rays meet which wall, obstacle or robot, and how far away."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.checks import between, count, positive
from mp2a.se2 import act_inverse
from mp2a.simulator.world import rectangles
from mp2a.spatial import Array

Indices = NDArray[np.intp]

_MOST_RAYS = 100_000
_BLOCK = 4096  # segments at a time: what they need stays in the cache


class Lidar(NamedTuple):
    """What the sensor in the middle of each robot is; the defaults are the thesis', where it says."""

    rays: int = 256
    """All around, evenly; the first points forward (7.1: 256 in its simulator, 1024 on the robot)."""
    period: float = 0.1
    """s from scan to scan (chapter 2: 10 Hz)."""
    delay: float = 0.3
    """s from a scan to when the robot has it (chapter 2: "approximately 300 ms")."""
    nearest: float = 0.3
    """m: what is nearer is not seen, and hides what is behind it (chapter 2)."""
    farthest: float = 20.0
    """m: what is farther is not seen."""
    noise: float = 0.0
    """m: standard deviation of a range."""

    def check(self) -> None:
        """Raise InputError unless all fields make sense."""
        between("lidar.rays", count("lidar.rays", self.rays), 1, _MOST_RAYS, "a scan")
        between("lidar.period", self.period, 1e-3, 1e3, "s")
        between("lidar.delay", self.delay, 0, 60, "s")
        positive("lidar.farthest", self.farthest)
        for name in ("nearest", "noise"):
            positive(f"lidar.{name}", getattr(self, name), or_zero=True)

    @property
    def directions(self) -> Array:
        """``(rays, 2)`` unit vectors in the robot's frame."""
        angles = 2 * np.pi * np.arange(self.rays) / self.rays
        return np.stack((np.cos(angles), np.sin(angles)), axis=-1)


def ranges(lidar: Lidar, poses: Array, lengths: Array, widths: Array, segments: Array) -> Array:
    """Measure what the rays of all robots meet, without noise.

    A ray is tested only against the segments within whose angle it lies, as seen from the robot.

    Parameters
    ----------
    lidar
        The sensor.
    poses
        ``(n, 3)`` m, m, rad in the ground frame.
    lengths, widths
        ``(n,)`` m of the robots, which see one another but not themselves.
    segments
        ``(m, 2, 2)`` m, ends of the world's segments in the ground frame.

    Returns
    -------
    ndarray
        ``(n, rays)`` m; inf where a ray meets nothing within `farthest`.
    """
    n = len(poses)
    found = np.full((n, lidar.rays), np.inf)
    directions = lidar.directions
    for seers, ends in (_of_world(lidar, poses, segments), _of_robots(lidar, poses, lengths, widths)):
        for k in range(0, len(seers), _BLOCK):
            here = seers[k : k + _BLOCK]
            local = act_inverse(poses[here, None], ends[k : k + _BLOCK])
            pairs, rays = _candidates(lidar, local)
            far = _meet(directions[rays], local, pairs)
            np.minimum.at(found.reshape(-1), here[pairs] * lidar.rays + rays, far)
    found[found > lidar.farthest] = np.inf
    return found


def scan_points(lidar: Lidar, measured: Array) -> list[Array]:
    """Turn ranges ``(n, rays)`` into points ``(k, 2)`` m in each robot's own frame; rays that see nothing have none."""
    seen = (measured >= lidar.nearest) & np.isfinite(measured)
    where = np.nonzero(seen)
    return np.split(measured[where][:, None] * lidar.directions[where[1]], np.cumsum(seen.sum(axis=1))[:-1])


def _of_world(lidar: Lidar, poses: Array, segments: Array) -> tuple[Indices, Array]:
    """Pair robots and the segments that come near enough to them: ``(p,)`` and ``(p, 2, 2)``."""
    start, along = segments[:, 0], segments[:, 1] - segments[:, 0]
    offset = poses[:, None, :2] - start
    share = np.clip(np.einsum("nmk,mk->nm", offset, along) / np.einsum("mk,mk->m", along, along), 0, 1)
    gap = np.linalg.norm(offset - share[..., None] * along, axis=-1)
    seers, which = np.nonzero(gap <= lidar.farthest)
    return seers, segments[which]


def _of_robots(lidar: Lidar, poses: Array, lengths: Array, widths: Array) -> tuple[Indices, Array]:
    """Pair robots and the sides of others that face them and come near enough: ``(p,)`` and ``(p, 2, 2)``."""
    reach = lidar.farthest + np.hypot(lengths, widths) / 2
    near = (poses[:, None, 0] - poses[:, 0]) ** 2 + (poses[:, None, 1] - poses[:, 1]) ** 2 <= reach**2
    np.fill_diagonal(near, False)
    seers, others = np.nonzero(near)
    # Where the robot is, as seen from the other's middle, tells which sides of the other's rectangle face it.
    x, y = act_inverse(poses[others], poses[seers, :2]).T
    half_x, half_y = lengths[others] / 2, widths[others] / 2
    pairs, side = np.nonzero(np.stack((y > half_y, x < -half_x, y < -half_y, x > half_x), axis=-1))
    corners = rectangles(poses, lengths, widths)
    seen = others[pairs]
    return seers[pairs], np.stack((corners[seen, side], corners[seen, (side + 1) % 4]), axis=1)


def _candidates(lidar: Lidar, local: Array) -> tuple[Indices, Indices]:
    """Find which rays may meet which segments, from the angle between a segment's ends."""
    step = 2 * np.pi / lidar.rays
    angles = np.arctan2(local[..., 1], local[..., 0])
    turn = angles[:, 1] - angles[:, 0]
    turn -= 2 * np.pi * np.round(turn / (2 * np.pi))
    start = np.where(turn >= 0, angles[:, 0], angles[:, 1])
    first = np.floor(start / step - 1e-6).astype(np.intp)
    many = np.minimum(np.floor((start + np.abs(turn)) / step + 1e-6).astype(np.intp) - first + 1, lidar.rays)
    pairs = np.repeat(np.arange(len(local)), many)
    place = np.arange(len(pairs)) - np.repeat(np.cumsum(many) - many, many)
    return pairs, (np.repeat(first, many) + place) % lidar.rays


def _meet(directions: Array, local: Array, pairs: Indices) -> Array:
    """Distance along each ray ``(p, 2)`` at which it meets its segment, inf if it does not.

    Whether it does is told by the sides of the ray on which the ends lie. Two segments that share an end get the same
    answer about it, so that no ray slips through a corner. ``local[pairs]`` are the ends ``(p, 2, 2)``; they are taken
    apart into columns first, which is several times faster.
    """
    cosine, sine = directions.T.copy()
    ends = np.ascontiguousarray(local.reshape(-1, 4).T)
    twice_area = ends[0] * ends[3] - ends[1] * ends[2]
    ax, ay, bx, by = (column[pairs] for column in ends)
    side_a = cosine * ay - sine * ax
    side_b = cosine * by - sine * bx
    between = side_b - side_a
    crossed = (side_a * side_b <= 0) & (between != 0)
    far = np.full(len(pairs), np.inf)
    np.divide(twice_area[pairs], between, out=far, where=crossed)
    far[far < 0] = np.inf
    return far
