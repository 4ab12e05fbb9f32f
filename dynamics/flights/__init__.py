"""Simulated trajectories, single and in batches."""
