"""Every fault we know, played against a running guard: declared against observed."""
