"""Input files are regular files of at most a given size."""

import errno
import os
import stat
from pathlib import Path

# Characters of a name or a value that a message shows.
SHOWN = 60


def check_file(path: Path, most: int) -> int:
    """Size of a regular file [byte].

    Args:
        path: The file.
        most: The most bytes it may have.

    Raises:
        OSError: There is no such file, it is a device, a pipe or a folder, or it is
            larger; `strerror` says which.
    """
    try:
        found = path.stat()
    except ValueError:
        raise OSError(errno.EINVAL, "its name holds a NUL or no text") from None
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, "it is no regular file", str(path))
    if found.st_size > most:
        raise OSError(
            errno.EFBIG,
            f"it has {found.st_size / 1e6:.1f} MB; the limit is {most / 1e6:g} MB",
            str(path),
        )
    return found.st_size


def is_file(path: Path) -> bool:
    """Whether there is a regular file of that name, whatever the name holds."""
    try:
        return stat.S_ISREG(path.stat().st_mode)
    except (OSError, ValueError):
        return False


def read_bytes(path: Path, most: int) -> bytes:
    """A regular file's bytes.

    Args:
        path: The file.
        most: The most bytes it may have.

    Raises:
        OSError: See `check_file`.
    """
    size = check_file(path, most)
    # A file that was exchanged for a pipe meanwhile must not block.
    with os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK), "rb") as file:
        data = file.read(size + 1)
    if len(data) > size:
        raise OSError(errno.EFBIG, "it grows while it is read", str(path))
    return data


def read_text(path: Path, most: int) -> str:
    """A regular file's text in UTF-8, without a byte order mark, lines ended by LF.

    Raises:
        OSError: See `check_file`.
        UnicodeDecodeError: It is no UTF-8.
    """
    text = read_bytes(path, most).decode("utf-8-sig")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def shown(text: str) -> str:
    """A text as a message shows it, cut if it is long."""
    return text if len(text) <= SHOWN else f"{text[: SHOWN - 1]}…"
