"""Functions that a process calls without numba: where the compiled kernels are kept, found, built and loaded.

numba takes 56 MB and 0.6 s in every process that imports it, too much for hundreds of ranks. So a separate process
compiles the kernels to shared objects (`mp2a.kernels.compiler`), once for each kind of processor and version of the
package, a part when it is first wanted, and the others load them with ctypes: 0.1 MB and a millisecond. Where
`mp2a.kernels.linker` knows no shared objects, LLVM's own loader takes the object as it is: 8 MB and 60 ms a process.

A file lies in the user's cache directory as ``kernels-<part>-<what it is for>-<checksum>.so`` (or ``.o``). It is
written elsewhere and renamed, so it is whole or not there; should it be damaged all the same, its checksum tells, and
it counts as not there. Processes that build at once do the work twice and nothing worse.
"""

from __future__ import annotations

import ctypes
import fcntl
import hashlib
import os
import platform
import stat
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import mp2a
from mp2a import spatial

Kernel = Callable[..., int | None]
"""A kernel. Those of `ELEMENTWISE` are ``f(count, out, *inputs)``: number of samples, and for each array the address of
the pointer to its numbers; for the others see `mp2a.kernels.rnea`, `mp2a.kernels.replay` and `mp2a.kernels.worker`."""


class Elementwise(NamedTuple):
    """A formula that takes each sample by itself: how many numbers a sample has in its result and its inputs."""

    result: int
    inputs: tuple[int, ...]
    constants: tuple[int, ...] = ()
    """Numbers of further inputs that are the same for all samples."""


_JOINT = (15,)
"""Rotation and translation of a joint's frame in the parent, and its axis."""

ELEMENTWISE = {
    "compose": Elementwise(24, (24, 24)),
    "transform": Elementwise(28, (28, 24)),
    "force": Elementwise(6, (28, 6, 6)),
    "transform_force": Elementwise(6, (24, 6)),
    "force_from_parent": Elementwise(6, (24, 6)),
    "product": Elementwise(36, (36, 36)),
    "push": Elementwise(6, (36, 6, 6)),
    "apply_matrix": Elementwise(6, (36, 6)),
    "transpose_matrix": Elementwise(36, (36,)),
    "operator_across": Elementwise(36, (24,)),
    "velocity_across": Elementwise(6, (24,)),
    "acceleration_across": Elementwise(6, (24, 6)),
    "acceleration_from_base": Elementwise(6, (24,), (3,)),
    "to_classical": Elementwise(6, (6, 6)),
    "body_inertia": Elementwise(28, (6,), (28,)),
    "body_force": Elementwise(6, (6, 6), (28,)),
    "subtract": Elementwise(6, (6, 6)),
    "path_revolute": Elementwise(24, (1, 1, 1), _JOINT),
    "path_continuous": Elementwise(24, (2, 1, 1), _JOINT),
    "path_prismatic": Elementwise(24, (1, 1, 1), _JOINT),
    "path_planar": Elementwise(24, (4, 3, 3), _JOINT),
    "path_spherical": Elementwise(24, (4, 3, 3), _JOINT),
    "path_free": Elementwise(24, (7, 6, 6), _JOINT),
    "torque_revolute": Elementwise(1, (6,), (3,)),
    "torque_continuous": Elementwise(1, (6,), (3,)),
    "torque_prismatic": Elementwise(1, (6,), (3,)),
    "torque_planar": Elementwise(3, (6,), (3,)),
    "torque_spherical": Elementwise(3, (6,), (3,)),
    "torque_free": Elementwise(6, (6,), (3,)),
}
"""Formulas of segments, of `mp2a.kernels.formulas`, and of joints, of `mp2a.kernels.joint_formulas`."""

ARGUMENTS = {
    **{name: "n" + "p" * (1 + len(form.inputs) + len(form.constants)) for name, form in ELEMENTWISE.items()},
    **dict.fromkeys(
        (
            "rnea_double", "rnea_double_bodies", "rnea_single", "rnea_single_bodies",
            "rnea_lanes", "rnea_lanes_bodies", "reduce_block",
            "reduce_block_lanes", "rnea_scalar", "rnea_scalar_bodies", "placements_double", "placements_scalar",
            "aba_double", "aba_single", "aba_scalar",
        ),
        "nnnnn",
    ),
    "direct_call": "nnn",
    "replay": "nnnn",
    "replay_call": "nnn",
    "pool_worker": "nn",
    "pool_run": "n",
}  # fmt: skip
"""The kernels, and what each takes: whole numbers (n; addresses too) and pointers (p)."""

RESULTS = "direct_call", "replay", "replay_call"
"""Those of them that return a whole number."""

