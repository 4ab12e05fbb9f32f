"""What does a plate do, and are its currents right?"""
