"""Inverse dynamics of many samples by other libraries, each in its best batch form on a processor, in float64.

All get the same chain as a URDF text. None of them is a dependency; `LIBRARIES` says how to install each.
"""

import importlib.util
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from mp2a import Model

Batch = Callable[[], np.ndarray]
"""Works out the torques ``(T, n)`` once more."""
Samples = tuple[np.ndarray, np.ndarray, np.ndarray]
"""q, v and a, ``(T, n)`` each."""


class Library(NamedTuple):
    """One that can be measured if it is there."""

    module: str
    """What has to be importable."""
    install: str
    form: str
    """What is called."""
    largest: int
    """Bodies up to which compiling takes less than a few minutes."""
    prepare: Callable[[Model, Samples], Batch]


def is_there(library: Library) -> bool:
    """Tell whether a library is installed."""
    try:
        return importlib.util.find_spec(library.module) is not None
    except ModuleNotFoundError:  # a parent package is missing
        return False


def urdf(model: Model) -> str:
    """Write a chain of revolute joints as URDF, on a base."""
    lines = [
        '<?xml version="1.0"?><robot name="chain">',
        # For MuJoCo only: no hulls, no guesses, bodies as they are.
        '<mujoco><compiler angle="radian" fusestatic="false" balanceinertia="false" discardvisual="true"/></mujoco>',
        # frax wants a base with mass; it does not move, so that this changes nothing.
        '<link name="base"><inertial><origin xyz="0 0 0" rpy="0 0 0"/>'
        '<mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
        "</inertial></link>",
    ]
    for i, (axis, parent) in enumerate(zip(model.axes, model.parents, strict=True)):
        names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        places = zip(names, model.inertias[i][[0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]], strict=True)
        inertia = " ".join(f'{name}="{float(number)!r}"' for name, number in places)
        lines.append(
            f'<link name="body{i}"><inertial><origin xyz="{_numbers(model.coms[i])}" rpy="0 0 0"/>'
            f'<mass value="{float(model.masses[i])!r}"/><inertia {inertia}/></inertial></link>'
            f'<joint name="joint{i:04}" type="revolute"><parent link="{f"body{parent}" if parent >= 0 else "base"}"/>'
            f'<child link="body{i}"/><origin xyz="{_numbers(model.translations[i])}" '
            f'rpy="{_numbers(_roll_pitch_yaw(model.rotations[i]))}"/><axis xyz="{_numbers(axis)}"/>'
            '<limit lower="-100" upper="100" effort="1e9" velocity="1e9"/></joint>'
        )
    return "\n".join([*lines, "</robot>"])


def _numbers(values: np.ndarray) -> str:
    return " ".join(repr(float(x)) for x in values)


def _roll_pitch_yaw(rotation: np.ndarray) -> np.ndarray:
    across = np.hypot(rotation[2, 1], rotation[2, 2])
    roll, pitch = np.arctan2(rotation[2, 1], rotation[2, 2]), np.arctan2(-rotation[2, 0], across)
    return np.array([roll, pitch, np.arctan2(rotation[1, 0], rotation[0, 0])])


def _mujoco(model: Model, samples: Samples) -> Batch:
    import mujoco

    mj_model = mujoco.MjModel.from_xml_string(urdf(model))
    mj_model.opt.gravity = 0.0, 0.0, -9.81
    mj_model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mujoco.MjData(mj_model)
    torque = np.empty_like(samples[1])

    def run() -> np.ndarray:
        inverse, q, v, a, result = mujoco.mj_inverse, data.qpos, data.qvel, data.qacc, data.qfrc_inverse
        for t, sample in enumerate(zip(*samples, strict=True)):
            q[:], v[:], a[:] = sample
            inverse(mj_model, data)
            torque[t] = result
        return torque

    return run


def _on_jax(one: Callable[..., Any], samples: Samples) -> Batch:
    """Compile ``one(q, v, a)`` for all samples at once; arrays stay on JAX's side."""
    import jax

    batch = jax.jit(jax.vmap(one)).lower(*samples).compile()
    arrays = [jax.device_put(x) for x in samples]
    return lambda: np.asarray(batch(*arrays).block_until_ready())


def _with_doubles() -> None:
    import jax

    jax.config.update("jax_enable_x64", True)


def _frax(model: Model, samples: Samples) -> Batch:
    _with_doubles()
    import tempfile

    from frax import Robot

    with tempfile.NamedTemporaryFile("w", suffix=".urdf") as file:
        file.write(urdf(model))
        file.flush()
        robot = Robot(file.name)
    up = np.array([0.0, 0.0, 9.81, 0.0, 0.0, 0.0])
    return _on_jax(lambda q, v, a: robot.rnea(q, v, a, up, None), samples)


def _mjx(model: Model, samples: Samples) -> Batch:
    _with_doubles()
    import mujoco
    from mujoco import mjx

    mj_model = mujoco.MjModel.from_xml_string(urdf(model))
    mj_model.opt.gravity = 0.0, 0.0, -9.81
    mj_model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    there = mjx.put_model(mj_model)
    data = mjx.make_data(mj_model)
    return _on_jax(lambda q, v, a: mjx.inverse(there, data.replace(qpos=q, qvel=v, qacc=a)).qfrc_inverse, samples)


def _adam(model: Model, samples: Samples) -> Batch:
    _with_doubles()
    import jax.numpy as jnp
    from adam.jax import KinDynComputations

    joints = [f"joint{i:04}" for i in range(len(model))]
    down = np.array([0.0, 0.0, -9.81, 0.0, 0.0, 0.0])
    robot = KinDynComputations(urdf(model), joints, gravity=down)
    pose, rest = jnp.eye(4), jnp.zeros(6)

    def one(q: Any, v: Any, a: Any) -> Any:
        return robot.mass_matrix(pose, q)[6:, 6:] @ a + robot.bias_force(pose, q, rest, v)[6:]

    return _on_jax(one, samples)


LIBRARIES = {
    "MuJoCo": Library("mujoco", "mujoco", "mj_inverse, Python loop", 512, _mujoco),
    "frax": Library("frax", "frax", "Robot.rnea, jit and vmap", 512, _frax),
    "MJX": Library("mujoco.mjx", "mujoco-mjx", "mjx.inverse, jit and vmap", 32, _mjx),
    "adam": Library("adam", "'adam-robotics[jax]'", "mass_matrix and bias_force, jit and vmap", 32, _adam),
}
