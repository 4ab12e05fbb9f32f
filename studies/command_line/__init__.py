"""How does a user call the program?"""
