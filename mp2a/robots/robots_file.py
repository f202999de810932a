"""Robots files: TOML that says which robot plays which role, and what is different about it."""

import dataclasses
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from mp2a.exceptions import InputError
from mp2a.formation.robot_models import RobotModel
from mp2a.robots.adapters import ADAPTERS
from mp2a.robots.table import INTERFACES, RobotInterface

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ORIGINS = ("in-place", "fixed-frame")
_MODEL_FIELDS = {field.name: field.type for field in dataclasses.fields(RobotModel) if field.name != "name"}
_FIELDS = {field.name: field.type for field in dataclasses.fields(RobotInterface) if field.name != "model"}
_TOPICS = (
    "command_topic", "human_topic", "odometry_topic", "pose_topic", "twist_topic", "points_topic", "sound_topic",
    "ready_topic", "stop_front_topic", "stop_rear_topic", "obstacles_topic", "acquire", "release",
)  # fmt: skip
_FRAMES = ("fixed_frame", "body_frame")


class RobotsFile(NamedTuple):
    """What a robots file says.

    Attributes
    ----------
    interfaces
        A robot by role.
    adapter
        What is behind them: one of `mp2a.robots.adapters.ADAPTERS`.
    origin
        ``in-place``: each robot stands at its place when it starts, and its own fixed frame may lie anywhere.
        ``fixed-frame``: all robots have one fixed frame, in which the virtual leader starts at the origin.
    world
        Of the simulator; None: an empty one.
    recording
        That is played back: a bag, or a folder with one a robot.
    begin
        s into it at which the scenario begins; None: as soon as pose and odometry are known.
    """

    interfaces: dict[str, RobotInterface]
    adapter: str = "dry"
    origin: str = "in-place"
    world: Path | None = None
    recording: Path | None = None
    begin: float | None = None


def read(path: str | Path, roles: Sequence[str]) -> RobotsFile:
    """Read a robots file for the roles of a scenario.

    Parameters
    ----------
    path
        A TOML file; ``docs/robots.md`` describes it.
    roles
        Which must be in it.

    Returns
    -------
    RobotsFile
        Interfaces and how to reach them.

    Raises
    ------
    InputError
        If the file cannot be read, a role is missing or unknown, or an entry is not what it has to be: the message
        names the file, the entry, what was given and what was expected.
    """
    try:
        text = Path(path).read_bytes().decode("utf-8")
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as a robots file ({error})") from error
    found = parse(text, roles, str(path))
    world, recording = (None if at is None else Path(path).parent / at for at in (found.world, found.recording))
    return found._replace(world=world, recording=recording)


def parse(text: str, roles: Sequence[str], where: str = "robots") -> RobotsFile:
    """Read robots from the text of a robots file; ``where`` is what errors call it."""
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where}: cannot be read as TOML ({error})") from error
    robots = tables.pop("robots", {})
    if not isinstance(robots, dict) or not all(isinstance(entry, dict) for entry in robots.values()):
        raise InputError(f"{where}: robots: got {robots!r}, expected a table [robots.ROLE] for each role")
    common = tables.pop("all", {})
    if not isinstance(common, dict):
        raise InputError(f"{where}: all: got {common!r}, expected a table [all] of what all robots have in common")
    adapter = _one_of(where, "adapter", tables.pop("adapter", "dry"), tuple(ADAPTERS))
    origin = _one_of(where, "origin", tables.pop("origin", "in-place"), ORIGINS)
    world = _path(where, "world", tables.pop("world", None), "a world file")
    recording = _path(where, "recording", tables.pop("recording", None), "a bag, or of a folder of bags")
    if tables:
        expected = "adapter, origin, world, recording, [all] or [robots.ROLE]"
        raise InputError(f"{where}: got {next(iter(tables))!r}, expected one of {expected}")
    missing = [role for role in roles if role not in robots]
    unknown = [role for role in robots if role not in roles]
    if missing or unknown:
        given = f"no table [robots.{missing[0]}]" if missing else f"a table for unknown role {unknown[0]!r}"
        raise InputError(f"{where}: got {given}, expected one for each of {', '.join(roles)}")
    made = {role: _interface({**common, **robots[role]}, f"{where}: robots.{role}") for role in roles}
    return RobotsFile(made, adapter, origin, world, recording)


def _interface(entry: Mapping[str, Any], where: str) -> RobotInterface:
    given = dict(entry)
    name = _one_of(where, "model", given.pop("model", None), tuple(INTERFACES))
    namespace = given.pop("namespace", "")
    if not isinstance(namespace, str) or namespace.strip("/ ") != namespace.lstrip("/"):
        raise InputError(f"{where}: namespace: got {namespace!r}, expected a name such as 'husky1'")
    known = {**_FIELDS, **_MODEL_FIELDS}
    for key, value in given.items():
        if key not in known:
            raise InputError(f"{where}: got {key!r}, expected one of model, namespace, {', '.join(known)}")
        wanted = (int, float) if known[key] is float else str
        if not isinstance(value, wanted) or isinstance(value, bool):
            what = "a number" if known[key] is float else "a text"
            raise InputError(f"{where}: {key}: got {value!r}, expected {what}")
    base = INTERFACES[name]
    limits: dict[str, Any] = {key: float(value) for key, value in given.items() if key in _MODEL_FIELDS}
    own: dict[str, Any] = {key: value for key, value in given.items() if key in _FIELDS}
    try:
        model = dataclasses.replace(base.model, **limits)
        made = dataclasses.replace(base, model=model, **own)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    return within(made, namespace.strip("/"), keep=own) if namespace else made


def within(interface: RobotInterface, namespace: str, keep: Mapping[str, Any] | None = None) -> RobotInterface:
    """Put topics and frames into a namespace, as in simulations with one ROS master; not those in ``keep``."""
    kept = {} if keep is None else keep
    names: dict[str, Any] = {}
    for name in (*_TOPICS, *_FRAMES):
        value = getattr(interface, name)
        if value and name not in kept:
            names[name] = f"{namespace}/{value}" if name in _FRAMES else f"/{namespace}/{value.lstrip('/')}"
    return dataclasses.replace(interface, **names)


def _path(where: str, name: str, value: Any, what: str) -> Path | None:
    if value is not None and not isinstance(value, str):
        raise InputError(f"{where}: {name}: got {value!r}, expected the path of {what}")
    return None if value is None else Path(value)


def _one_of(where: str, name: str, value: Any, allowed: Sequence[str]) -> str:
    if value not in allowed:
        raise InputError(f"{where}: {name}: got {value!r}, expected one of {', '.join(allowed)}")
    return str(value)
