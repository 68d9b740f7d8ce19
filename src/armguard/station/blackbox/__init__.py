"""Edge: what the loop wrote down, kept, told and run again."""
