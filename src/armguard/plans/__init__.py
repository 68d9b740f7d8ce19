"""Plans as controllers execute them, and proofs over whole plans."""
