"""Rights: a secret key for each role, in a file that its owner alone reads."""

import os
import secrets
import stat
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from reprlib import repr as brief
from time import monotonic, sleep

from armguard.errors import KeyFileError, NoServiceError
from armguard.recording.rights import Role
from armguard.recording.ring import in_memory

# Lengths of a key [bytes]: BLAKE2s takes no longer one, a shorter one can be guessed.
LEAST_KEY, MOST_KEY = 16, 32

# Longest key file that is read [bytes].
MOST_FILE = 4096

# Permission bits of others than the owner.
OTHERS = stat.S_IRWXG | stat.S_IRWXO

# A key file that is not there yet is looked for that often [s].
KEYS_EVERY = 0.02

# Names the key file of clients that are given none.
VARIABLE = "ARMGUARD_KEYS"


Keys = Mapping[Role, bytes]


def new_keys() -> dict[Role, bytes]:
    """A random key of 128 bits for each role, in hexadecimal digits."""
    return {role: secrets.token_hex(16).encode() for role in Role}


def keys_path(port: int) -> Path:
    """Key file of the service on a port of this machine, run by this user.

    Args:
        port: Its port.
    """
    return in_memory() / f"armguard-{os.getuid()}" / f"{port}.keys"


def write_keys(path: Path, keys: Keys) -> None:
    """Write a key file, mode 0600; a file of that name is replaced in one step.

    Args:
        path: The file; its folder is made, mode 0700.
        keys: The keys.

    Raises:
        KeyFileError: The folder is another user's or open to others, or nothing can be
            written there.
    """
    text = "".join(f"{role.word} {key.decode()}\n" for role, key in keys.items())
    part = path.with_name(f"{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = path.parent.lstat()
        # In a folder that others may write to they could exchange the file.
        open_to_others = found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
        if not stat.S_ISDIR(found.st_mode) or found.st_uid not in (os.getuid(), 0):
            raise KeyFileError(
                f"{path.parent} is no folder of this user; remove it, or choose "
                "another place with --key-file"
            )
        if open_to_others and not found.st_mode & stat.S_ISVTX:
            raise KeyFileError(
                f"others may write to {path.parent}; run: chmod 700 {path.parent}"
            )
        with suppress(FileNotFoundError):
            part.unlink()
        handle = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "w") as file:
            file.write(text)
        part.replace(path)
    except OSError as error:
        raise KeyFileError(f"{path}: cannot write keys: {error.strerror}") from error


def read_keys(path: Path) -> dict[Role, bytes]:
    """The keys in a file: a role and its key on each line.

    Args:
        path: The file; this user's or root's, and readable by no other user.

    Raises:
        KeyFileError: There is no such file, others may read it, or a line is no key.
    """
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
        with os.fdopen(handle, "rb") as file:
            found = os.fstat(handle)
            if not stat.S_ISREG(found.st_mode):
                raise KeyFileError(f"{path} is no regular file, so no key file")
            if found.st_uid not in (os.getuid(), 0):
                raise KeyFileError(
                    f"{path} belongs to another user; do not use its keys"
                )
            if found.st_mode & OTHERS:
                raise KeyFileError(f"others may read {path}; run: chmod 600 {path}")
            text = file.read(MOST_FILE + 1)
    except OSError as error:
        raise KeyFileError(
            f"{path}: cannot read keys: {error.strerror}; give the file that the "
            "service has written, or the one of its --key-file"
        ) from error
    return parsed(path, text)


def parsed(path: Path, text: bytes) -> dict[Role, bytes]:
    """The keys in the text of a file.

    Raises:
        KeyFileError: A line is no key, a role has two, or there is none.
    """
    roles = {role.word.encode(): role for role in Role}
    keys: dict[Role, bytes] = {}
    form = "each line is a role and its key; 'armguard keys FILE' writes such a file"
    if len(text) > MOST_FILE:
        raise KeyFileError(f"{path} is longer than {MOST_FILE} bytes; {form}")
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if not words:
            continue
        if len(words) != 2 or words[0] not in roles:
            raise KeyFileError(f"{path}:{number}: no role and key; {form}")
        role, key = roles[words[0]], words[1]
        if not LEAST_KEY <= len(key) <= MOST_KEY:
            raise KeyFileError(
                f"{path}:{number}: the key has {len(key)} bytes; it must have "
                f"{LEAST_KEY} to {MOST_KEY}"
            )
        if role in keys or key in keys.values():
            raise KeyFileError(
                f"{path}:{number}: the role or the key is there already; each role "
                "needs a separate key"
            )
        keys[role] = key
    if not keys:
        raise KeyFileError(f"{path} holds no key; {form}")
    return keys


def found_keys(keys: Keys | str | Path | None, port: int) -> tuple[Keys, str]:
    """The keys of a client, and where they came from.

    Args:
        keys: The keys, or a file that holds them; if None the file that `ARMGUARD_KEYS`
            names, else the one that a service of this user has written.
        port: Port of that service.

    Raises:
        NoServiceError: No service of this user has written keys for that port.
        KeyFileError: The file cannot be used.
    """
    if isinstance(keys, Mapping):
        return keys, "the keys that were passed"
    if not isinstance(keys, str | Path | None):
        raise KeyFileError(
            f"keys is {brief(keys)}; give the path of a key file, or a key by role"
        )
    own = keys_path(port)
    path = Path(keys or os.environ.get(VARIABLE) or own)
    if path == own and not own.exists():
        raise NoServiceError(
            f"no service of this user runs at port {port} of this machine: there is no "
            f"key file {own}; for one of another user or machine pass its keys"
        )
    return read_keys(path), str(path)


def awaited_key(
    keys: Keys | str | Path | None, port: int, role: Role, end: float
) -> tuple[bytes, str]:
    """The key of a client's role, and where it came from.

    A service that starts writes its keys first.

    Args:
        keys: See `found_keys`.
        port: Port of the service.
        role: The role.
        end: Until when to wait for the keys, on the monotonic clock [s].

    Raises:
        NoServiceError: No service of this user has written keys for that port.
        KeyFileError: The file cannot be used, or has no such key.
    """
    while True:
        try:
            found, source = found_keys(keys, port)
            return key_of(role, found, source), source
        except NoServiceError:
            if monotonic() >= end:
                raise
            sleep(KEYS_EVERY)


def key_of(role: Role, keys: Keys, source: str) -> bytes:
    """The key of a role.

    Args:
        role: The role.
        keys: The keys there are.
        source: Where they came from, for the message.

    Raises:
        KeyFileError: There is none.
    """
    if role not in keys:
        there = ", ".join(one.word for one in keys)
        raise KeyFileError(f"{source} has no key for '{role.word}'; it has {there}")
    return keys[role]
