"""Plays whose every cycle is known: what a change of the program alters shows here."""
