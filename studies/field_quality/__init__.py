"""How good is each model of the rotor's field, and what does it cost?"""
