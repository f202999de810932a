"""From the formulas to functions that a process calls without numba: compile, link, keep, find and load.

numba takes 56 MB and 0.6 s in every process that imports it, too much for hundreds of ranks. So a separate process
compiles the kernels to one shared object, once for each kind of processor and version of the package, and the others
load that with ctypes.

The object lies in the user's cache directory as ``kernels-<what it is for>-<checksum>.so``. It is written elsewhere
and renamed, so it is whole or not there; should a file be damaged all the same, its checksum tells, and it counts as
not there. Processes that build at once do the work twice and nothing worse.
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
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import mp2a
from mp2a.cores import usable_cores

Run = Callable[..., int | None]
"""A kernel. Those of segments are ``f(count, out, *inputs)``: number of samples, and for each array the address of the
pointer to its numbers; for "rounds" see ``rounds.c``, for the others `mp2a.kernels.recursion`."""

ARGUMENTS = {
    "compose": "nppp",
    "move": "nppp",
    "force": "npppp",
    "carry": "nppp",
    **dict.fromkeys(
        (
            "rnea_double", "rnea_double_bodies", "rnea_single", "rnea_single_bodies",
            "rnea_lanes", "rnea_lanes_bodies", "reach",
            "reach_lanes",
        ),
        "nnnnn",
    ),
}  # fmt: skip
"""The kernels, and what each takes: whole numbers (n; addresses too) and pointers (p)."""

RANK_WAIT = 10.0
"""Seconds for which a rank waits for the one that builds. It can do without: numpy's versions are right, only slow."""

BUILD_LIMIT = 120.0
"""Seconds after which a build has failed. On two cores it takes about ten."""

CPU_FEATURES = "MP2A_CPU_FEATURES"
"""Environment variable with changes to the processor's features, in LLVM's words: ``-avx512f`` for kernels as a
processor without AVX-512 would have them, ``-sse3`` for those of any x86-64."""

_POLL = 0.05
_FAILURE_HOLDS = 600.0


class UnavailableError(Exception):
    """There are no compiled kernels, for the reason the message gives."""


def obtain(*, patient: bool) -> tuple[Path, dict[str, Run]]:
    """Load the kernels, and build them first where they are not there.

    Parameters
    ----------
    patient
        Whether to wait as long as another process builds, and to try again what failed before. Not for ranks.

    Returns
    -------
    Path
        The shared object.
    dict of str to Callable
        The kernels by name.

    Raises
    ------
    UnavailableError
        If that is not possible.
    """
    if sys.implementation.name != "cpython":
        raise UnavailableError(f"{sys.implementation.name} does not say where arrays lie in memory")
    stem, reason = f"kernels-{_purpose()}", "no directory to keep them in"
    for folder in _folders():
        if found := find(folder, stem):
            with suppress(OSError, AttributeError):  # perhaps a file system that allows no programs
                return found, _open(found)
    for folder in _folders():
        try:
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            if not _is_private(folder):
                reason = f"{folder} is not this user's own"
                continue
            _ensure(folder, stem, patient)
            if found := find(folder, stem):
                return found, _open(found)
        except (OSError, AttributeError) as error:
            reason = str(error)
    raise UnavailableError(reason)


def find(folder: Path, stem: str) -> Path | None:
    """Find a shared object that is whole."""
    with suppress(OSError):
        if not _is_private(folder):
            return None
        for path in sorted(folder.glob(f"{stem}-*.so")):
            if path.stem == f"{stem}-{_checksum(path.read_bytes())}":
                return path
    return None


def _checksum(*contents: bytes) -> str:
    digest = hashlib.blake2b(digest_size=12)
    for content in contents:
        digest.update(len(content).to_bytes(8, "little") + content)
    return digest.hexdigest()


