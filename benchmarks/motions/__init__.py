"""Observables of motion: between samples, before contact, and what is watched."""