USUAL = "usual"

PARTS = {
    USUAL: (
        *ELEMENTWISE, "replay", "replay_call", "direct_call", "pool_worker", "pool_run", "rnea_double", "rnea_scalar",
    ),
    "bodies": ("rnea_double_bodies", "rnea_scalar_bodies"),
    "single": ("rnea_single", "rnea_single_bodies"),
    "long": ("rnea_lanes", "rnea_lanes_bodies", "reduce_block", "reduce_block_lanes"),
    "placements": ("placements_double", "placements_scalar"),
    "aba": ("aba_double", "aba_scalar"),
    "aba-single": ("aba_single",),
}  # fmt: skip
"""Kernels that are built together, when one of them is first wanted."""

BUILD_LIMIT = 300.0
"""Seconds after which a build has failed. On two cores with nothing else to do a part takes about ten."""

CPU_FEATURES = "MP2A_CPU_FEATURES"
"""Environment variable with changes to the processor's features, in LLVM's words: ``-avx512f`` for kernels as a
processor without AVX-512 would have them, ``-sse3`` for those of any x86-64."""

_POLL = 0.05
_GRACE = 10.0
_UNUSABLE = OSError, AttributeError, ImportError, RuntimeError
"""What loading raises where a file, or the process that is to load it, is not as it should be."""

_engines: list[Any] = []
"""LLVM's loaders, which have to live as long as what they have loaded."""

_FAILURE_HOLDS = 600.0


class UnavailableError(Exception):
    """There are no compiled kernels, for the reason the message gives."""


class BuilderStuckError(UnavailableError):
    """Another process has been building them for too long."""


def obtain(part: str, *, patient: bool) -> tuple[Path, dict[str, Kernel]]:
    """Load the kernels of a part, and build them first where they are not there.

    Parameters
    ----------
    part
        One of `PARTS`.
    patient
        Whether to try again what failed some minutes ago. Not for ranks, which start by the hundreds.

    Returns
    -------
    Path
        The file they come from.
    dict of str to Callable
        The kernels by name.

    Raises
    ------
    UnavailableError
        If that is not possible.
    """
    if sys.implementation.name != "cpython":
        raise UnavailableError(f"{sys.implementation.name} does not say where arrays lie in memory")
    stem, reason = f"kernels-{part}-{_purpose()}", "no directory to keep them in"
    for folder in cache_folders():
        if path := find(folder, stem):
            with suppress(*_UNUSABLE):  # perhaps a file system that allows no programs
                return path, _open(path, PARTS[part])
    for folder in cache_folders():
        try:
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            if not is_private(folder):
                reason = f"{folder} is not this user's own"
                continue
            _ensure(folder, stem, part, patient)
            if path := find(folder, stem):
                return path, _open(path, PARTS[part])
        except _UNUSABLE as error:
            reason = str(error)
    raise UnavailableError(reason)


def find(folder: Path, stem: str) -> Path | None:
    """Find a file of kernels that is whole."""
    with suppress(OSError):
        if not is_private(folder):
            return None
        for path in sorted(folder.glob(f"{stem}-*.*o")):
            if path.stem == f"{stem}-{checksum(path.read_bytes())}":
                return path
    return None


def checksum(*contents: bytes) -> str:
    """Return what tells whether contents are whole."""
    digest = hashlib.blake2b(digest_size=12)
    for content in contents:
        digest.update(len(content).to_bytes(8, "little") + content)
    return digest.hexdigest()


def _purpose() -> str:
    """Name what the kernels have to be made for: this processor, and this version of the kernels."""
    formulas = Path(spatial.__file__)  # of which the kernels have one
    sources = [path.read_bytes() for path in (*sorted(Path(__file__).parent.glob("*.py")), formulas)]
    target = processor(), platform.machine(), os.environ.get(CPU_FEATURES, ""), mp2a.__version__
    return checksum(*(word.encode() for word in target), *sources)


def processor() -> str:
    """Model and features of the processor, from which LLVM draws its own; LLVM itself is not asked for its size."""
    names = ("vendor_id", "cpu family", "model", "flags", "CPU implementer", "CPU part", "CPU variant", "Features")
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as lines:  # noqa: PTH123
            fields: dict[str, str] = {}
            for line in lines:
                name, _, value = line.partition(":")
                if name.strip() in fields:
                    break  # the next processor
                fields[name.strip()] = value.strip()
    except OSError:
        return platform.processor()
    return "\n".join(fields.get(name, "") for name in names)