def _purpose() -> str:
    """Name what a shared object has to be made for: this processor, and this version of the kernels."""
    sources = [path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.[cp]*"))]
    target = _processor(), platform.machine(), os.environ.get(CPU_FEATURES, ""), mp2a.__version__
    return _checksum(*(word.encode() for word in target), *sources)


def _processor() -> str:
    """Model and features of the processor, from which LLVM draws its own; LLVM itself is not asked for its size."""
    told = ("vendor_id", "cpu family", "model", "flags", "CPU implementer", "CPU part", "CPU variant", "Features")
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as lines:  # noqa: PTH123
            known: dict[str, str] = {}
            for line in lines:
                name, _, value = line.partition(":")
                if name.strip() in known:
                    break  # the next processor
                known[name.strip()] = value.strip()
    except OSError:
        return platform.processor()
    return "\n".join(known.get(name, "") for name in told)


def _folders() -> Iterator[Path]:
    """Where shared objects may lie: the user's cache directory, else a temporary one."""
    with suppress(RuntimeError):  # no home
        base = os.environ.get("XDG_CACHE_HOME") or ""
        # A relative path counts as none, as the XDG specification wants it.
        yield (Path(base) if Path(base).is_absolute() else Path.home() / ".cache") / "mp2a"
    import tempfile

    yield Path(tempfile.gettempdir()) / f"mp2a-{os.getuid()}"


def _is_private(folder: Path) -> bool:
    """Tell whether a folder is this user's and nobody else's; who could write there could have any program run."""
    state = folder.lstat()
    return stat.S_ISDIR(state.st_mode) and state.st_uid == os.getuid() and not state.st_mode & 0o022


def _open(path: Path) -> dict[str, Run]:
    library = ctypes.CDLL(str(path))
    kernels = {}
    for name, arguments in ARGUMENTS.items():
        kernels[name] = library[f"mp2a_{name}"]
        kernels[name].argtypes = [ctypes.c_ssize_t if kind == "n" else ctypes.c_void_p for kind in arguments]
        kernels[name].restype = None
    kernels["rounds"] = library["mp2a_rounds"]
    kernels["rounds"].argtypes = [ctypes.c_void_p, ctypes.c_ssize_t, ctypes.c_ssize_t]
    kernels["rounds"].restype = ctypes.c_longlong
    for name, addresses in (("help", 2), ("lead", 1)):
        kernels[name] = library[f"mp2a_{name}"]
        kernels[name].argtypes = [ctypes.c_ssize_t] * addresses
        kernels[name].restype = None
    return dict(kernels)


def _ensure(folder: Path, stem: str, patient: bool) -> None:
    """Build in this folder, or wait for the process that does."""
    failure = folder / f"{stem}.failed"
    if not patient:
        with suppress(OSError):
            # Ranks start by the hundreds: they do not all find out by themselves that it does not work.
            if time.time() - failure.stat().st_mtime < _FAILURE_HOLDS:
                raise UnavailableError(failure.read_text(encoding="utf-8"))
    deadline = time.monotonic() + (BUILD_LIMIT if patient else RANK_WAIT)
    waited = False
    while time.monotonic() < deadline:
        with _locked(folder / f"{stem}.lock") as mine:
            if find(folder, stem):
                return
            if mine and waited and not patient:
                raise UnavailableError("another process could not build them")
            if mine:
                try:
                    _build(folder, stem)
                except UnavailableError as error:
                    with suppress(OSError):
                        failure.write_text(str(error), encoding="utf-8")
                    raise
                failure.unlink(missing_ok=True)
                return
        waited = True
        time.sleep(_POLL)
    raise UnavailableError("another process is building them and is not done")


@contextmanager
def _locked(path: Path) -> Iterator[bool]:
    """Hold a lock if no other process does; it ends with the process, however that ends.

    A file system without locks raises OSError, and the next folder is tried.
    """
    with path.open("a") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            mine = False
        else:
            mine = True
        yield mine


def _build(folder: Path, stem: str) -> None:
    """Compile in a process of its own, so that this one does without numba."""
    # Only here, as what they import themselves is a third of what loading takes a rank.
    import subprocess
    from importlib.util import find_spec

    if find_spec("numba") is None:
        raise UnavailableError("numba is not installed, which compiles them")
    _linker()
    if sys.stderr is not None and sys.stderr.isatty():
        print("mp2a: compiling the kernels for this processor, once; a few seconds", file=sys.stderr, flush=True)
    # Not the settings of numba that a user may have for other programs, and not those that make a process a rank.
    foreign = ("PYTHONWARNINGS", "NUMBA_", "OMPI_", "PMIX_", "PMI_", "PRTE_")
    environment = {name: value for name, value in os.environ.items() if not name.startswith(foreign)}
    environment["PYTHONPATH"] = os.pathsep.join(path or "." for path in sys.path)
    code = "import sys; from mp2a.kernels.library import make; make(*sys.argv[1:])"
    command = [sys.executable, "-c", code, str(folder), stem]
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


def _linker() -> str:
    import shutil

    for name in (os.environ.get("CC", ""), "cc", "gcc", "clang"):
        if found := shutil.which(name):
            return found
    raise UnavailableError("there is no C compiler (cc) on the path, which links them")


def make(folder: str, stem: str) -> None:
    """Compile and link into a folder; what the separate process does."""
    import subprocess
    import tempfile
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    with tempfile.TemporaryDirectory(dir=folder, prefix="building-") as workshop:
        here = Path(__file__).parent
        objects, whole = [here / "rounds.c", here / "crew.c"], Path(workshop) / "kernels.so"
        with ProcessPoolExecutor(usable_cores(), mp_context=get_context("fork")) as processes:
            for name, code in zip(ARGUMENTS, processes.map(machine_code, ARGUMENTS), strict=True):
                objects.append(Path(workshop) / f"{name}.o")
                objects[-1].write_bytes(code)
        command = [_linker(), "-shared", "-fPIC", "-O3", "-o", str(whole), *map(str, objects)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise UnavailableError(f"linking failed: {(done.stderr.strip().splitlines() or [''])[-1]}")
        whole.replace(Path(folder) / f"{stem}-{_checksum(whole.read_bytes())}.so")


def machine_code(name: str) -> bytes:
    """Compile a kernel for this processor: an object file with a function ``mp2a_<name>``; imports numba."""
    target, module = _compile(name)
    return bytes(target.emit_object(module))


def assembly(name: str) -> str:
    """Compile a kernel for this processor; what a person can read of it. Imports numba."""
    target, module = _compile(name)
    return str(target.emit_assembly(module))


def _compile(name: str) -> tuple[Any, Any]:
    import llvmlite.binding as llvm
    import numba
    from numba import types

    from mp2a.kernels.source import KERNELS

    array = types.CPointer(types.CPointer(types.float64))
    form = types.void(*(types.int64 if kind == "n" else array for kind in ARGUMENTS[name]))
    compiled = numba.njit(form, no_cpython_wrapper=True, no_cfunc_wrapper=True)(KERNELS[name])
    (result,) = compiled.overloads.values()
    inner = result.fndesc.llvm_func_name
    # numba's functions take places for a result and an exception first, and have long names.
    arguments = ", ".join(f"{'i64' if kind == 'n' else 'ptr'} %a{i}" for i, kind in enumerate(ARGUMENTS[name]))
    entry = f"""
        define void @mp2a_{name}({arguments}) {{
            %result = alloca ptr
            %exception = alloca ptr
            %status = call i32 @{inner}(ptr %result, ptr %exception, {arguments})
            ret void
        }}"""
    module = llvm.parse_assembly(result.library.get_llvm_str() + entry)
    for function in module.functions:
        # Objects compiled by several processes use the same names.
        if not function.is_declaration and function.name != f"mp2a_{name}":
            function.linkage = "internal"
    for variable in module.global_variables:
        if not variable.is_declaration:
            variable.linkage = "internal"
    target = llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=",".join(filter(None, (llvm.get_host_cpu_features().flatten(), os.environ.get(CPU_FEATURES)))),
        opt=3,
        reloc="pic",
        codemodel="default",
    )
    return target, module
