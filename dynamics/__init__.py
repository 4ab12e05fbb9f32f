"""How the floater moves: equations of motion, integration, equilibria, stability."""