def cache_folders() -> Iterator[Path]:
    """Where the kernels may lie: the user's cache directory, else a temporary one."""
    with suppress(RuntimeError):  # no home
        base = os.environ.get("XDG_CACHE_HOME") or ""
        # A relative path counts as none, as the XDG specification wants it.
        yield (Path(base) if Path(base).is_absolute() else Path.home() / ".cache") / "mp2a"
    import tempfile

    yield Path(tempfile.gettempdir()) / f"mp2a-{os.getuid()}"


def is_private(folder: Path) -> bool:
    """Tell whether a folder is this user's and nobody else's; who could write there could have any program run."""
    state = folder.lstat()
    return stat.S_ISDIR(state.st_mode) and state.st_uid == os.getuid() and not state.st_mode & 0o022


def _open(path: Path, names: Iterable[str]) -> dict[str, Kernel]:
    address_of = _open_object(path) if path.suffix == ".o" else _open_shared(path)
    kernels: dict[str, Kernel] = {}
    for name in names:
        kinds = [ctypes.c_ssize_t if kind == "n" else ctypes.c_void_p for kind in ARGUMENTS[name]]
        prototype = ctypes.CFUNCTYPE(ctypes.c_ssize_t if name in RESULTS else None, *kinds)
        kernels[name] = prototype(address_of(f"mp2a_{name}"))
    return kernels


def _open_shared(path: Path) -> Callable[[str], int]:
    library = ctypes.CDLL(str(path))
    return lambda name: ctypes.cast(library[name], ctypes.c_void_p).value or 0


def _open_object(path: Path) -> Callable[[str], int]:
    """Have LLVM load an object."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_default_triple().create_target_machine()
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    engine.add_object_file(llvm.ObjectFileRef.from_path(str(path)))
    engine.finalize_object()
    _engines.append(engine)
    return lambda name: int(engine.get_function_address(name))


def _ensure(folder: Path, stem: str, part: str, patient: bool) -> None:
    """Build in this folder, or wait for the process that does."""
    failure = folder / f"{stem}.failed"
    # What has failed is tried again by who started later, but by a rank not at once: ranks start by the hundreds.
    since = time.time() - (0.0 if patient else _FAILURE_HOLDS)
    deadline = time.monotonic() + BUILD_LIMIT + _GRACE
    while time.monotonic() < deadline:
        with suppress(OSError):
            if failure.stat().st_mtime > since:
                raise UnavailableError(failure.read_text(encoding="utf-8"))
        with _locked(folder / f"{stem}.lock") as is_mine:
            if find(folder, stem):
                return
            if is_mine:
                try:
                    _build(folder, stem, part)
                except UnavailableError as error:
                    with suppress(OSError):
                        failure.write_text(str(error), encoding="utf-8")
                    raise
                failure.unlink(missing_ok=True)
                return
        time.sleep(_POLL)
    raise BuilderStuckError("another process has been building them for too long")


@contextmanager
def _locked(path: Path) -> Iterator[bool]:
    """Hold a lock if no other process does; it ends with the process, however that ends.

    A file system without locks raises OSError, and the next folder is tried.
    """
    with path.open("a") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            is_mine = False
        else:
            is_mine = True
        yield is_mine


def _build(folder: Path, stem: str, part: str) -> None:
    """Compile in a process of its own, so that this one does without numba."""
    # Only here, as what they import themselves is a third of what loading takes a rank.
    import subprocess
    from importlib.util import find_spec

    if find_spec("numba") is None:
        raise UnavailableError("numba is not installed, which compiles them")
    if sys.stderr is not None and sys.stderr.isatty():
        print(f"mp2a: compiling kernels for this processor, once: {part}; some seconds", file=sys.stderr, flush=True)
    # Not the settings of numba that a user may have for other programs, and not those that make a process a rank.
    foreign = ("PYTHONWARNINGS", "NUMBA_", "OMPI_", "PMIX_", "PMI_", "PRTE_")
    environment = {name: value for name, value in os.environ.items() if not name.startswith(foreign)}
    environment["PYTHONPATH"] = os.pathsep.join(path or "." for path in sys.path)
    code = "import sys; from mp2a.kernels.compiler import make; make(sys.argv[1], sys.argv[2], sys.argv[3:])"
    command = [sys.executable, "-c", code, str(folder), stem, *PARTS[part]]
    try:
        subprocess.run(
            command,
            env=environment,
            check=True,
            timeout=BUILD_LIMIT,
            text=True,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )
    except subprocess.CalledProcessError as error:
        lines = error.stderr.strip().splitlines() or [f"exit status {error.returncode}"]
        raise UnavailableError(f"building failed: {lines[-1]}") from error
    except (OSError, subprocess.TimeoutExpired) as error:
        raise UnavailableError(f"building failed: {error}") from error
