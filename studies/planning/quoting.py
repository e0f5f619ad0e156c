"""What a shell takes off a command line that Hydra needs."""

import re


def quoted(argument):
    """An argument with its value in quotes, if it is ``segmenter.command=`` and a value that has none.

    A shell turns ``segmenter.command='mytool {mesh} {labels}'`` into ``segmenter.command=mytool {mesh} {labels}``, and
    Hydra takes the braces of that for its own. Any other argument, and quoted values, stay as they are.

    Parameters
    ----------
    argument : str, of ``sys.argv``

    Returns
    -------
    str
    """
    key, _, command = argument.partition("=")
    if key != "segmenter.command" or re.fullmatch(r"""(['"]).*\1""", command) or command in ("", "???"):
        return argument
    # Of Hydra's quoted strings: a backslash is one, but before a quote, where it is half of one.
    escaped = re.sub(r"(\\*)('|$)", lambda found: found[1] * 2 + found[2].replace("'", r"\'"), command)
    return f"{key}='{escaped}'"
