"""Episodes of gripping, and who judges them."""
