"""What is where: robots, objects, allowed pairs, scene files; flat tables."""
