"""Studies and pictures made with the engine."""
