"""The error of all that a user can mend: command lines and files that cannot be used."""


class InputError(ValueError):
    """What the user gave cannot be used; the message names it, the rule and the value."""
