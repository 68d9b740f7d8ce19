"""Plans that are proven, and an oracle of them."""
