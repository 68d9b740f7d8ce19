"""Real-time collision guard for robot arms: joint angles in, verdicts out."""
