"""Two Pandas on both sides of a conveyor, as data, and a job that they execute."""

from pathlib import Path

FOLDER = Path(__file__).parent


def conveyor_path() -> Path:
    """The scene file; it needs the extra `robots`."""
    return FOLDER / "conveyor.yaml"


def conveyor_job_path() -> Path:
    """The cell job: plans of both arms, the belt, and four items that arrive."""
    return FOLDER / "job.yaml"
