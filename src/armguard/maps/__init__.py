"""Maps of what is free: which parts of plans may be executed together, and when."""
