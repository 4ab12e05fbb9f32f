"""How far is levitation from its limits?"""
