"""What can be wrong with what a user hands over."""


class InputError(Exception):
    """A file, key or value that cannot be used; its text is one sentence for the user.

    Raise this when the mistake lies outside the program and the user can mend it: the
    command lines print the sentence and exit with status 2.
    """


class DamageError(InputError):
    """A file of a generated dataset that is missing, or is not what was written."""
