"""The compiled kernels give what numpy's versions give, and where they cannot be, numpy's versions do the work."""

import ctypes
import fcntl
import importlib.util
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from helpers import relative_error
from hypothesis import given
from hypothesis import strategies as st

from mp2a import kernels
from mp2a.kernels import compiler, linker

COLUMNS = {"compose": (24, 24), "transform": (28, 24), "force": (28, 6, 6), "transform_force": (24, 6)}
BUILDS = importlib.util.find_spec("numba") is not None

seeds = st.integers(0, 2**32 - 1)
names = st.sampled_from(sorted(COLUMNS))
leads = st.one_of(
    st.just(()),
    st.integers(0, 40).map(lambda samples: (samples,)),
    st.lists(st.integers(1, 9), min_size=1, max_size=3).map(tuple),
)
builds = pytest.mark.skipif(not BUILDS, reason="needs numba")

REPORT = """
import sys
import numpy as np
from mp2a import kernels
from mp2a.kernels import compiler, linker
x = np.ones((9, 24))
assert np.array_equal(kernels.compose(x, x), kernels.numpy_version("compose")(x, x))
assert not {"numba", "llvmlite"} & set(sys.modules)
compiled, why = kernels.status()
print(int(compiled), why)
"""

# What is compiled for real is compiled by the cache below; where a build only has to happen, it copies that.
COPYING = """
import shutil, subprocess
subprocess.run = lambda command, **options: shutil.copy({!r}, command[3])
"""
SLOWLY = """
import shutil, subprocess, time
from mp2a.kernels import library
def run(command, **options):
    time.sleep(2)
    shutil.copy({!r}, command[3])
subprocess.run, began, clock = run, time.monotonic(), time.monotonic
time.monotonic = lambda: began + 10 * (clock() - began)
"""
STUCK = "from mp2a.kernels import library; library.BUILD_LIMIT = library._GRACE = 0.1\n"


def arrays(name, lead, seed):
    """Random inputs of a kernel."""
    rng = np.random.default_rng(seed)
    return [rng.normal(size=(*lead, columns)) for columns in COLUMNS[name]]


def paths(count, samples, seed):
    """Random path segments; composing wants them to have rotations."""
    rng = np.random.default_rng(seed)
    some = rng.normal(size=(count, samples, 24))
    turn, _ = np.linalg.qr(rng.normal(size=(count, samples, 3, 3)))
    some[..., :9] = (turn * np.linalg.det(turn)[..., None, None]).reshape(count, samples, 9)
    return some


