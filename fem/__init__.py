"""What field each body makes: closed forms, finite elements, tables."""
