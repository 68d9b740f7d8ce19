"""Runs docs/adding-a-shape.md, so that its class is tested like any other."""

import re
from pathlib import Path

PAGE = Path(__file__).parents[1] / "docs" / "adding-a-shape.md"

(CODE,) = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
assert len([line for line in CODE.splitlines() if line.strip()]) < 40

names = {"__name__": "adding_a_shape_page"}
exec(compile(CODE, str(PAGE), "exec"), names)
Superellipsoid = names["Superellipsoid"]
