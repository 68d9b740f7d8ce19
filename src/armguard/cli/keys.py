"""`armguard keys`: write the keys of a service to a file."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from armguard.cli.console import say
from armguard.errors import ArmguardError


def keys(
    file: Annotated[Path, Argument(help="File to write; only its owner may read it.")],
    source: Annotated[
        Path | None,
        Option("--from", help="Copy keys from this file; new keys if left out."),
    ] = None,
    role: Annotated[
        list[str] | None,
        Option(help="Only this role; repeatable: observe, sense, command, administer."),
    ] = None,
) -> None:
    """Write a key file for a service and its clients.

    It has a key for each role, see `serve --key-file`.

    With --from and --role the file has only the keys that one client needs.
    """
    from armguard.recording.rights import Role
    from armguard.service.wire.keys import key_of, new_keys, read_keys, write_keys

    words = {one.word: one for one in Role}
    for word in role or ():
        if word not in words:
            raise ArmguardError(
                f"there is no role '{word}'; roles are {', '.join(words)}"
            )
    if file.exists():
        raise ArmguardError(f"{file} exists; remove it first, or choose another name")
    found = new_keys() if source is None else read_keys(source)
    chosen = [words[word] for word in role] if role else list(found)
    write_keys(file, {one: key_of(one, found, str(source)) for one in chosen})
    say(f"{file}: keys for {', '.join(one.word for one in chosen)}")
