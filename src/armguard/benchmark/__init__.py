"""Our cycle beside its peers: figures, never assertions."""

from collections.abc import Callable
from typing import Any

from armguard.errors import UnknownNameError, did_you_mean

Bench = Callable[[int | None, Callable[[str], None]], dict[str, Any]]

NAMES = ("cycle", "stop", "filter", "gripping", "index", "memory", "distance", "scale")


def run(
    name: str,
    *,
    cycles: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> dict[str, Any]:
    """Run a benchmark.

    Args:
        name: cycle, stop, filter, gripping, index, memory, distance, scale, or all.
        cycles: Cycles to measure; each benchmark has its own default.
        progress: Called with a sentence before each part that takes a while.

    Returns:
        The figures; with "all", those of each under its name.

    Raises:
        UnknownNameError: There is no such benchmark.
    """
    from armguard.benchmark.cycle import bench_cycle
    from armguard.benchmark.distance import bench_distance
    from armguard.benchmark.filter import bench_filter
    from armguard.benchmark.gripping import bench_gripping
    from armguard.benchmark.index import bench_index
    from armguard.benchmark.memory import bench_memory
    from armguard.benchmark.scale import bench_scale
    from armguard.benchmark.stop import bench_stop

    tell = progress or (lambda sentence: None)
    benches: dict[str, Bench] = {
        "cycle": bench_cycle,
        "stop": bench_stop,
        "filter": bench_filter,
        "gripping": bench_gripping,
        "index": bench_index,
        "memory": bench_memory,
        "distance": bench_distance,
        "scale": bench_scale,
    }
    if name == "all":
        return {key: bench(cycles, tell) for key, bench in benches.items()}
    if name not in benches:
        near = did_you_mean(name, [*benches, "all"])
        raise UnknownNameError(f"no benchmark is named '{name}'; {near}")
    return benches[name](cycles, tell)


def print_result(answer: dict[str, Any]) -> str:
    """The figures as text, one a line."""
    lines: list[str] = []

    def walk(value: Any, path: str) -> None:
        if isinstance(value, dict):
            for key, item in value.items():
                walk(item, f"{path}.{key}" if path else str(key))
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            for item in value:
                parts = (
                    f"{key} {item[key]:.3g}"
                    if isinstance(item[key], float)
                    else f"{key} {item[key]}"
                    for key in item
                    if not isinstance(item[key], dict)
                )
                lines.append(f"{path}: " + ", ".join(parts))
        elif isinstance(value, float):
            lines.append(f"{path}: {value:.4g}")
        else:
            lines.append(f"{path}: {value}")

    walk(answer, "")
    return "\n".join(lines)
