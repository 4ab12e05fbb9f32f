"""Closed forms: fields of uniformly polarised bodies, coils and conducting spheres."""
