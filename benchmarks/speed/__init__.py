"""How long cycles, distances and answers take, beside peers; never assertions."""
