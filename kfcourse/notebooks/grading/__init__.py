"""Grading a folder of returned notebooks."""
