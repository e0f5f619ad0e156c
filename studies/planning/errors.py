"""What is wrong with a study as a whole."""


class StudyError(ValueError):
    """A configuration that does not define a study; the message names the option and what to type."""
