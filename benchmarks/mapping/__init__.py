"""Plans of two arms that are mapped, and an oracle of them."""
