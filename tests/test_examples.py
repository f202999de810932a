"""Every example and every block of the tutorial runs."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from mp2a import launch

ROOT = Path(__file__).parents[1]
UNDER_MPI = {"formation.py"}
FEWER = {"line.py": ["6"], "falling_chain.py": ["100"]}


@pytest.mark.parametrize("example", sorted((ROOT / "examples").glob("*.py")), ids=lambda path: path.stem)
def test_example(example):
    ranks = 5 if example.name in UNDER_MPI else None
    program = [sys.executable, *(["-m", "mpi4py"] if ranks else []), str(example), *FEWER.get(example.name, [])]
    if ranks:
        done = launch.run(ranks, program, timeout=120, stdout=subprocess.PIPE, text=True)
    else:
        done = subprocess.run(program, timeout=120, stdout=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 0
    assert len(done.stdout.splitlines()) >= 3


@pytest.mark.parametrize(
    "page", ["docs/tutorial.md", "docs/choreography.md", "docs/formation.md", "docs/simulator.md", "README.md"]
)
def test_python_of_a_page(page):
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), flags=re.S)
    assert blocks
    subprocess.run(
        [sys.executable, "-c", "\n".join(blocks)], check=True, timeout=120, stdout=subprocess.DEVNULL, cwd=ROOT
    )


def test_links_between_the_docs_lead_somewhere():
    for page in [*(ROOT / "docs").glob("*.md"), ROOT / "README.md"]:
        for target in re.findall(r"\]\(([^)#]+)", page.read_text()):
            if "://" not in target:
                assert (page.parent / target).exists(), f"{page.name} links to {target}"
