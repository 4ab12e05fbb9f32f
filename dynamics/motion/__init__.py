"""The floater's equations of motion and the effects that act in them."""
