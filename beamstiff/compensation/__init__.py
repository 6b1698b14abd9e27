"""Correction of tool paths: commands that bring the tool of the real robot to its targets, under load."""
