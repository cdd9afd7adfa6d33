"""Fixtures shared by all tests."""

collect_ignore = ["pyrender_worker.py"]  # runs in pyrender's own environment
