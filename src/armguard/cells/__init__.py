"""A map of cells that depth sensors fill, and distances to its cells."""
