"""Independent solutions of what the program computes, slower or narrower than its own: only tests ask them."""
