"""Numbers as people read them."""

from html import escape
from math import isfinite

NOTHING = "–"


def plot_text(text: object) -> str:
    """Text for a plot; Plotly reads some tags in it, so that they are escaped."""
    return escape(str(text), quote=False)


def duration(seconds: float) -> str:
    """A length of time.

    Example:
        >>> duration(0.0123), duration(12.3), duration(754.0), duration(7265.0)
        ('12.3 ms', '12.3 s', '12 min 34 s', '2 h 1 min 5 s')
    """
    if not isfinite(seconds):
        return NOTHING
    if seconds < 1.0:
        return f"{seconds * 1e3:.1f} ms"
    if seconds < 120.0:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return (f"{hours} h " if hours else "") + f"{minutes} min {rest} s"


def clock(seconds: float) -> str:
    """A time since the first cycle.

    Example:
        >>> clock(3.0614), clock(754.25), clock(3725.5)
        ('0:03.061', '12:34.250', '1:02:05.500')
    """
    if not isfinite(seconds):
        return NOTHING
    thousandths = round(abs(seconds) * 1e3)
    minutes, rest = divmod(thousandths, 60_000)
    hours, minutes = divmod(minutes, 60)
    sign = "-" if seconds < 0.0 and thousandths else ""
    lead = f"{hours}:{minutes:02d}" if hours else f"{minutes}"
    return f"{sign}{lead}:{rest / 1e3:06.3f}"


def millimetres(length: float | None, digits: int = 1) -> str:
    """A length [m] in millimetres."""
    if length is None or not isfinite(length):
        return NOTHING
    # + 0.0: no minus sign before a value that rounds to zero.
    return f"{round(length * 1e3, digits) + 0.0:.{digits}f} mm"


def short_time(seconds: float | None) -> str:
    """A computing time.

    Example:
        >>> short_time(12.34e-6), short_time(1.234e-3), short_time(2.0)
        ('12.3 µs', '1.23 ms', '2.00 s')
    """
    if seconds is None or not isfinite(seconds):
        return NOTHING
    if seconds < 1e-3:
        return f"{seconds * 1e6:.1f} µs"
    return f"{seconds * 1e3:.2f} ms" if seconds < 1.0 else f"{seconds:.2f} s"


def share(part: float, whole: float) -> str:
    """A part in percent; only zero reads as 0.

    Example:
        >>> share(1, 3), share(1, 1_000_000), share(0, 5), share(2, 0)
        ('33.3 %', '< 0.1 %', '0 %', '–')
    """
    if not whole:
        return NOTHING
    percent = 100.0 * part / whole
    if 0.0 < percent < 0.1:
        return "< 0.1 %"
    return f"{percent:.1f} %" if percent % 1.0 else f"{percent:.0f} %"


def count(number: int, noun: str, plural: str = "") -> str:
    """A number with its noun.

    Example:
        >>> count(1, "stop"), count(1200, "cycle"), count(0, "near miss", "near misses")
        ('1 stop', '1,200 cycles', 'no near misses')
    """
    plural = plural or f"{noun}s"
    if number == 0:
        return f"no {plural}"
    return f"{number:,} {noun if number == 1 else plural}"
