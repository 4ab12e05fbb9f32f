"""What we learn: the command line, results, figures, sweeps."""
