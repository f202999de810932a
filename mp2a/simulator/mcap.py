"""Recordings as MCAP files, which Foxglove opens: its own message types, written by its own library."""

import io
import json
from typing import Any

import numpy as np

from mp2a.dependencies import need
from mp2a.simulator.events import GOOD_NEWS
from mp2a.simulator.recording import Recording
from mp2a.spatial import Array

GROUND = "ground"
"""Name of the ground frame; robot i has the frame ``robot_i``, counted from 1."""

_HEIGHT = 0.4  # m, of robots and obstacles: pictures want one, the simulation has none
_MOTION = ("speed", "turn_rate", "commanded_speed", "commanded_turn_rate", "leader_distance", "wanted_distance")
_SCHEMA = {"type": "object", "title": "Motion", "properties": {name: {"type": "number"} for name in _MOTION}}


def to_mcap(recording: Recording) -> bytes:
    """Return the content of an MCAP file of a recording; times begin at 0.

    It is made in memory, for foxglove-sdk does not say when a disk is full.

    Raises
    ------
    DependencyError
        If foxglove-sdk is not installed.
    """
    needed: dict[str, Any] = {"extra": "record", "package": "foxglove-sdk", "purpose": "an MCAP file"}
    foxglove, channels = (need(module, **needed) for module in ("foxglove", "foxglove.channels"))
    messages = need("foxglove.messages", **needed)
    context = foxglove.Context()
    n, gaps = len(recording.models), recording.gaps
    frames = [f"robot_{i + 1}" for i in range(n)]
    world = channels.SceneUpdateChannel("/world", context=context)
    robots = channels.SceneUpdateChannel("/robots", context=context)
    transforms = channels.FrameTransformsChannel("/tf", context=context)
    events = channels.LogChannel("/events", context=context)
    scans = [channels.PointCloudChannel(f"/{frame}/points", context=context) for frame in frames]
    motions = [
        foxglove.Channel(f"/{frame}/motion", message_encoding="json", schema=_SCHEMA, context=context)
        for frame in frames
    ]
    file = io.BytesIO()
    with foxglove.open_mcap(file, context=context):
        first = _ns(recording.times[0])
        world.log(_world(messages, recording), log_time=first)
        robots.log(_robots(messages, recording, frames), log_time=first)
        for k, time in enumerate(recording.times):
            now = _ns(time)
            transforms.log(_transforms(messages, recording.poses[k], frames, now), log_time=now)
            for i in range(n):
                led = (gaps[k, i], recording.leaders[k, i, 2])
                figures = np.concatenate((recording.twists[k, i], recording.commands[k, i], led)).tolist()
                told = {name: x for name, x in zip(_MOTION, figures, strict=True) if x == x}  # noqa: PLR0124 (nan)
                motions[i].log(json.dumps(told).encode(), log_time=now)
                if recording.counts[k, i]:
                    cloud = _cloud(messages, recording.new_points(k, i), frames[i], _ns(recording.stamps[k, i]))
                    scans[i].log(cloud, log_time=now)
        for event in recording.events:
            now = _ns(event.time)
            level = messages.LogLevel.Info if event.kind in GOOD_NEWS else messages.LogLevel.Warning
            stamp, name, text = _stamp(messages, now), frames[event.robot], event.text(recording.roles)
            events.log(messages.Log(timestamp=stamp, level=level, message=text, name=name), log_time=now)
    return file.getvalue()


def _ns(time: float) -> int:
    return max(0, round(1e9 * float(time)))  # robots stood still before 0, so what they saw then they see at 0


def _stamp(messages: Any, now: int) -> Any:
    return messages.Timestamp(sec=now // 10**9, nsec=now % 10**9)


def _at(messages: Any, z: float, x: float = 0.0) -> Any:
    """Pose in a frame, not turned."""
    return messages.Pose(position=messages.Vector3(x=x, z=z), orientation=messages.Quaternion(w=1.0))


def _transforms(messages: Any, poses: Array, frames: list[str], now: int) -> Any:
    return messages.FrameTransforms(
        transforms=[
            messages.FrameTransform(
                timestamp=_stamp(messages, now),
                parent_frame_id=GROUND,
                child_frame_id=frame,
                translation=messages.Vector3(x=x, y=y),
                rotation=messages.Quaternion(z=float(np.sin(heading / 2)), w=float(np.cos(heading / 2))),
            )
            for frame, (x, y, heading) in zip(frames, poses.tolist(), strict=True)
        ]
    )


def _cloud(messages: Any, points: Any, frame: str, stamp: int) -> Any:
    flat = np.zeros((len(points), 3), dtype="<f4")
    flat[:, :2] = points
    kind = messages.PackedElementFieldNumericType.Float32
    return messages.PointCloud(
        timestamp=_stamp(messages, stamp),
        frame_id=frame,
        pose=_at(messages, _HEIGHT),  # seen from above, a wall would hide what lies on the ground
        point_stride=12,
        fields=[messages.PackedElementField(name=name, offset=4 * k, type=kind) for k, name in enumerate("xyz")],
        data=flat.tobytes(),
    )


def _world(messages: Any, recording: Recording) -> Any:
    color = messages.Color(r=0.25, g=0.25, b=0.25, a=1.0)
    faint = messages.Color(r=0.25, g=0.25, b=0.25, a=0.4)
    outlines = (
        ("world", recording.world.lines, _HEIGHT / 2, color),
        ("leader paths", recording.leader_paths, 0.0, faint),
    )
    entities = []
    for name, lines, height, shade in outlines:
        strips = [
            messages.LinePrimitive(
                type=messages.LinePrimitiveLineType.LineStrip,
                thickness=0.05,
                points=[messages.Point3(x=x, y=y, z=height) for x, y in line.tolist()],
                color=shade,
            )
            for line in lines
        ]
        stamp = _stamp(messages, 0)
        entities.append(messages.SceneEntity(timestamp=stamp, frame_id=GROUND, id=name, lines=strips))
    return messages.SceneUpdate(entities=entities)


def _robots(messages: Any, recording: Recording, frames: list[str]) -> Any:
    entities = []
    for i, (model, frame) in enumerate(zip(recording.models, frames, strict=True)):
        body = messages.CubePrimitive(
            pose=_at(messages, _HEIGHT / 2),
            size=messages.Vector3(x=model.length, y=model.width, z=_HEIGHT),
            color=messages.Color(r=0.9, g=0.6, b=0.1, a=0.9),
        )
        front = messages.ArrowPrimitive(
            pose=_at(messages, _HEIGHT, model.length / 4),
            shaft_length=model.length / 8,
            shaft_diameter=0.05,
            head_length=model.length / 8,
            head_diameter=0.15,
            color=messages.Color(r=0.25, g=0.25, b=0.25, a=1.0),
        )
        label = messages.TextPrimitive(
            pose=_at(messages, 1.5 * _HEIGHT),
            billboard=True,
            font_size=0.3,
            color=messages.Color(a=1.0),
            text=recording.roles[i],
        )
        robot = messages.SceneEntity(
            timestamp=_stamp(messages, 0), frame_id=frame, id=frame, frame_locked=True, cubes=[body], arrows=[front],
            texts=[label],
        )  # fmt: skip
        entities.append(robot)
    return messages.SceneUpdate(entities=entities)
