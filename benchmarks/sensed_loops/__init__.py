"""Closed loops among foreign bodies that sensors alone know."""
