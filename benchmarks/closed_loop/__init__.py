"""The closed loop: guard, plant, operator and judge, episode after episode."""
