"""Boxes and walls that come, move and go: at once in the loop, later in the file."""
