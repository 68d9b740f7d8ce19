"""How much room a guard leaves: what it warns at, beside the least that would do."""
