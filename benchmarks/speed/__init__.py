"""How long cycles, distances and answers take, beside peers; never assertions.

Each benchmark is a module with a function `bench(cycles, progress)`, which returns its
figures. `cycles` is how many cycles, pairs or configurations are measured, `CYCLES` if
the user does not say; `progress` takes a sentence before each part.
"""
