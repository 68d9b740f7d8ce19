"""Motion files of two arms that turn and lift, as text."""

HEADER = "t,a/turn,a/lift,b/turn,b/lift"


def times(*stamps, name="t", moves=0.01):
    """A motion file with these times."""
    rows = (f"{t},{0.5 + moves * k},0.1,0.5,0.1" for k, t in enumerate(stamps))
    return "\n".join([name + HEADER[1:], *rows]) + "\n"


def table(*rows, header=HEADER):
    """A motion file of these rows."""
    return "\n".join([header, *rows]) + "\n"
