"""Motion of arms among objects that the scene has, or that sensors alone know."""
