"""Files are whole or untouched, whatever becomes of the disk and of the process; devices and links stay."""

import contextlib
import os
import resource
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from mp2a import files
from mp2a.exceptions import OutputError


def contents(folder):
    return {path.name: path.read_text() for path in folder.iterdir()}


def python(code, *arguments, **options):
    """Run a program in a process of its own."""
    return subprocess.Popen([sys.executable, "-c", code, *map(str, arguments)], **options)


@contextlib.contextmanager
def full_disk(size=1000):
    """Let files grow to so many bytes only, which is an error like that of a disk without space."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_new_and_old_files_are_written(tmp_path):
    path = tmp_path / "new" / "folder" / "file.txt"
    files.write_text(path, "one")
    path.chmod(0o640)
    files.write_text(str(path), "twö")
    assert contents(path.parent) == {"file.txt": "twö"}
    assert path.stat().st_mode & 0o777 == 0o640


def test_a_new_file_has_the_permissions_of_any_new_file(tmp_path):
    (tmp_path / "usual").write_text("")
    files.write_text(tmp_path / "ours", "")
    assert (tmp_path / "ours").stat().st_mode == (tmp_path / "usual").stat().st_mode


def test_writers_that_choose_a_format_by_the_name(tmp_path):
    with files.atomic_write(tmp_path / "numbers.npz") as new:
        assert not new.exists()
        np.savez_compressed(new, a=np.arange(3))
    assert np.load(tmp_path / "numbers.npz")["a"].tolist() == [0, 1, 2]


@pytest.mark.parametrize("error", [ValueError("x"), KeyboardInterrupt()])
def test_a_body_that_raises_leaves_the_old_file(tmp_path, error):
    path = tmp_path / "file.txt"
    path.write_text("old")
    with pytest.raises(type(error)), files.atomic_write(path) as new:
        new.write_text("half of it")
        raise error
    assert contents(tmp_path) == {"file.txt": "old"}


def test_a_full_disk(tmp_path):
    path = tmp_path / "file.txt"
    path.write_text("old")
    with full_disk(), pytest.raises(OutputError, match=r"file\.txt: cannot be written \(File too large\)") as caught:
        files.write_text(path, "x" * 2000)
    assert caught.value.unsaved == "x" * 2000
    numbers = tmp_path / "numbers.npz"
    with full_disk(), pytest.raises(OutputError, match="written"), files.atomic_write(numbers) as new:
        np.savez_compressed(new, a=np.random.default_rng(0).random(1000))
    assert contents(tmp_path) == {"file.txt": "old"}
    with pytest.raises(OutputError, match=r"/dev/full: cannot be written \(No space left on device\)"):
        files.write_text("/dev/full", "x")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_no_permission(tmp_path):
    path = tmp_path / "file.txt"
    path.write_text("old")
    path.chmod(0o400)
    with pytest.raises(OutputError, match=r"file\.txt: cannot be written \(Permission denied\)"):
        files.write_text(path, "new")
    path.chmod(0o600)
    tmp_path.chmod(0o500)
    for action in (lambda: files.write_text(path, "new"), lambda: files.check_writable(path)):
        with pytest.raises(OutputError, match=r"file\.txt: cannot be written \(Permission denied\)"):
            action()


@pytest.mark.skipif(not Path("/sys/kernel").is_dir(), reason="no file system here that nobody may write to")
@pytest.mark.parametrize("action", [files.check_writable, lambda path: files.write_text(path, "")])
def test_a_read_only_file_system(action):
    with pytest.raises(OutputError, match=r"/sys/kernel/x.json: cannot be written \((Read-only|Permission|Operation)"):
        action("/sys/kernel/x.json")


def test_what_is_in_the_way_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    inside = tmp_path / "file" / "x.json"
    for use in (
        files.check_writable,
        lambda path: files.write_text(path, ""),
        lambda path: files.locked(path).__enter__(),
    ):
        with pytest.raises(OutputError, match=rf"{inside}: cannot be written \(Not a directory: {inside.parent}\)"):
            use(inside)
        with pytest.raises(OutputError, match=r"cannot be written \(Not a directory: "):
            use(inside / "deeper" / "x.json")
        with pytest.raises(OutputError, match=rf"{tmp_path}: cannot be written \(Is a directory\)"):
            use(tmp_path)


def test_a_check_changes_nothing(tmp_path):
    (tmp_path / "old").write_text("old")
    files.check_writable(tmp_path / "old")
    files.check_writable(tmp_path / "new")
    files.check_writable("/dev/null")
    assert contents(tmp_path) == {"old": "old"}


@pytest.mark.parametrize("dangling", [False, True])
def test_a_link_stays_and_its_target_is_replaced(tmp_path, dangling):
    (tmp_path / "data").mkdir()
    target, link = tmp_path / "data" / "target", tmp_path / "link"
    link.symlink_to("data/target")
    if not dangling:
        target.write_text("old")
    with files.locked(link):
        files.write_text(link, "new")
    assert link.is_symlink()
    assert contents(tmp_path / "data") == {"target": "new"}


def test_devices_stay_and_fifos_are_written_through(tmp_path):
    null = Path("/dev/null").stat()
    with files.locked("/dev/null"):
        files.write_text("/dev/null", "x")
    assert Path("/dev/null").stat()[:3] == null[:3]
    fifo, received = tmp_path / "fifo", []
    os.mkfifo(fifo)
    reader = threading.Thread(target=lambda: received.append(fifo.read_text()))
    reader.start()
    files.write_text(fifo, "through")
    reader.join(10)
    assert received == ["through"]
    assert [path.name for path in tmp_path.iterdir()] == ["fifo"]
    assert fifo.is_fifo()


def test_killed_in_the_middle_the_old_file_stays(tmp_path):
    path = tmp_path / "file.txt"
    path.write_text("old")
    code = """import sys, time
from mp2a import files
with files.atomic_write(sys.argv[1]) as new:
    new.write_text("half of it")
    print(flush=True)
    time.sleep(60)"""
    with python(code, path, stdout=subprocess.PIPE) as writer:
        writer.stdout.readline()
        writer.send_signal(signal.SIGKILL)
    assert path.read_text() == "old"
    files.write_text(path, "new")
    assert path.read_text() == "new"


def test_those_who_lock_a_file_do_not_lose_what_others_write(tmp_path):
    path = tmp_path / "count"
    path.write_text("0")
    code = """import sys
from pathlib import Path
from mp2a import files
path = Path(sys.argv[1])
for _ in range(100):
    with files.locked(path):
        files.write_text(path, str(int(path.read_text()) + 1))"""
    for process in [python(code, path) for _ in range(3)]:
        assert process.wait(60) == 0
    assert contents(tmp_path) == {"count": "300"}


def test_a_lock_outlives_nobody(tmp_path):
    path = tmp_path / "file"
    code = """import os, signal, sys
from mp2a import files
with files.locked(sys.argv[1]):
    os.kill(os.getpid(), signal.SIGKILL)"""
    assert python(code, path).wait(60) == -signal.SIGKILL
    with files.locked(path):
        pass
    assert not contents(tmp_path)


def test_a_file_system_without_locks(tmp_path, monkeypatch):
    def flock(descriptor, operation):
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(files.fcntl, "flock", flock)
    with files.locked(tmp_path / "file"):
        files.write_text(tmp_path / "file", "new")
    assert contents(tmp_path) == {"file": "new"}
