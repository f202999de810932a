"""A rank process loads only what it runs, and no module knows one above it."""

import ast
import builtins
import importlib
import re
import subprocess
import sys
import types
from pathlib import Path

import pytest

import mp2a

ROOT = Path(mp2a.__file__).parent
MODULES = sorted(ROOT.rglob("*.py"))

PAGE = (ROOT.parent / "docs" / "architecture.md").read_text(encoding="utf-8")
# From the bottom to the top, as the page has them from the top; what is not named there stands above all of it.
LAYERS = [
    name
    for line in reversed(PAGE.partition("```layers\n")[2].partition("```")[0].splitlines())
    for name in reversed(re.split(r"\s{2,}", line)[0].split())
]
NOT_ON_A_RANK = (
    "matplotlib", "pinocchio", "rich", "typer", "click", "argparse", "mujoco", "scipy", "numba",
    "shapely", "foxglove", "rosbags", "tomllib", "tomli", "lark",
)  # fmt: skip


def layer(module):
    """Height of a module ``mp2a.x.y``; of names that mp2a itself holds None."""
    parts = module.split(".")
    if len(parts) == 1 or parts[1] not in LAYERS:
        return None
    return LAYERS.index(parts[1])


def module_name(path):
    parts = ["mp2a", *path.relative_to(ROOT).with_suffix("").parts]
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports(path):
    """Modules of mp2a that a file imports, anywhere in it, and the line."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: relative import"
            names = [f"mp2a.{alias.name}" for alias in node.names] if node.module == "mp2a" else [node.module]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            continue
        yield from ((name, node.lineno) for name in names if name.split(".")[0] == "mp2a")


def loaded_by(statement):
    """Top-level packages in a fresh interpreter after a statement."""
    code = f"import sys\n{statement}\nprint(*{{name.split('.')[0] for name in sys.modules}})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    return set(done.stdout.split())


@pytest.mark.parametrize(
    "statement",
    [
        "import mp2a",
        "import mp2a; mp2a.Model.uniform(4).random_state(body=2); mp2a.InputError; mp2a.InverseDynamics",
        "import mp2a; c = mp2a.Model.uniform(4); mp2a.rnea(c, *c.random_state(), method='kogge-stone')",
        "import mp2a.distributed",
        "import mp2a.simulator, mp2a.simulator.ranks, mp2a.simulator.outcomes",
        "import mp2a, mp2a.formation.robot_models",
        "from mp2a.formation import *\n"
        "FormationController(Formation.of('line', 3), waypoints([[0, 0], [1, 0]])).step()",
        "from mpi4py import MPI; import mp2a; c = mp2a.Model.uniform(1)\n"
        "with mp2a.DistributedModel(MPI.COMM_SELF, c) as d: d.rnea(*c.random_state())",
    ],
)
def test_rank_loads_only_what_it_runs(statement):
    packages = loaded_by(statement)
    assert "mp2a" in packages
    assert not packages & set(NOT_ON_A_RANK)


def test_import_of_the_package_alone_loads_no_numpy():
    assert not loaded_by("import mp2a") & {"numpy", "mpi4py"}


def test_a_watchdog_is_lean():
    assert not loaded_by("import mp2a.robots.watchdog") & {"numpy", "mpi4py", "rospy", "cyclonedds"}


def test_every_public_name_is_there():
    for name in mp2a.__all__:
        assert getattr(mp2a, name) is not None
    loaded_by("import mp2a; [getattr(mp2a, name) for name in mp2a.__all__]")  # where no other module was loaded
    assert dir(mp2a) == sorted(mp2a.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        mp2a.nothing  # noqa: B018


def test_docs_list_the_public_names_and_no_others():
    rows = re.findall(r"^\| `mp2a\.(\w+)` \| (.+) \|$", (ROOT.parent / "docs" / "api.md").read_text(), flags=re.M)
    names = [name for name, _ in rows]
    assert len(set(names)) == len(names)
    assert set(names) == set(mp2a.__all__)
    assert len(names) <= 45  # what is public is meant
    for name, text in rows:
        value = getattr(mp2a, name)
        for member in re.findall(r"`(\w+)(?:\(\))?`", text) if isinstance(value, type | types.ModuleType) else ():
            if not hasattr(value, member) and not hasattr(builtins, member):
                assert importlib.import_module(f"{value.__name__}.{member}"), f"mp2a.{name}.{member}"


@pytest.mark.parametrize("name", mp2a._MODULES)
def test_names_of_public_packages_are_there(name):
    module = getattr(mp2a, name)
    for public in getattr(module, "__all__", ()):
        assert getattr(module, public) is not None
    assert module.__doc__


def test_types_are_for_users_too():
    assert (ROOT / "py.typed").exists()


def test_every_module_has_a_place():
    top = {module_name(path).split(".")[1] for path in MODULES if path.parent != ROOT or path.stem[0] != "_"}
    assert top == set(LAYERS)


@pytest.mark.parametrize("path", MODULES, ids=module_name)
def test_no_module_knows_one_above_it(path):
    own = layer(module_name(path))
    for name, line in imports(path):
        other = layer(name)
        assert own is None or other is None or other <= own, f"{path.name}:{line} imports {name}, which is above it"


@pytest.mark.parametrize("path", MODULES, ids=module_name)
def test_files_stay_small_enough_to_read(path):
    assert len(path.read_text().splitlines()) <= 400
