"""Command line, results, figures, sweeps and studies."""
