"""Files that are written whole or not at all, and locked while they are read, changed and written back."""

import contextlib
import errno
import fcntl
import os
import stat
from collections.abc import Iterator
from pathlib import Path

from mp2a.exceptions import OutputError

_PREFIX = ".mp2a-"
_NO_LOCKS = (errno.ENOTSUP, errno.ENOLCK, errno.ENOSYS, errno.EINVAL)


@contextlib.contextmanager
def atomic_write(path: str | Path) -> Iterator[Path]:
    """Write a file so that readers, and whoever is interrupted, find the old one or the new one and nothing between.

    The body of the ``with`` statement writes a new file to the path it is given, which has the name of the target. Once
    the body ends, that file is flushed to the disk and takes the place of the target, and the target's permissions. If
    the body raises, the target stays as it was and the new file is removed.

    What is not a regular file (``/dev/null``, a FIFO) stays what it is, and the bytes are written through it. A link
    stays as well, and the file that it points to is replaced.

    Parameters
    ----------
    path
        The target; its folder is created.

    Yields
    ------
    Path
        Where to write. There is no file yet; a file that can be written from front to back and sought in is fine.

    Raises
    ------
    OutputError
        If the target cannot be written, or the body raised any `OSError`: a full or read-only disk, for instance.
    """
    import shutil
    import tempfile

    with _output_errors(path):
        target = _regular_target(path)
        folder = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=target and target.parent))
        try:
            new = folder / (target or Path(path)).name
            yield new
            if target is not None:
                _move(new, target)
            else:
                with new.open("rb") as source, Path(path).open("wb") as sink:
                    shutil.copyfileobj(source, sink)
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def write_text(path: str | Path, text: str) -> None:
    """Write a text file in UTF-8 as `atomic_write` does.

    Parameters
    ----------
    path
        The target; its folder is created.
    text
        All of its new content.

    Raises
    ------
    OutputError
        If the target cannot be written; its `unsaved` is the text.
    """
    try:
        with atomic_write(path) as new:
            new.write_text(text, encoding="utf-8")
    except OutputError as error:
        error.unsaved = text
        raise


def check_writable(path: str | Path) -> None:
    """Find out before a long computation whether its result can be written; the folder is created, the target is not.

    Parameters
    ----------
    path
        The target.

    Raises
    ------
    OutputError
        If it could not be written now.
    """
    import tempfile

    with _output_errors(path):
        target = _regular_target(path)
        if target is not None:
            Path(tempfile.mkdtemp(prefix=_PREFIX, dir=target.parent)).rmdir()


@contextlib.contextmanager
def locked(path: str | Path) -> Iterator[None]:
    """Keep other processes and threads that call this out while a file is read, changed and written back.

    The lock is a file beside the target that is gone afterwards. On a file system without locks, and for what is not a
    regular file, nobody is kept out.

    Parameters
    ----------
    path
        The target, which need not exist; its folder is created.

    Raises
    ------
    OutputError
        If the lock cannot be made in the target's folder, where the target could not be written either.
    """
    with _output_errors(path):
        target = _regular_target(path)
        lock = Path(os.devnull) if target is None else target.with_name(f".{target.name}.lock")
        descriptor = None if target is None else _acquire(lock)
    try:
        yield
    finally:
        if descriptor is not None:
            with contextlib.suppress(OSError):
                lock.unlink()  # while it is held, or it could be another's by then
            os.close(descriptor)


def _acquire(lock: Path) -> int:
    """Open and lock a lock file that is still the one of that name once it is locked; return its descriptor."""
    while True:
        descriptor = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX)
            if os.path.samestat(os.fstat(descriptor), lock.stat()):
                return descriptor
        except FileNotFoundError:
            pass  # who held it has removed it
        except OSError as error:
            if error.errno in _NO_LOCKS:
                return descriptor
            os.close(descriptor)
            raise
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _regular_target(path: str | Path) -> Path | None:
    """Return the regular file, there or not yet, that a path leads to through its links; None for a device or a FIFO.

    Its folder is created. It is an error if a file is there that may not be written: it could be replaced all the same.
    """
    try:
        mode = Path(path).stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        pass
    else:
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        if not os.access(path, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        if not stat.S_ISREG(mode):
            return None
    target = Path(os.path.realpath(path))
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except FileExistsError as error:
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(target.parent)) from error
    return target


def _move(new: Path, target: Path) -> None:
    """Put a file in the place of another, on the disk before and after it."""
    with contextlib.suppress(FileNotFoundError):
        new.chmod(stat.S_IMODE(target.stat().st_mode))
    _flush(new)
    new.replace(target)
    with contextlib.suppress(OSError):  # not every file system has folders that can be flushed
        _flush(target.parent)


def _flush(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def _output_errors(path: str | Path) -> Iterator[None]:
    """Turn every error of the system into one that names the target and the cause."""
    try:
        yield
    except OutputError:
        raise
    except OSError as error:
        reason = error.strerror or str(error)
        if error.filename and _PREFIX not in str(error.filename):
            reason += f": {error.filename}"
        raise OutputError(f"{path}: cannot be written ({reason})") from error
