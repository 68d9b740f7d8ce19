"""A cycle of the service from message to message: its arrays and its kernels."""
