"""The README's code runs as shown."""

import re
from pathlib import Path

README = Path(__file__).parents[1] / "README.md"


def test_the_code_of_the_readme_runs(capsys):
    (code,) = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
    assert 15 <= len(code.splitlines()) <= 22
    exec(compile(code, "README.md", "exec"), {})
    told = capsys.readouterr().out
    # Both are held off: they follow, but are told next to nothing of their wish.
    assert told.count("Action.FOLLOW") == 2
    assert "needs" in told
