"""Two arms beside a belt, and what judges their coordination on line."""
