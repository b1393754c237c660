"""Clients of the node: `shoot`, `demo`, and what draws and measures it."""