def start(cache, code=REPORT, **environment):
    """Start a process that has its cache in a directory and its temporary files beside it."""
    scratch = cache.parent / "scratch"
    scratch.mkdir(exist_ok=True)
    inherited = {key: value for key, value in os.environ.items() if not key.startswith(("OMPI_", "PMI"))}
    variables = inherited | {"XDG_CACHE_HOME": str(cache), "TMPDIR": str(scratch)} | environment
    command = [sys.executable, "-c", code]
    return subprocess.Popen(command, env=variables, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def finish(process):
    """Return whether a started process has compiled kernels, why, and what it says on stderr."""
    out, said = process.communicate(timeout=300)
    assert process.returncode == 0, said
    compiled, _, why = out.strip().partition(" ")
    return bool(int(compiled)), why, said


def report(process):
    """Return whether a started process has compiled kernels, and why."""
    return finish(process)[:2]


@pytest.fixture(scope="module")
def cache():
    """Cache that two processes have filled at once, with no compiler and no linker on the path."""
    with tempfile.TemporaryDirectory() as folder:
        cache = Path(folder) / "cache"
        bare = {"PATH": folder, "CC": ""}
        for compiled, why, said in [finish(process) for process in (start(cache, **bare), start(cache, **bare))]:
            assert compiled, why
            assert not said
            assert Path(why).is_relative_to(cache)
        assert not list(cache.glob("mp2a/building-*"))
        yield cache


def built(cache):
    """Return the file of kernels in a cache."""
    (whole,) = cache.glob("mp2a/*.so")
    return str(whole)


@pytest.fixture
def copying(cache):
    """Program that reports as REPORT does, and builds by copying."""
    return COPYING.format(built(cache)) + REPORT


@pytest.fixture
def copy(cache, tmp_path):
    """Copy of that cache, to be spoiled."""
    return Path(shutil.copytree(cache, tmp_path / "cache"))


@builds
def test_kernels_are_compiled_here():
    assert kernels.status().compiled, kernels.status().why


@given(name=names, lead=leads, seed=seeds)
def test_equals_numpy(name, lead, seed):
    inputs = arrays(name, lead, seed)
    before = [array.copy() for array in inputs]
    expected = kernels.numpy_version(name)(*inputs)
    result = getattr(kernels, name)(*inputs)
    assert result.shape == expected.shape
    assert relative_error(result, expected) < 1e-14
    out = np.full(expected.shape, np.nan)
    assert getattr(kernels, name)(*inputs, out=out) is out
    assert np.array_equal(out, result)
    assert all(np.array_equal(a, b) for a, b in zip(inputs, before, strict=True))


@given(name=names, samples=st.integers(1, 40), seed=seeds)
def test_any_layout_of_the_inputs(name, samples, seed):
    inputs = arrays(name, (3, samples), seed)
    expected = kernels.numpy_version(name)(*inputs)
    kernel = getattr(kernels, name)
    strided = [np.asfortranarray(array) for array in inputs]
    assert relative_error(kernel(*strided), expected) < 1e-14
    every_other = np.zeros((3, 2 * samples, expected.shape[-1]))
    kernel(*inputs, out=every_other[:, ::2])
    assert relative_error(every_other[:, ::2], expected) < 1e-14
    assert not every_other[:, 1::2].any()
    shifted = []
    for array in inputs:  # numbers that start at an odd address
        raw = np.empty(array.nbytes + 1, np.uint8)[1:].view(np.float64).reshape(array.shape)
        raw[...] = array
        raw.flags.writeable = False
        shifted.append(raw)
    assert np.array_equal(kernel(*shifted), kernel(*inputs))
    few = [inputs[0][:1], *inputs[1:]]
    assert relative_error(kernel(*few), kernels.numpy_version(name)(*few)) < 1e-14


@given(name=names, samples=st.integers(1, 40), seed=seeds)
def test_result_may_replace_an_input(name, samples, seed):
    inputs = arrays(name, (samples,), seed)
    expected = getattr(kernels, name)(*inputs)
    replaced = next(array for array in inputs if array.shape == expected.shape)
    getattr(kernels, name)(*inputs, out=replaced)
    assert np.array_equal(replaced, expected)


@given(samples=st.integers(1, 40), seed=seeds)
def test_paths_are_associative(samples, seed):
    x, y, z = paths(3, samples, seed)
    left = kernels.compose(kernels.compose(x, y), z)
    assert relative_error(left, kernels.compose(x, kernels.compose(y, z))) < 1e-13


@given(samples=st.integers(1, 40), seed=seeds)
def test_move_across_two_paths(samples, seed):
    segment = np.random.default_rng(seed).normal(size=(samples, 28))
    upper, lower = paths(2, samples, seed)
    one_by_one = kernels.transform(kernels.transform(segment, lower), upper)
    assert relative_error(one_by_one, kernels.transform(segment, kernels.compose(upper, lower))) < 1e-13


@given(name=names, samples=st.integers(1, 40), data=st.data(), seed=seeds)
def test_what_is_not_finite_stays_in_its_sample(name, samples, data, seed):
    inputs = arrays(name, (samples,), seed)
    clean = getattr(kernels, name)(*inputs)
    bad = data.draw(st.integers(0, samples - 1))
    number = data.draw(st.sampled_from((np.nan, np.inf, -np.inf)))
    which = data.draw(st.integers(0, len(inputs) - 1))
    inputs[which][bad] = number
    result = getattr(kernels, name)(*inputs)
    others = np.arange(samples) != bad
    assert np.array_equal(result[others], clean[others])
    # Not a number where numpy's version gives none; where infinities meet, order decides what they give.
    with np.errstate(invalid="ignore"):
        expected = kernels.numpy_version(name)(*inputs)
    if np.isnan(number):
        assert np.array_equal(np.isnan(result), np.isnan(expected))
        assert np.isnan(result[bad]).any()
    assert np.array_equal(np.isfinite(result), np.isfinite(expected))


@pytest.mark.parametrize("name", COLUMNS)
def test_wrong_shapes_are_refused(name):
    inputs = arrays(name, (5,), 0)
    kernel = getattr(kernels, name)
    with pytest.raises(ValueError, match="numbers, not shape"):
        kernel(inputs[0][:, :-1], *inputs[1:])
    with pytest.raises(ValueError, match="numbers, not shape"):
        kernel(np.float64(1.0), *inputs[1:])
    with pytest.raises(ValueError, match="broadcast"):
        kernel(inputs[0][:3], *inputs[1:])
    with pytest.raises(ValueError, match="out must have shape"):
        kernel(*inputs, out=np.empty((4, kernel(*inputs).shape[-1])))


@builds
def test_ranks_load_without_numba(cache):
    compiled, why = report(start(cache, OMPI_COMM_WORLD_RANK="0"))
    assert compiled
    assert Path(why).is_relative_to(cache)


@builds
def test_other_processor_gets_its_own(cache):
    code = "from mp2a.kernels import library; library.processor = lambda: 'another'; print(0, library._purpose())"
    _, purpose = report(start(cache, code))
    assert not list(cache.glob(f"mp2a/*{purpose}*"))


@builds
def test_damaged_file_is_built_again(copy, copying):
    (whole,) = copy.glob("mp2a/*.so")
    whole.write_bytes(whole.read_bytes()[:5000])
    compiled, why = report(start(copy, copying))
    assert compiled
    assert Path(why).stat().st_size > 5000


@builds
def test_cache_that_cannot_be_written(tmp_path, copying):
    (tmp_path / "cache").write_text("a file where the directory should be")
    compiled, why = report(start(tmp_path / "cache", copying))
    assert compiled
    assert Path(why).is_relative_to(tmp_path / "scratch")
    # Others must not be able to put something there.
    Path(why).parent.chmod(0o777)
    compiled, why = report(start(tmp_path / "cache", OMPI_COMM_WORLD_RANK="0"))
    assert not compiled
    assert "own" in why


@builds
def test_ranks_wait_for_the_one_that_builds(tmp_path, cache):
    """Four ranks and an empty cache: all end with compiled kernels, however long that takes (here 20 s of theirs)."""
    code = SLOWLY.format(built(cache)) + REPORT
    ranks = [start(tmp_path / "cache", code, OMPI_COMM_WORLD_RANK=str(rank)) for rank in range(4)]
    for compiled, why, said in [finish(process) for process in ranks]:
        assert compiled, why
        assert not said


@builds
def test_earlier_failure(tmp_path, copying):
    """A rank takes an earlier failure's word, a launcher and a process by itself do not."""
    failing = "import sys; sys.modules['numba'] = None\n" + REPORT.replace('{"numba", "llvmlite"}', "{'llvmlite'}")
    rank = {"OMPI_COMM_WORLD_RANK": "0"}
    compiled, why = report(start(tmp_path / "cache", failing))
    assert not compiled
    assert "numba" in why
    assert report(start(tmp_path / "cache", copying, **rank)) == (False, why)
    assert report(start(tmp_path / "cache", copying.replace("x = ", "kernels.build(); x = "), **rank))[0]
    assert report(start(tmp_path / "cache", **rank))[0]


def test_no_compiled_kernels_are_said_once(tmp_path):
    failing = "import sys; sys.modules['numba'] = None\n" + REPORT.replace('{"numba", "llvmlite"}', "{'llvmlite'}")
    for rank, lines in ((None, 1), ("0", 1), ("1", 0)):
        environment = {} if rank is None else {"PMI_RANK": rank}
        compiled, why, said = finish(start(tmp_path / "cache", failing, **environment))
        assert not compiled
        assert said.splitlines() == [f"mp2a: no compiled kernels, numpy is 10 to 100 times slower: {why}"] * lines


def test_rank_whose_builder_is_stuck_says_so(tmp_path):
    code = "from mp2a.kernels import library; print(0, f'kernels-usual-{library._purpose()}')"
    _, stem = report(start(tmp_path / "cache", code))
    (tmp_path / "cache" / "mp2a").mkdir(parents=True, mode=0o700)
    with (tmp_path / "cache" / "mp2a" / f"{stem}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        compiled, why, said = finish(start(tmp_path / "cache", STUCK + REPORT, PMIX_RANK="3"))
    assert not compiled
    assert "another process" in why
    assert why in said


def test_every_kernel_is_in_one_part():
    parts = kernels.library.PARTS.values()
    assert sorted(name for names in parts for name in names) == sorted(kernels.library.ARGUMENTS)


@builds
def test_object_that_the_linker_does_not_take_is_loaded_by_llvm(tmp_path, monkeypatch):
    """As on another system, whose shared objects are of another kind."""

    def refuse(content):
        raise linker.LinkError("another system")

    monkeypatch.setattr(compiler, "shared_object", refuse)
    (tmp_path / "cache").mkdir(mode=0o700)
    compiler.make(str(tmp_path / "cache"), "kernels", ["compose"])
    path = kernels.library.find(tmp_path / "cache", "kernels")
    assert path.suffix == ".o"
    compose = kernels.library._open(path, ["compose"])["compose"]
    x, y = arrays("compose", (11,), 0)
    out = np.empty_like(x)
    compose(11, *(kernels.pointer(array) for array in (out, x, y)))
    assert np.array_equal(out, kernels.compose(x, y))


@builds
@given(samples=st.integers(1, 20), seed=seeds)
def test_matrices_of_recorded_rounds(samples, seed):
    rng = np.random.default_rng(seed)
    a, b, x, y = (rng.normal(size=(samples, columns)) for columns in (36, 36, 6, 6))
    out = np.empty_like(a)
    kernels.compiled("product")(samples, *(kernels.pointer(array) for array in (out, a, b)))
    left, right = a.reshape(-1, 6, 6), b.reshape(-1, 6, 6)
    assert relative_error(out, (left @ right).reshape(-1, 36)) < 1e-14
    expected = (left @ x[..., None])[..., 0] + y
    kernels.compiled("push")(samples, *(kernels.pointer(array) for array in (y, a, x, y)))  # the result replaces y
    assert relative_error(y, expected) < 1e-14


@builds
def test_rounds_call_mpi_and_give_up_for_a_while(tmp_path):
    """Steps of a rank with an MPI of our own: requests complete at the third look, of which there are two a call."""
    looks, started = [], []

    @ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_int, ctypes.c_void_p)
    def startall(count, requests):
        started.append(count)
        return 0 if count != 77 else 13

    @ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_int, ctypes.c_void_p, ctypes.POINTER(ctypes.c_int), ctypes.c_void_p)
    def testall(count, requests, flag, statuses):
        looks.append(count)
        flag[0] = len(looks) >= 3
        return 0

    x, y = (np.random.default_rng(k).normal(size=(2, 24)) for k in range(2))
    composed, total = np.empty_like(x), np.ones(48)
    number = {step: kernels.STEPS.index(step) for step in kernels.STEPS}
    steps = np.array(
        [
            (number["start"], 5, 0, 0, 0, 0, 0),
            (number["await"], 6, 0, 0, 0, 0, 0),
            (number["compose"], 2, *(array.ctypes.data for array in (composed, x, y)), 0, 0),
            (number["add"], 48, *(array.ctypes.data for array in (total, total, composed)), 0, 0),
            (number["start"], 77, 0, 0, 0, 0, 0),
        ]
    )
    functions = (ctypes.cast(function, ctypes.c_void_p).value for function in (startall, testall))
    program = np.array([steps.ctypes.data, *functions, 0, 2, 1, 1])
    run = kernels.rounds()
    assert run(program.ctypes.data, 0, 4) == 1
    assert looks == [6, 6]
    assert run(program.ctypes.data, 1, 4) == 4
    assert (started, looks) == ([5], [6, 6, 6])
    assert np.array_equal(composed, kernels.compose(x, y))
    assert np.array_equal(total, 1 + composed.ravel())
    assert run(program.ctypes.data, 4, 5) == -13


@builds
@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="features of x86-64")
def test_processor_made_to_lack_features(cache, tmp_path):
    ask = "import re; from mp2a.kernels import compiler, library; code = compiler.assembly('transform_force'); "
    ask += "print(0, library._purpose(), *[len(re.findall(f'%{r}mm', code)) for r in 'xyz'])"
    _, told = report(start(tmp_path / "cache", ask, MP2A_CPU_FEATURES="-sse3"))
    purpose, small, *wide = told.split()
    assert int(small) > 100
    assert wide == ["0", "0"]
    # They would be a file of their own.
    assert not list(cache.glob(f"mp2a/*{purpose}*"))
