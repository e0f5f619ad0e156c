"""Text that every file can hold."""


def encodable(text: str) -> str:
    r"""A text that UTF-8 can encode: lone surrogates as backslash sequences.

    Lone surrogates stand for bytes that are not text, as in names of files from a system with another encoding.

    Examples
    --------
    >>> print(encodable("K" + chr(0xDCFC) + "che"), encodable("Küche"))
    K\udcfcche Küche
    """
    return text.encode("utf-8", "backslashreplace").decode("utf-8")
