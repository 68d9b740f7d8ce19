"""Whether two processes share a clock."""

from pathlib import Path

BOOT = Path("/proc/sys/kernel/random/boot_id")


def boot_id() -> str:
    """Identifies this start of this machine; "" where the system does not."""
    try:
        return BOOT.read_text().strip()
    except OSError:
        return ""
