"""Robots files: TOML that says which robot plays which role, and what is different about it."""

import dataclasses
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from mp2a.dependencies import parse_toml
from mp2a.exceptions import InputError
from mp2a.file_kinds import read_text
from mp2a.formation.robot_models import RobotModel
from mp2a.robots.adapters import ADAPTERS
from mp2a.robots.robot_config import ROBOT_CONFIGS, RobotConfig

ORIGINS = ("in-place", "fixed-frame")
_MODEL_FIELDS = {field.name: field.type for field in dataclasses.fields(RobotModel) if field.name != "name"}
_FIELDS = {field.name: field.type for field in dataclasses.fields(RobotConfig) if field.name != "model"}
_TOPICS = (*(name for name in _FIELDS if name.endswith("_topic") and name != "tf_topic"), "acquire", "release")
_FRAMES = ("fixed_frame", "body_frame")


class RobotsFile(NamedTuple):
    """What a robots file says.

    Attributes
    ----------
    configs
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

    configs: dict[str, RobotConfig]
    adapter: str = "dry"
    origin: str = "in-place"
    world: Path | None = None
    recording: Path | None = None
    begin: float | None = None


def read_robots(path: str | Path, roles: Sequence[str]) -> RobotsFile:
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
        The robots, and what is behind them.

    Raises
    ------
    InputError
        If the file cannot be read, a role is missing or unknown, or an entry is not what it has to be: the message
        names the file, the entry, what was given and what was expected.
    """
    tables = parse_toml(read_text(path, "a robots file", "TOML"), str(path))
    robots = robots_of(tables, roles, str(path))
    world, recording = (None if at is None else Path(path).parent / at for at in (robots.world, robots.recording))
    return robots._replace(world=world, recording=recording)


def robots_of(tables: dict[str, Any], roles: Sequence[str], where: str = "robots") -> RobotsFile:
    """Return the robots that the tables of a robots file are about; ``where`` is what errors call it."""
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
        wrong = f"no table [robots.{missing[0]}]" if missing else f"a table for unknown role {unknown[0]!r}"
        raise InputError(f"{where}: got {wrong}, expected one for each of {', '.join(roles)}")
    configs = {role: _config({**common, **robots[role]}, f"{where}: robots.{role}") for role in roles}
    return RobotsFile(configs, adapter, origin, world, recording)


def _config(entry: Mapping[str, Any], where: str) -> RobotConfig:
    fields = dict(entry)
    base = ROBOT_CONFIGS[_one_of(where, "model", fields.pop("model", None), tuple(ROBOT_CONFIGS))]
    namespace = fields.pop("namespace", "")
    if not isinstance(namespace, str) or namespace.strip("/ ") != namespace.lstrip("/"):
        raise InputError(f"{where}: namespace: got {namespace!r}, expected a name such as 'husky1'")
    known = {**_FIELDS, **_MODEL_FIELDS}
    for key, value in fields.items():
        if key not in known:
            raise InputError(f"{where}: got {key!r}, expected one of model, namespace, {', '.join(known)}")
        wanted = (int, float) if known[key] is float else str
        if not isinstance(value, wanted) or isinstance(value, bool):
            what = "a number" if known[key] is float else "a text"
            raise InputError(f"{where}: {key}: got {value!r}, expected {what}")
    limits: dict[str, Any] = {key: fields.pop(key) for key in _MODEL_FIELDS if key in fields}
    try:
        limits = {key: float(value) for key, value in limits.items()}
        model = dataclasses.replace(base.model, **limits)
        config = dataclasses.replace(base, model=model, **fields)
    except (InputError, OverflowError) as error:
        raise InputError(f"{where}: {error}") from None
    return within(config, namespace.strip("/"), keep=fields) if namespace else config


def within(config: RobotConfig, namespace: str, keep: Collection[str] = ()) -> RobotConfig:
    """Return a robot whose topics and frames are in a namespace, as in simulations with one ROS master.

    Those in ``keep`` stay what they are.
    """
    names: dict[str, Any] = {}
    for name in (*_TOPICS, *_FRAMES):
        value = getattr(config, name)
        if value and name not in keep:
            names[name] = f"{namespace}/{value}" if name in _FRAMES else f"/{namespace}/{value.lstrip('/')}"
    return dataclasses.replace(config, **names)


def _path(where: str, name: str, value: Any, what: str) -> Path | None:
    if value is not None and not isinstance(value, str):
        raise InputError(f"{where}: {name}: got {value!r}, expected the path of {what}")
    return None if value is None else Path(value)


def _one_of(where: str, name: str, value: Any, allowed: Sequence[str]) -> str:
    if value not in allowed:
        raise InputError(f"{where}: {name}: got {value!r}, expected one of {', '.join(allowed)}")
    return str(value)
