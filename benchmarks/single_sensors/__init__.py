"""Infrared sensors, capacitive pads, and the calibration of sensors."""
