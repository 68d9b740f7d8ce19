"""Episodes of getting out of the way of what comes, and who judges them."""
