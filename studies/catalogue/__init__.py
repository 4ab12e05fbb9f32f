"""The studies of the catalogue, and what runs and reports them."""
